"""Kernels of tools; participants import them from here."""

from softseam_services.tools.kernels.gap import (
    all_finite,
    cell_distances,
    least_gaps,
    rotate,
    rotate_back,
    tool_gap,
    tool_reach,
    tool_travel,
)
from softseam_services.tools.kernels.sides import overlap, side_gap
from softseam_services.tools.kernels.solids import box_gap

__all__ = [
    "all_finite",
    "box_gap",
    "cell_distances",
    "least_gaps",
    "overlap",
    "rotate",
    "rotate_back",
    "side_gap",
    "tool_gap",
    "tool_reach",
    "tool_travel",
]
