"""Bodies as interfaces meet them."""

from typing import cast

import numpy as np

from softseam_coupling.interfaces import Faces, Meeting
from softseam_protocol.models import facts_of
from softseam_services.body.body import Body
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.server import Setup
from softseam_services.tools.kernels import DENSE


def meeting_of(setup: Setup) -> Meeting:
    """Of a body in cells; with its surface where that is nodes."""
    body, model = cast(Body, setup.body), setup.scene.regions.default
    assert model is not None  # a setup names one
    return Meeting(body.x_rest, body.fixed, _faces_of(body), facts_of(model).forces_at_end)


def _faces_of(body: Body) -> Faces | None:
    """None where the surface runs through cells, or these are tetrahedra."""
    if body.tetrahedra or not is_covered_by_faces(body):
        return None
    surface = body.surface
    places = np.rint(surface.local).astype(np.int64) + 1
    nodes = body.cell_nodes[surface.cell, places @ np.array([1, 3, 9])]
    spacing = 0.5 * body.resolution
    softest = min(material.young for material in body.materials)
    return Faces(nodes, surface.triangles, surface.area, spacing, spacing / (DENSE * softest))
