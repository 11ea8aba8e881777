"""A capsule along z, by its radius and half its length."""

import numpy as np

from softseam_protocol.scene.parts import CapsulePart
from softseam_protocol.scene.tools import CapsuleTool
from softseam_services.jit import njit
from softseam_services.shapes.branches import CAPSULE
from softseam_services.shapes.geometry import Geometry, Sameness, around, ends
from softseam_services.shapes.shape import Files, Shape
from softseam_services.shapes.turns import quaternion_onto


@njit(cache=True, error_model="numpy")
def capsule_gap(radius, half, x, y, z):
    """All points within `radius` of the segment from -half to half along z [m]; on the segment the normal is +x."""
    rise = z - min(max(z, -half), half)
    distance = np.sqrt(x * x + y * y + rise * rise)
    if distance == 0.0:
        return -radius, 1.0, 0.0, 0.0
    return distance - radius, x / distance, y / distance, rise / distance


def geometry(spec: CapsuleTool | CapsulePart, files: Files) -> Geometry:
    """Numbers are (radius, half length, 0) [m]."""
    radius, half = spec.radius, 0.5 * spec.length
    return Geometry(
        numbers=np.array([radius, half, 0.0]),
        outline=around(radius, half, half + radius),
        reach=radius + half,
        orientation=quaternion_onto(np.array(spec.axis)),
        extent=lambda direction: float(radius + abs(direction[2]) * half),
        sameness=Sameness((1.0, 1.0, 2.0)),
        core=ends(radius, half),
    )


SHAPE = Shape(geometry, inline=CAPSULE)
