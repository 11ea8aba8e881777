"""A body that creeps along tools that stand still is told of once; one that holds, slides off, rolls or sags is not."""

from __future__ import annotations

import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from softseam_protocol.messages.participant import Advanced
from softseam_protocol.scene.file import parse_scene
from softseam_services.bodies import build_any_body
from softseam_services.body.body import Floats
from softseam_services.orchestrator.creep import Creep
from softseam_services.tools.build import build_tools

LOOK = 0.1
"""[s]"""
SIZE, DENSITY = 0.06, 900.0
MASS = DENSITY * SIZE**3


def told(
    at: Callable[[float], float],
    *,
    friction: float = 0.4,
    gravity: float = 9.81,
    spin: float = 0.0,
    touches: bool = True,
    sags: float = 0.0,
    tool_speed: float = 0.0,
    fixed: bool = False,
    look: float = LOOK,
    end: float = 3.0,
) -> list[str]:
    """What is told of a block that is `at` this place along x at each time.

    spin  over mass, speed and half its extent [1]
    sags  share of its way that its far side goes, its near side stands
    """
    given: dict[str, Any] = {
        "softseam": 1,
        "name": "block",
        "duration": 1.0,
        "gravity": [0, 0, -gravity],
        "body": {
            "shape": {"kind": "block", "size": [SIZE, SIZE, SIZE]},
            "material": {"young": 2e5, "poisson": 0.3, "density": DENSITY},
            "fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0.001]}] if fixed else [],
        },
        "tools": {"ground": {"kind": "plane", "friction": friction}},
    }
    scene = parse_scene(json.dumps(given))
    body = build_any_body(scene, {})
    tools = build_tools(scene, body)
    found: list[str] = []
    watch = Creep(body, tools, look, lambda kind, text, *details, count=0: found.append(text))
    position: Floats = tools.position.copy()
    for number in range(1, round(end / look) + 1):
        time = number * look
        speed = (at(time) - at(time - 1e-6)) / 1e-6
        way, middle = np.array([at(time), 0.0, 0.0]), body.x_rest.mean(axis=0)
        bounds = np.array([body.x_rest.min(axis=0) + (0.0 if sags else way), body.x_rest.max(axis=0) + way])
        momentum = np.array([MASS * speed, 0.0, 0.0])
        turning = np.array([0.0, spin * MASS * abs(speed) * 0.5 * SIZE, 0.0])
        reply = SimpleNamespace(
            bounds=bounds,
            momentum=momentum,
            angular_momentum=np.cross(middle + way, momentum) + turning,
            figure=lambda _: float(touches),
        )
        position = position + np.array([tool_speed * look, 0.0, 0.0])
        watch.look(number, cast("dict[str, Advanced]", {"body.near": reply}), position, tools.orientation)
    return found


@pytest.mark.parametrize(("speed", "look"), [(0.026, 0.1), (0.004, 0.1), (-0.11, 0.1), (0.05, 0.005), (0.02, 0.25)])
def test_one_that_creeps_is_told_of_once(speed: float, look: float) -> None:
    (text,) = told(lambda time: speed * time, look=look)
    assert f"creeps at {1e3 * abs(speed):.3g} mm/s along tools that stand still" in text and "regions.default" in text


def test_it_may_stick_a_little() -> None:
    assert told(lambda time: 0.02 * time + 2e-4 * np.sin(7.0 * time))


@pytest.mark.parametrize("decay", [0.05, 0.2, 0.4])
def test_one_that_comes_to_rest_holds(decay: float) -> None:
    assert told(lambda time: 0.01 * (1.0 - np.exp(-time / decay))) == []


@pytest.mark.parametrize("speed", [0.3, 0.8, 2.0])
def test_one_that_friction_slows_slides(speed: float) -> None:
    """By mu g, until it stands."""
    stop = speed / (0.1 * 9.81)
    assert told(lambda time: speed * min(time, stop) - 0.5 * 0.981 * min(time, stop) ** 2, friction=0.1) == []


@pytest.mark.parametrize("acceleration", [0.2, 0.59, 3.0])
def test_one_that_slides_down_goes_faster(acceleration: float) -> None:
    assert told(lambda time: 0.5 * acceleration * time**2, end=1.5) == []


@pytest.mark.parametrize(
    "others",
    [
        {"friction": 0.0},
        {"gravity": 0.0},
        {"spin": 0.4},
        {"spin": 0.5},
        {"touches": False},
        {"sags": 1.0},
        {"tool_speed": 0.02},
        {"fixed": True},
    ],
    ids=lambda others: next(iter(others)),
)
def test_steady_motion_that_friction_allows_is_none(others: dict[str, Any]) -> None:
    """Without friction or weight, rolling, in the air, its far side alone, on a belt that moves, clamped."""
    assert told(lambda time: 0.02 * time, **others) == []


def test_one_that_flies_past_is_none() -> None:
    assert told(lambda time: 3.0 * time) == []
