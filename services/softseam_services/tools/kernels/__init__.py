"""Kernels of tools; participants import them from here."""

from softseam_services.shapes.box import box_gap
from softseam_services.shapes.distance import tool_gap
from softseam_services.shapes.turns import rotate, rotate_back
from softseam_services.tools.kernels.gap import SLOW, all_finite, cell_distances, least_gaps, swept_gap, tool_travel
from softseam_services.tools.kernels.patch import (
    DENSE,
    LIGHT,
    SAG,
    WIDE,
    patch_press,
    patch_yields,
    plane_gap,
    press,
    sag_by,
    sag_under,
    steepness,
)
from softseam_services.tools.kernels.sides import side_along, side_gap

__all__ = [
    "DENSE",
    "LIGHT",
    "SAG",
    "SLOW",
    "WIDE",
    "all_finite",
    "box_gap",
    "cell_distances",
    "least_gaps",
    "patch_press",
    "patch_yields",
    "plane_gap",
    "press",
    "rotate",
    "rotate_back",
    "sag_by",
    "sag_under",
    "side_along",
    "side_gap",
    "steepness",
    "swept_gap",
    "tool_gap",
    "tool_travel",
]
