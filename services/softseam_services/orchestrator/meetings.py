"""Bodies as interfaces meet them."""

from typing import cast

from softseam_coupling.interfaces import Meeting
from softseam_protocol.models import facts_of
from softseam_services.body.body import Body
from softseam_services.server import Setup


def meeting_of(setup: Setup) -> Meeting:
    """Of a body in cells; with its surface where these are no tetrahedra."""
    body, model = cast(Body, setup.body), setup.scene.regions.default
    assert model is not None  # a setup names one
    surface = None if body.tetrahedra else setup.touched
    return Meeting(body.x_rest, body.fixed, surface, facts_of(model).forces_at_end)
