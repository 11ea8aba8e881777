"""The surface of a body by its nodes, as bodies of a pile in like cells touch it."""

from dataclasses import dataclass, field

import numpy as np

from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.tools.kernels import DENSE


@dataclass(frozen=True)
class Faces:
    """A closed surface whose p points are nodes of a body, t triangles between them."""

    nodes: Ints
    """node of each point (p,)"""
    triangles: Ints
    """points, counter-clockwise from outside (t, 3)"""
    area: Floats
    """that each point stands for (p,) [m^2]"""
    spacing: float
    """of the points [m]"""
    yields: float
    """how far it sinks in under a pressure [m/Pa]"""
    places: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """of the points at rest (p, 3) [m]"""


def faces_of(body: Body) -> Faces | None:
    """None where the surface runs through cells, or these are tetrahedra."""
    if body.tetrahedra or not is_covered_by_faces(body):
        return None
    surface = body.surface
    places = np.rint(surface.local).astype(np.int64) + 1
    nodes = body.cell_nodes[surface.cell, places @ np.array([1, 3, 9])]
    spacing = 0.5 * body.resolution
    softest = min(material.young for material in body.materials)
    return Faces(nodes, surface.triangles, surface.area, spacing, spacing / (DENSE * softest), body.x_rest[nodes])
