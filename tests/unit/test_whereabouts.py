"""A body that is gone, or came through a plane or plate, is told of once; one that moves about as it may is not."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.bodies import build_any_body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.whereabouts import Whereabouts
from softseam_services.tools.build import build_tools

BLOCK = {
    "shape": {"kind": "block", "size": [0.04, 0.04, 0.04]},
    "cell": 0.02,
    "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
}
SHEET = {"kind": "sheet", "size": [0.1, 0.1], "divisions": [4, 4], "density": 0.2, "stretch": 100}
GROUND = {"ground": {"kind": "plane", "point": [0, 0, -0.01]}}
PLATE = {"plate": {"kind": "box", "size": [0.3, 0.2, 0.004], "position": [0, 0, -0.012]}}
WALL = {"wall": {"kind": "box", "size": [0.3, 0.2, 0.004], "position": [-0.2, 0, 0], "rotation": [0, 1.5708, 0]}}
FINGER = {"finger": {"kind": "box", "size": [0.01, 0.02, 0.02], "position": [-0.1, 0, 0.02]}}


def scene_of(body: dict[str, Any], tools: dict[str, Any], **others: Any) -> Scene:
    given = {"softseam": 1, "name": "somewhere", "duration": 1.0, "body": body, "tools": tools, **others}
    return parse_scene(json.dumps(given))


class Moved:
    """A body that is put here and there, without a solver."""

    def __init__(self, body: dict[str, Any], tools: dict[str, Any], **others: Any) -> None:
        scene = scene_of(body, tools, **others)
        self.body = build_any_body(scene, {})
        self.tools = build_tools(scene, self.body)
        self.told: list[str] = []
        self.watch = Whereabouts(self.body, self.tools, lambda kind, text, *details, count=0: self.told.append(text))
        self.watch.start()
        self.step = 0

    def to(self, *way: float, touching: bool = False, tool: NDArray[np.float64] | None = None) -> list[str]:
        """By this way from rest [m], and the first tool to this place; what is told since the last time."""
        moved = self.body.x_rest + np.array(way)
        reply = SimpleNamespace(
            bounds=np.array([moved.min(axis=0), moved.max(axis=0)]), figure=lambda _: float(touching)
        )
        position = self.tools.position.copy()
        if tool is not None:
            position[0] = tool
        self.told.clear()
        self.step += 10
        replies = cast("dict[str, Advanced]", {"body.far": reply})
        self.watch.look(self.step, replies, position, self.tools.orientation)
        return list(self.told)


@pytest.mark.parametrize(
    ("tools", "name", "depth"), [(GROUND, "ground", 0.05), (PLATE, "plate", 0.6), (PLATE, "plate", 0.06)]
)
def test_what_came_through_is_told_of_once(tools: dict[str, Any], name: str, depth: float) -> None:
    body = Moved(BLOCK, tools)
    assert body.to(0, 0, 0.3) == [] == body.to(0, 0, -0.005, touching=True)
    (told,) = body.to(0, 0, -depth)
    assert told.startswith(f"step 30: the body came through {name}, its middle is ")
    assert [body.to(0, 0, -depth - fall) for fall in (0.5, 3.0, 9.0)] == [[], [], []]


def test_it_may_come_through_before_the_first_look() -> None:
    assert "came through plate" in Moved(BLOCK, PLATE).to(0, 0, -2.0)[0]


def test_a_turned_plate_stops_sideways() -> None:
    body = Moved(BLOCK, WALL, gravity=[0, 0, 0])
    assert body.to(-0.17, 0, 0, touching=True) == []
    assert "came through wall" in body.to(-0.26, 0, 0)[0]


def test_a_plate_that_sweeps_through_the_body_is_told_of() -> None:
    body = Moved(BLOCK, PLATE, gravity=[0, 0, 0])
    assert body.to(0, 0, 0, tool=np.array([0, 0, -0.005])) == []
    assert "came through plate" in body.to(0, 0, 0, tool=np.array([0, 0, 0.06]))[0]


@pytest.mark.parametrize(
    ("body", "tools"),
    [(BLOCK, FINGER), (SHEET, PLATE), (SHEET, {"ball": {"kind": "sphere", "radius": 0.02, "position": [0, 0, -0.05]}})],
)
def test_what_hangs_over_a_tool_did_not_come_through(body: dict[str, Any], tools: dict[str, Any]) -> None:
    moved = Moved(body, tools)
    position = moved.tools.position[0]
    assert moved.to(*(position - [0, 0, 0.02]), touching=True) == []
    assert moved.to(*(position - [0, 0, 0.08]), touching=True) == []


def test_what_goes_around_a_plate_did_not_come_through() -> None:
    body = Moved(BLOCK, PLATE)
    assert [body.to(x, 0, z) for x, z in ((0.1, 0.0), (0.2, 0.0), (0.2, -0.1), (0.0, -0.1))] == [[]] * 4


@pytest.mark.parametrize(("direction", "gravity"), [((0, 0, -1), -9.81), ((1, 0, 0), 0.0), ((0.6, 0, -0.8), -9.81)])
def test_what_leaves_is_told_of_once(direction: tuple[float, float, float], gravity: float) -> None:
    """Once it is farther from all else than ten times its extent."""
    body, way = Moved(BLOCK, FINGER, gravity=[0, 0, gravity]), np.array(direction)
    told = [body.to(*(far * way)) for far in (0.1, 0.3, 0.9, 1.5, 4.0)]
    assert [len(each) for each in told] == [0, 0, 1, 0, 0] and "away from the tools" in told[2][0]


@pytest.mark.parametrize(
    ("tools", "ways", "touching"),
    [
        (FINGER, [(0, 0, 0.5), (0, 0, 0.9), (0, 0, 1.2)], False),
        (GROUND, [(0.5, 0, 1.0), (1.0, 0, 0.9), (1.5, 0, 0.5)], False),
        (GROUND, [(0.5, 0, 0), (1.0, 0, 0), (1.5, 0, 0)], True),
        ({}, [(0, 0, -1.0), (0, 0, -3.0), (0, 0, -9.0)], False),
    ],
    ids=["thrown up", "thrown over the ground", "slides", "nothing else there"],
)
def test_what_may_come_back_is_not_gone(tools: dict[str, Any], ways: list[tuple[float, ...]], touching: bool) -> None:
    body = Moved(BLOCK, tools)
    assert [body.to(*way, touching=touching) for way in ways] == [[], [], []]


def test_a_tool_that_carries_it_away_is_with_it() -> None:
    body = Moved(BLOCK, FINGER)
    for far in (0.5, 1.0, 2.0):
        assert body.to(far, 0, 0.2, tool=np.array([far - 0.05, 0, 0.2])) == []


@pytest.mark.parametrize(("speed", "told"), [(0.0, 0), (1.5, 1), (3.0, 1)])
def test_a_block_that_slides_off_a_table_is_gone(speed: float, told: int) -> None:
    """Falling since the edge of the table, for the rest of a second; the other one stays on it."""
    table = {"table": {"kind": "box", "size": [0.2, 0.2, 0.02], "position": [0, 0, -0.01]}}
    scene = scene_of({**BLOCK, "velocity": [speed, 0, 0]}, table, regions={"default": "fem"})
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    while not simulation.done:
        simulation.step()
    found = [event.message for event in simulation.events if event.kind is EventKind.GONE]
    assert len(found) == told and all("away from the tools" in text for text in found)
    simulation.close()
