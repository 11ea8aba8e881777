"""Bodies as interfaces meet them."""

from typing import cast

from softseam_coupling.interfaces import Meeting
from softseam_protocol.models import facts_of
from softseam_services.body.body import Body
from softseam_services.body.contact_faces import faces_of
from softseam_services.server import Setup


def meeting_of(setup: Setup) -> Meeting:
    """Of a body in cells; with its surface where that is nodes."""
    body, model = cast(Body, setup.body), setup.scene.regions.default
    assert model is not None  # a setup names one
    return Meeting(body.x_rest, body.fixed, faces_of(body), facts_of(model).forces_at_end)
