"""A participant serves many sessions; those whose orchestrators died make room, those in use stay."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Bundle,
    Configure,
    Configured,
    Failure,
    Fields,
    Observe,
    ToolMotion,
)
from softseam_protocol.participant.requests import SLOTS_KEPT
from softseam_protocol.scene.scene import Scene
from softseam_services.server import ParticipantServer

pytestmark = pytest.mark.kernels

SCENE = Scene.model_validate(
    {
        "softseam": 1,
        "name": "seats",
        "duration": 0.01,
        "body": {
            "shape": {"kind": "block", "size": [0.01] * 3},
            "cell": 0.01,
            "material": {"young": 2e4, "poisson": 0.4, "density": 1050.0},
        },
        "regions": {"default": "pbd"},
    }
)


def test_the_seat_used_longest_ago_makes_room() -> None:
    server = ParticipantServer()
    bundle, cells, none = Bundle(SCENE.model_dump_json(), {}), np.zeros(1, np.int32), np.zeros(0, np.int32)

    def header(session: int) -> Header:
        return Header(SCHEMA_VERSION, f"s{session}", "near", 0, 0, 0, 0.0)

    for session in range(SLOTS_KEPT):
        reply = server.handle(Configure(header(session), bundle, "pbd", cells, none, None, True))
        assert isinstance(reply, Configured)
    assert isinstance(server.handle(Observe(header(0))), Fields)
    assert isinstance(server.handle(Configure(header(-1), bundle, "pbd", cells, none, None, True)), Configured)
    assert isinstance(server.handle(Observe(header(0))), Fields)
    refused = server.handle(Observe(header(1)))
    assert isinstance(refused, Failure) and refused.kind == "not_configured"


def test_a_configure_that_comes_again_begins_anew_also_within_the_first_step() -> None:
    """Who is brought back configures again and repeats what followed, though the participant was never gone."""
    server = ParticipantServer()
    bundle, cells, none = Bundle(SCENE.model_dump_json(), {}), np.zeros(1, np.int32), np.zeros(0, np.int32)
    nothing = np.zeros((0, 3))
    motion = ToolMotion(nothing, np.zeros((0, 4)), nothing, np.zeros((0, 4)))

    def header(exchange: int) -> Header:
        return Header(SCHEMA_VERSION, "s", "far", 0, 0, exchange, 0.0)

    configure = Configure(header(0), bundle, "pbd", cells, none, None, True)
    first = server.handle(configure)
    assert server.handle(configure) is first
    for _ in range(2):
        asked = [server.handle(Advance(header(exchange), 0.01, nothing, motion)) for exchange in range(3)]
        assert all(isinstance(reply, Advanced) for reply in asked), asked
        assert isinstance(server.handle(configure), Configured)
