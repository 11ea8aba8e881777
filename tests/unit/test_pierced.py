"""A tool inside the body that nothing touches is told of once; one beside it, or in a hole of it, is not."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_services.bodies import build_any_body
from softseam_services.body.interpolate import rest_points
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.pierced import Pierced
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.tools.build import build_tools

pytestmark = pytest.mark.kernels

BLOCK = {
    "shape": {"kind": "block", "size": [0.04, 0.04, 0.04]},
    "cell": 0.02,
    "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
}
TOOLS: dict[str, dict[str, Any]] = {
    "box": {"kind": "box", "size": [0.004, 0.1, 0.004]},
    "sphere": {"kind": "sphere", "radius": 0.004},
    "capsule": {"kind": "capsule", "radius": 0.002, "length": 0.1, "axis": [0, 1, 0]},
    "cylinder": {"kind": "cylinder", "radius": 0.002, "length": 0.1, "axis": [0, 1, 0]},
}


def scene(tool: dict[str, Any], body: dict[str, Any] = BLOCK, **others: Any) -> Any:
    given = {"softseam": 1, "name": "pierced", "duration": 1.0, "body": body, "tools": {"tool": tool}, **others}
    return parse_scene(json.dumps(given))


class Put:
    """A tool that is put here and there beside a body at rest."""

    def __init__(self, tool: dict[str, Any]) -> None:
        parsed = scene({**tool, "position": [0, 0, 0.3]})
        body = build_any_body(parsed, parsed.body, {})
        self.tools, self.points = build_tools(parsed, body), rest_points(body)  # type: ignore[arg-type]
        self.bounds = np.array([self.points.min(axis=0), self.points.max(axis=0)])
        self.told: list[str] = []
        self.looks = 0
        self.watch = Pierced(body, self.tools, lambda kind, text, *details, count=0: self.told.append(text))

    def at(self, *place: float, force: float = 0.0) -> list[str]:
        """What is told of the tool at this place [m], with this force on it [N]."""
        self.told.clear()
        wrench = np.zeros((1, 6))
        wrench[0, 2] = force
        self.watch.look(9, self.bounds, wrench, np.array([place]), self.tools.orientation, self._see)
        return list(self.told)

    def _see(self) -> Any:
        self.looks += 1
        return self.points


@pytest.mark.parametrize("kind", TOOLS)
def test_a_tool_inside_is_told_of_once(kind: str) -> None:
    """Also where its middle is outside: a rod whose end is in the body."""
    put = Put(TOOLS[kind])
    assert put.at(0, 0, 0.3) == [] and put.at(0, 0, 0.043) == [] and put.looks == 0
    assert put.at(0, 0, 0.02, force=1.0) == [] and put.looks == 0
    (told,) = put.at(0, 0, 0.02)
    assert told.startswith("step 9: tool is inside the body and nothing touches it") and "body.cell" in told
    assert put.at(0, 0, 0.02) == [] and put.looks == 1
    if kind != "sphere":
        assert len(Put(TOOLS[kind]).at(0, 0.04, 0.02)) == 1


def test_a_tool_in_a_hole_costs_less_and_less() -> None:
    put = Put(TOOLS["sphere"])
    put.points = put.points + np.array([0.0, 0.0, 1.0])  # so that what is within the bounds is outside
    for _ in range(100):
        assert put.at(0, 0, 0.02) == []
    assert put.looks == 6


@pytest.mark.parametrize("model", ["fem", "pbd"])
@pytest.mark.parametrize("radius", [0.001, 0.012])
def test_a_thin_rod_cuts_in_and_a_thick_one_does_not(model: str, radius: float) -> None:
    """Pressed by 2 cm into a block whose points are 7 mm apart, and left there."""
    rod = {
        "kind": "capsule",
        "radius": radius,
        "length": 0.1,
        "axis": [0, 1, 0],
        "position": [0.004, 0, 0.042 + radius],
    }
    body = {**BLOCK, "fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0]}]}
    motion = [{"tools": ["tool"], "move": [0, 0, -0.02], "speed": 0.3}, {"hold": 0.15}]
    parsed = scene(rod, body, motion=motion, duration=None, regions={"default": model}, step=0.01)
    simulation = Simulation(bundle_scene(parsed), EmbeddedTransport())
    while not simulation.done:
        simulation.step()
    simulation.close()
    found = [event for event in simulation.events if Detail.PIERCED in event.details]
    assert len(found) == (radius < 0.002)
