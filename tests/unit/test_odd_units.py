"""What is likely in another unit than meant, or along another axis, is warned of, and no others."""

from __future__ import annotations

from typing import Any

import pytest

from softseam.checks import doubts
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.motion import TurnPhase
from softseam_protocol.scene.scene import Scene


def told_of(one: Scene, size: float) -> list[str]:
    """Of a scene whose body has this extent [m]."""
    return doubts(one, {"body": (size, ())})


def scene(**changes: Any) -> Scene:
    given: dict[str, Any] = {
        "softseam": 1,
        "name": "cube",
        "duration": 1.0,
        "body": {
            "shape": {"kind": "block", "size": [0.05, 0.05, 0.05]},
            "material": {"young": 2e4, "poisson": 0.45, "density": 1000},
        },
    }
    for key, value in changes.items():
        given[key] = {**given[key], **value} if key == "body" else value
    return Scene.model_validate(given)


@pytest.mark.parametrize(
    ("gravity", "words"),
    [
        ([0, 0, -810], "gravity: 810 m/s^2 is 82.6 times the earth's; is it in m/s^2, not in mm/s^2?"),
        ([0, -162, 0], "gravity: 162 m/s^2 is 16.5 times the earth's"),
        ([0, 0, -9.81], ""),
        ([0, 0, -24.8], ""),
        ([0, 0, 0], ""),
    ],
)
def test_gravity_in_millimetres(gravity: list[float], words: str) -> None:
    """Not Jupiter's."""
    told = told_of(scene(gravity=gravity), 0.05)
    assert [text.startswith(words) for text in told] == [True] if words else not told


@pytest.mark.parametrize("gravity", [[0, 0, -9810], [3355.2, 0, -9218.4], [0, 0, -1620]])
def test_gravity_that_nothing_soft_stands_is_refused(gravity: list[float]) -> None:
    """The earth's, the moon's in millimetres: a run of it sank by twenty times the body, for minutes."""
    with pytest.raises(ValueError, match=r"times the earth's: it is in m/s\^2, not in mm/s\^2"):
        scene(gravity=gravity)


@pytest.mark.parametrize(("speed", "told"), [(500.0, True), (2000.0, True), (120.0, True), (20.0, False), (0.0, False)])
def test_speeds_in_millimetres(speed: float, told: bool) -> None:
    found = told_of(scene(body={"velocity": [0.0, 0.6 * speed, -0.8 * speed]}), 0.05)
    assert bool(found) == told and all("in m/s, not in mm/s?" in text for text in found)


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        (
            {"kind": "box", "size": [10, 60, 60], "position": [-0.05, 0, 0.03]},
            "tools.finger: 60 m from end to end, 1.2e+03",
        ),
        ({"kind": "sphere", "radius": 8, "position": [0, 0, 9]}, "tools.finger: 16 m from end to end, 320 times"),
        ({"kind": "capsule", "radius": 5, "length": 40, "position": [0, 0, 9]}, "tools.finger: 50 m from end to end"),
        ({"kind": "box", "size": [0.01, 0.06, 0.06], "position": [-43, 0, 29]}, "tools.finger.position: 51.87 m from"),
        ({"kind": "box", "size": [2, 2, 0.04], "position": [0, 0, -0.02]}, ""),
        ({"kind": "box", "size": [0.01, 0.06, 0.06], "position": [-0.043, 0, 2.0]}, ""),
        ({"kind": "plane", "point": [0, 0, -100]}, ""),
    ],
)
def test_tools_in_millimetres(tool: dict[str, Any], words: str) -> None:
    """A table of two metres and a plane far below are none."""
    told = told_of(scene(tools={"finger": tool}), 0.05)
    assert [text.startswith(words) for text in told] == [True] if words else not told


def test_a_large_body_has_large_tools() -> None:
    tool = {"kind": "box", "size": [8, 8, 0.1], "position": [0, 0, -0.05]}
    assert told_of(scene(tools={"belt": tool}), 0.05) and not told_of(scene(tools={"belt": tool}), 0.2)


@pytest.mark.parametrize(("friction", "told"), [(50.0, True), (6.0, True), (4.0, False), (0.0, False)])
def test_friction_in_percent(friction: float, told: bool) -> None:
    tool = {"kind": "box", "size": [0.01, 0.06, 0.06], "position": [-0.043, 0, 0.03], "friction": friction}
    found = told_of(scene(tools={"finger": tool, "floor": {"kind": "plane", "friction": friction}}), 0.05)
    words = f"friction: {friction:g} is more than any materials have"
    assert [text.split(".")[1] for text in found if words in text] == (["finger", "floor"] if told else [])


