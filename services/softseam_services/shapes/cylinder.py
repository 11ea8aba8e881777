"""A cylinder along z, by its radius, half its length and the radius of its rims, sharp as a scene has them."""

import numpy as np

from softseam_protocol.scene.parts import CylinderPart
from softseam_protocol.scene.tools import CylinderTool
from softseam_services.jit import njit
from softseam_services.shapes.branches import CYLINDER
from softseam_services.shapes.geometry import Geometry, Sameness, around, ends
from softseam_services.shapes.shape import Files, Shape
from softseam_services.shapes.turns import quaternion_onto


@njit(cache=True, error_model="numpy")
def cylinder_gap(radius, half, rim, x, y, z):
    """A cylinder from -half to half along z with flat ends, whose rims have a radius [m]; on the axis +x is outward."""
    from_axis = np.sqrt(x * x + y * y)
    ux, uy = (x / from_axis, y / from_axis) if from_axis > 0.0 else (1.0, 0.0)
    side = 1.0 if z >= 0.0 else -1.0
    out, above = from_axis - (radius - rim), abs(z) - (half - rim)
    if out > 0.0 and above > 0.0:
        gap = np.sqrt(out * out + above * above)
        return gap - rim, out / gap * ux, out / gap * uy, above / gap * side
    if out >= above:
        return out - rim, ux, uy, 0.0
    return above - rim, 0.0, 0.0, side


def geometry(spec: CylinderTool | CylinderPart, files: Files) -> Geometry:
    """Numbers are (radius, half length, radius of the rims) [m]."""
    radius, half = spec.radius, 0.5 * spec.length
    return Geometry(
        numbers=np.array([radius, half, 0.0]),
        outline=around(radius, half, half),
        reach=float(np.sqrt(radius**2 + half**2)),
        orientation=quaternion_onto(np.array(spec.axis)),
        extent=lambda direction: float(radius * np.hypot(direction[0], direction[1]) + abs(direction[2]) * half),
        sameness=Sameness((1.0, 1.0, 2.0)),
        core=ends(radius, half),
        bends=0.99,
        rounded=lambda rim: np.array([radius, half, rim]),
        wall=2.0 / (2.0 / radius + 1.0 / half),
    )


SHAPE = Shape(geometry, inline=CYLINDER)
