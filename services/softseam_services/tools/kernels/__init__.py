"""Kernels of tools; participants import them from here."""

from softseam_services.shapes.box import box_gap
from softseam_services.shapes.distance import tool_gap
from softseam_services.shapes.turns import rotate, rotate_back
from softseam_services.tools.kernels.gap import SLOW, all_finite, cell_distances, least_gaps, swept_gap, tool_travel
from softseam_services.tools.kernels.patch import (
    DENSE,
    FLAT,
    cover_patch,
    has_flats,
    plane_gap,
    round_by,
    yields_under_round,
)
from softseam_services.tools.kernels.sides import overlap, side_along, side_gap

__all__ = [
    "DENSE",
    "FLAT",
    "SLOW",
    "all_finite",
    "box_gap",
    "cell_distances",
    "cover_patch",
    "has_flats",
    "least_gaps",
    "overlap",
    "plane_gap",
    "rotate",
    "rotate_back",
    "round_by",
    "side_along",
    "side_gap",
    "swept_gap",
    "tool_gap",
    "tool_travel",
    "yields_under_round",
]
