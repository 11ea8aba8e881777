"""A half-space, by its unit normal."""

import numpy as np

from softseam_protocol.scene.tools import PlaneTool
from softseam_services.shapes.branches import PLANE
from softseam_services.shapes.geometry import Geometry, Sameness
from softseam_services.shapes.shape import Files, Shape


def geometry(spec: PlaneTool, files: Files) -> Geometry:
    """Numbers are the unit normal (3,) [1]."""
    normal = np.array(spec.normal) / np.linalg.norm(np.array(spec.normal))
    x, y, z = normal.tolist()
    return Geometry(normal, np.zeros((0, 3)), np.inf, sameness=Sameness((1.0, 1.0, 1.0), (x, y, z)))


SHAPE = Shape(geometry, inline=PLANE)
