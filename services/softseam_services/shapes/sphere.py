"""A sphere, by its radius."""

import numpy as np

from softseam_protocol.scene.parts import SpherePart
from softseam_protocol.scene.tools import SphereTool
from softseam_services.shapes.branches import SPHERE
from softseam_services.shapes.geometry import Geometry, Sameness
from softseam_services.shapes.shape import Files, Shape


def geometry(spec: SphereTool | SpherePart, files: Files) -> Geometry:
    """Numbers are (radius, 0, 0) [m]."""
    r = spec.radius
    axes = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.float64)
    return Geometry(
        numbers=np.array([r, 0.0, 0.0]),
        outline=r * axes[np.abs(axes).sum(axis=1) <= 1.0],
        reach=r,
        extent=lambda direction: r,
        sameness=Sameness((1.0, 1.0, 1.0)),
        core=np.array([[0.0, 0.0, 0.0, r]]),
    )


SHAPE = Shape(geometry, inline=SPHERE)
