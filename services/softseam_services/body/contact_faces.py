"""The surface of a body as other bodies touch it."""

import numpy as np

from softseam_coupling.interfaces import Faces
from softseam_services.body.body import Body
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.tools.kernels import DENSE


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
