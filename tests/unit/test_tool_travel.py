"""Tools that move half their thickness in a step are told of: the body may come out behind them."""

from __future__ import annotations

import numpy as np
import pytest

import softseam
from softseam_protocol.messages.session import Event
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.tools.build import build_tools
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.travel import beyond_middle, parts_needed

pytestmark = pytest.mark.kernels

BODY = {
    "shape": {"kind": "block", "size": [0.02, 0.02, 0.02]},
    "cell": 0.02,
    "material": {"young": 2e4, "poisson": 0.45, "density": 1000},
}
TOOLS = {
    "ball": {"kind": "sphere", "radius": 0.005, "position": [0, 0.1, 0.05]},
    "ground": {"kind": "plane"},
    "plate": {"kind": "box", "size": [0.01, 0.06, 0.06], "position": [-0.016, 0, 0.01]},
    "turned": {"kind": "box", "size": [0.01, 0.06, 0.06], "position": [0.1, 0, 0.1], "rotation": [0, 0, np.pi / 2]},
}


def scene(speed: float) -> Scene:
    motion = [{"tools": ["plate"], "move": [speed * 0.02, 0, 0], "speed": speed}]
    keys = {"softseam": 1, "name": "t", "step": 0.01, "body": BODY, "tools": TOOLS, "regions": {"default": "fem"}}
    return Scene.model_validate(keys | {"motion": motion})


@pytest.mark.parametrize(
    ("way", "far"),
    [
        ([0.0049, 0, 0], []),
        ([0.0051, 0, 0], ["ball", "plate"]),  # across the plate's thickness; the turned one is long there
        ([0, 0.0051, 0], ["ball", "turned"]),
        ([0, 0, 0.0049], []),
        ([0, 0, 0.031], ["ball", "plate", "turned"]),
    ],
)
def test_half_a_thickness_counts_along_each_edge(way: list[float], far: list[str]) -> None:
    built = scene(0.1)
    tools = build_tools(built, build_body(built, {}), {})
    command = np.tile([*way, 0.0, 0.0, 0.0], (4, 1)) / built.step
    motion = tool_motion(tools.position, tools.orientation, command, built.step)
    assert beyond_middle(tools, motion) == far


def _turning(speed: float, turned: str) -> list[str]:
    """Tools that are told of where one of a blade, a rod, a cube and a ball turns about y by this in a step [rad]."""
    tools = {
        "ball": {"kind": "sphere", "radius": 0.005, "position": [0, 0.1, 0.05]},
        "blade": {"kind": "box", "size": [0.01, 0.02, 0.06], "position": [0.1, 0, 0.1]},
        "cube": {"kind": "box", "size": [0.01, 0.01, 0.01], "position": [0.2, 0, 0.1]},
        "rod": {"kind": "capsule", "radius": 0.005, "length": 0.06, "position": [0.3, 0, 0.1]},
    }
    built = Scene.model_validate(scene(0.1).model_dump() | {"tools": tools, "motion": [{"hold": 0.1}]})
    set_ = build_tools(built, build_body(built, {}), {})
    command = np.zeros((4, 6))
    command[set_.names.index(turned), 4] = speed / built.step
    return beyond_middle(set_, tool_motion(set_.position, set_.orientation, command, built.step))


@pytest.mark.parametrize(("turned", "least"), [("blade", np.arctan(1 / 6)), ("rod", np.arcsin(1 / 12) * 2)])
def test_what_turns_counts_by_its_ends(turned: str, least: float) -> None:
    """A blade's face is at its end where the middle was once it has turned by its thickness over its length."""
    assert _turning(0.99 * least, turned) == []
    assert _turning(-1.01 * least, turned) == [turned]


@pytest.mark.parametrize("turned", ["cube", "ball"])
def test_what_is_as_thick_as_it_is_long_may_turn(turned: str) -> None:
    assert _turning(0.45, turned) == []


@pytest.mark.parametrize(
    ("way", "before", "flies", "parts"),
    [
        ([0.0, 0.0024, 0.0], 0.0, 0.0, 1),  # less than half of its radius
        ([0.0, 0.0026, 0.0], 0.0, 0.0, 2),
        ([0.0, -0.0051, 0.0], 0.0, 0.0, 4),
        ([0.0, 0.0, 0.0], 0.0, 0.0, 1),
        ([0.0, 0.019, 0.0], 0.0, 0.0, 8),
        ([0.0, 1.0, 0.0], 0.0, 0.0, 32),
        ([0.0, 0.02, 0.0], 0.3, 0.0, 1),  # comes near nothing
        ([0.0, 0.02, 0.0], 0.0, 0.019, 1),  # goes with what it touches
        ([0.0, 0.005, 0.0], 0.0, -0.0048, 4),
    ],
)
def test_parts_let_a_ball_come_on_by_half_its_radius(way: list[float], before: float, flies: float, parts: int) -> None:
    """Of 5 mm, beside a body of two nodes that fly by that much."""
    built = scene(0.1)
    tools = build_tools(built, build_body(built, {}), {})
    command = np.zeros((4, 6))
    command[tools.names.index("ball"), :3] = np.array(way) / built.step
    motion = tool_motion(tools.position, tools.orientation, command, built.step)
    x = np.array([[0.0, 0.1, 0.05], [0.0, 0.102, 0.05]]) + np.array([before, 0.0, 0.0])
    v = np.tile([0.0, flies, 0.0], (2, 1)) / built.step
    assert parts_needed(tools, motion, x, v, built.step) == parts


def test_boxes_and_planes_need_no_parts() -> None:
    """A point meets the side of a box that it faced when the step began."""
    built = scene(0.1)
    tools = build_tools(built, build_body(built, {}), {})
    command = np.zeros((4, 6))
    command[tools.names.index("plate"), 0] = command[tools.names.index("ground"), 2] = 5.0
    motion = tool_motion(tools.position, tools.orientation, command, built.step)
    assert parts_needed(tools, motion, np.array([[0.0, 0.0, 0.01]]), np.zeros((1, 3)), built.step) == 1


def test_a_rod_that_turns_needs_parts() -> None:
    tools = {"rod": {"kind": "capsule", "radius": 0.005, "length": 0.06, "position": [0.3, 0, 0.1]}}
    built = Scene.model_validate(scene(0.1).model_dump() | {"tools": tools, "motion": [{"hold": 0.1}]})
    set_ = build_tools(built, build_body(built, {}), {})
    motion = tool_motion(set_.position, set_.orientation, np.array([[0, 0, 0, 0, 40.0, 0]]), built.step)
    assert parts_needed(set_, motion, np.array([[0.3, 0.0, 0.1]]), np.zeros((1, 3)), built.step) == 8


def test_a_plate_that_jumps_is_an_event_told_once() -> None:
    for speed, n_told in ((0.1, 0), (0.6, 1)):
        events: list[Event] = []
        with softseam.open(scene(speed)) as session:
            session.reset()
            while not session.done:
                events += session.step().events
        told = [event.message for event in events if event.kind == "tools"]
        assert len(told) == n_told
        assert all("plate moves half its thickness" in message for message in told)