FINGER = {"kind": "box", "size": [0.01, 0.06, 0.06], "position": [-0.043, 0, 0.03]}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"gravity": [0, 0, 9.81]}, True),
        ({"gravity": [0, -9.81, 0]}, True),
        ({"gravity": [9.81, 0, -0.1]}, True),
        ({"gravity": [0, -9.81, 0], "tools": {"floor": {"kind": "plane", "normal": [0, 2, 0]}}}, False),
        ({"gravity": [6.9, 0, -6.9]}, False),
        ({"gravity": [0, -9.81, 0], "tools": {}}, False),
        ({"gravity": [0, -9.81, 0], "tools": {"wall": {"kind": "plane"}, "shelf": FINGER}}, False),
        ({"gravity": [0, 0, 9.81], "body": {"fixed": [{"min": [-1, -1, -1], "max": [1, 1, 1e-3]}]}}, False),
        ({"gravity": [0, 0, 9.81], "body": {"velocity": [0, 0, -2]}}, False),
    ],
)
def test_gravity_that_no_plane_stands_against(changes: dict[str, Any], told: bool) -> None:
    """Up, and along y as where y points up; a slope holds, and so may a shelf, a clamp, or a throw from above."""
    found = told_of(scene(**{"tools": {"ground": {"kind": "plane"}}, **changes}), 0.05)
    assert [text.startswith("gravity: it pulls the body along every plane") for text in found] == [True] * told


@pytest.mark.parametrize(("turn", "told"), [([0, 0, 45], True), ([0, -90, 0], True), ([3, 3, 3], False)])
def test_turns_in_degrees(turn: list[float], told: bool) -> None:
    """Of tools as they begin, by the length of axis times angle."""
    found = told_of(scene(tools={"finger": {**FINGER, "rotation": turn}}), 0.05)
    assert bool(found) == told and all(text.startswith("tools.finger.rotation: ") for text in found)


@pytest.mark.parametrize(("mass", "told"), [(100.0, True), (350.0, True), (5.0, False)])
def test_masses_in_grams(mass: float, told: bool) -> None:
    found = told_of(scene(tools={"finger": {**FINGER, "mass": mass}}), 0.05)
    assert [text.startswith(f"tools.finger.mass: {mass:g} kg") for text in found] == [True] * told


def gripped(**changes: Any) -> Scene:
    """Closed on with a force for half a second."""
    right = {**FINGER, "position": [0.043, 0, 0.03]}
    phase = {"tools": ["left", "right"], "close": 0.02, "until": {"force": changes.pop("force", 2.0), "time": 0.5}}
    return scene(tools={"left": FINGER, "right": right}, motion=[phase], **changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration": 200.0}, "duration: 200 s, but the motion is over after 0.5 s; is it in s, not in ms?"),
        ({"duration": 90.0, "step": 5e-4}, "step: 0.0005 s are 180,000 steps in 90 s"),
        ({"duration": 0.5, "step": 1e-6}, "step: 1e-06 s are 500,000 steps in 0.5 s"),
        ({"duration": 20.0}, ""),
        ({"duration": 0.5, "step": 1e-4}, ""),
        ({"force": 2000.0}, "motion.0.until.force: 2000 N squeezes a body of 0.05 m flat"),
        ({"force": 500.0}, "motion.0.until.force: 500 N squeezes a body of 0.05 m flat"),
        ({"force": 60.0}, ""),
    ],
)
def test_times_in_milliseconds_and_forces_in_millinewtons(changes: dict[str, Any], words: str) -> None:
    """A block of 5 cm and 20 kPa is squeezed to half by some 50 N on a whole side."""
    told = told_of(gripped(**changes), 0.05)
    assert [text.startswith(words) for text in told] == [True] if words else not told


@pytest.mark.parametrize(
    ("kind", "spin", "turn", "told"),
    [
        ("linear", 9.0, 0.0, "body.material.kind: linear knows no turns: a body that turns by 4.5 rad"),
        ("linear", 0.0, 1.0, "body.material.kind: linear knows no turns: a body that turns by 1 rad"),
        ("linear", 0.1, 0.2, ""),
        ("neo_hookean", 9.0, 1.0, ""),
    ],
)
def test_turns_of_a_law_that_knows_none(kind: str, spin: float, turn: float, told: str) -> None:
    """A free plate of it that spins lags by 1.6 of 9.5 rad within a second."""
    held = gripped(duration=0.5)
    assert isinstance(held.body, BodySpec)
    material = held.body.material.model_copy(update={"kind": kind})
    of = held.with_body(held.body.model_copy(update={"material": material, "spin": (0.0, 0.0, spin)}))
    phases = (
        [*held.motion, TurnPhase(tools=("left", "right"), turn=(0.0, 0.0, turn), speed=1.0)] if turn else held.motion
    )
    found = told_of(of.model_copy(update={"motion": tuple(phases)}), 0.05)
    assert [text.startswith(told) for text in found] == [True] if told else not found
