"""How far a body reaches is told by its surface, also where nodes of the cells that it cuts are outside of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import solids

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Event, Frame
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

GROUND = {"ground": {"kind": "plane", "friction": 0.5}}
MATERIAL = {"kind": "neo_hookean", "young": 4e3, "poisson": 0.35, "density": 900.0, "retardation_time": 0.02}
both = pytest.mark.parametrize("model", ["fem", "pbd"])


def come_to_rest(file: bytes, body: dict[str, Any], **scene: Any) -> tuple[Frame, Frame, dict[str, float], set[str]]:
    """The body at the start and at the end, what is told of it then, and the kinds of events."""
    full = Scene.model_validate(
        {
            "softseam": 1,
            "name": "extent",
            "step": 0.02,
            "duration": 0.6,
            "body": {"shape": {"kind": "mesh", "path": "body.obj"}, "material": MATERIAL, **body},
            **scene,
        }
    )
    events: set[str] = set()

    def note(told: object) -> None:
        if isinstance(told, Event):
            events.add(told.kind)

    simulation = Simulation(Bundle(full.model_dump_json(), {"body.obj": file}), EmbeddedTransport(), emit=note)
    start = simulation.frame()
    while not (report := simulation.step(fields=True)).done:
        pass
    end = simulation.frame()
    simulation.close()
    return start, end, report.quantities, events


@both
def test_sag_is_what_the_surface_sinks_by(model: str) -> None:
    """By the cells' nodes it was negative: those outside the surface rise while the body sinks."""
    ball = solids.obj(*solids.sphere(0.02, 3))
    start, end, told, _ = come_to_rest(ball, {"cell": 0.009}, tools=GROUND, regions={"default": model})
    sunk = np.ptp(start.point_x[:, 2]) - np.ptp(end.point_x[:, 2])
    assert told["sag"] == pytest.approx(sunk, abs=1e-12)
    assert sunk > 1e-3


@both
def test_the_tip_of_a_beam_is_on_its_surface(model: str) -> None:
    beam = solids.obj(*solids.box((0.1, 0.02, 0.02), (-0.05, -0.01, 0.0)))
    body = {
        "material": {**MATERIAL, "young": 2e5},
        "fixed": [{"min": [-1, -1, -1], "max": [-0.049, 1, 1]}],
        "cell": 0.0082,
    }
    start, end, told, _ = come_to_rest(
        beam, body, regions={"default": model}, quantities=["tip_deflection"], duration=0.1
    )
    place = np.array([0.05, 0.0, 0.01])
    point = np.argmin(np.linalg.norm(start.point_x - place, axis=1))
    assert told["tip_deflection"] == pytest.approx(end.point_x[point, 2] - start.point_x[point, 2], rel=1e-9)
    assert told["tip_deflection"] < -1e-3


def test_a_ball_that_all_but_collapses_has_not_come_through_the_ground() -> None:
    """Its weight crushes it; cells' nodes outside of it swung far below, and it was told to be behind the ground."""
    ball = solids.obj(*solids.sphere(0.1, 3))
    soft = {**MATERIAL, "young": 1040.0, "poisson": 0.3, "retardation_time": 0.01}
    _, end, _, events = come_to_rest(
        ball,
        {"cell": 0.05, "position": [0, 0, 0.05], "material": soft},
        tools=GROUND,
        regions={"default": "fem"},
        step=0.01,
    )
    assert end.point_x[:, 2].min() > -0.01
    assert "gone" not in events
