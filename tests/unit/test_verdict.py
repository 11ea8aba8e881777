"""What a run is called: by what the tools that lift and the body did, whatever single fingers did beside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from squeeze import SCENE, Squeeze

from softseam.columns import Columns
from softseam.recording import Recording
from softseam.verdict import Verdict, judge, lifters, tool_rise, with_failures
from softseam.view import charts
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene

FINGERS = ["left", "right"]
CLOSE = {"tools": FINGERS, "close": 0.02, "until": {"compression": 0.15}}
UP, DOWN = ({"tools": FINGERS, "move": [0, 0, z], "speed": 0.05} for z in (0.05, -0.05))


def scene(*motion: dict[str, Any]) -> Scene:
    return Scene.model_validate({**SCENE, "motion": list(motion)})


def columns(
    left: Sequence[float],
    right: Sequence[float],
    body: Sequence[float] | None,
    force: Sequence[float],
    leans: float = 0.0,
) -> Columns:
    """Of a run in steps of 0.1 s: heights of two fingers and of the body [m], and the force of each finger [N], the
    left one's at least what leans on it."""
    found = Columns(0.1, ("ground", "left", "right", "ball"))
    like = next(message for message in Squeeze(1).messages() if isinstance(message, StepReport))
    for k, (a, b, f) in enumerate(zip(left, right, force, strict=True)):
        position, wrench = np.zeros((4, 3)), np.zeros((4, 6))
        position[1:3, 2], wrench[1:3, 0] = (a, b), (-max(f, leans), f)
        header = replace(like.header, step=k, time=0.1 * k)
        quantities = {"slip": 1e-4} | ({} if body is None else {"lift_height": body[k]})
        found.add(replace(like, header=header, tool_position=position, wrench=wrench, quantities=quantities))
    return found


def verdict(motion: Scene, z: Sequence[float], body: Sequence[float] | None, force: Sequence[float]) -> Verdict:
    return judge(motion, columns(z, z, body, force), True)


PLACED = scene(CLOSE, UP, DOWN, {"tools": ["left"], "move": [-0.02, 0, 0], "speed": 0.05}, UP, UP)
AWAY = [0.0, 0.025, 0.05, 0.025, 0.0, 0.0, 0.05, 0.1]
"""heights of fingers that lift by 50 mm, lower by as much, part, and go up by 100 mm without the body [m]"""
HELD = [5.0, 5.0, 5.0, 5.0, 5.0, 0.0, 0.0, 0.0]


@pytest.mark.kernels
def test_a_turn_of_the_fingers_is_no_rise() -> None:
    """One goes up by 16 mm and the other down by as much, about their middle, after a lift of 50 mm: no slip."""
    turned = scene(CLOSE, UP, {"tools": FINGERS, "turn": [0, 0.5, 0], "speed": 0.5})
    run = columns([0.0, 0.05, 0.066], [0.0, 0.05, 0.034], [0.0, 0.05, 0.05], [5.0, 5.0, 5.0])
    found = judge(turned, run, True)
    assert found == Verdict("lifted", "lifted: the tools rose by 50.0 mm, the body by 50.0 mm")


@pytest.mark.parametrize(
    ("motion", "names"),
    [
        ([CLOSE, UP], ("left", "right")),
        ([{"tools": ["ball"], "move": [0, 0.01, 0], "speed": 0.1}, CLOSE, UP], ("left", "right")),
        ([CLOSE, UP, {"tools": ["ball"], "move": [0, 0, 0.1], "speed": 0.1}], ("left", "right")),
        ([CLOSE, {"tools": ["ball"], "move": [0, 0, 0.1], "speed": 0.1}], ("ball",)),
        ([CLOSE, {"tools": ["ball"], "move": [0, 0, 0.1], "speed": 0.1}], ("ball",)),
        ([{"tools": ["ball"], "move": [0, 0.1, 0], "speed": 0.1}], ()),
        ([CLOSE], ()),
        # pressed and left: opened before they go up, or one of them goes up off the other
        ([CLOSE, {"tools": FINGERS, "open": 0.02}, UP], ()),
        ([CLOSE, {"tools": ["left"], "move": [0, 0, 0.05], "speed": 0.05}], ()),
        ([CLOSE, UP, DOWN, {"tools": FINGERS, "open": 0.02}, UP], ("left", "right")),
    ],
)
def test_which_tools_lift(motion: list[dict[str, Any]], names: tuple[str, ...]) -> None:
    """A ball that comes from the side, or goes up beside a grip, does not; one that goes up without a grip may."""
    assert lifters(scene(*motion)) == names


@pytest.mark.kernels
@pytest.mark.parametrize("known", [True, False])
def test_what_was_lowered_before_it_was_let_go_is_set_down(known: bool) -> None:
    """Also where the height of the body is not among the scene's quantities."""
    body = [0.0, 0.025, 0.05, 0.025, 0.001, 0.0, 0.0, 0.0] if known else None
    found = verdict(PLACED, AWAY, body, HELD)
    assert found.outcome == "set down" and "rose by 50.0 mm" in found.text and "down again before" in found.text


@pytest.mark.kernels
def test_what_leans_on_one_finger_is_let_go_when_the_other_goes_up() -> None:
    """It was "lifted" by half of that finger's way."""
    off = scene(CLOSE, UP, DOWN, {"tools": ["right"], "move": [0.02, 0, 0.01], "speed": 0.05})
    left, right = [0.0, 0.025, 0.05, 0.025, 0.0, 0.0, 0.0], [0.0, 0.025, 0.05, 0.025, 0.0, 0.005, 0.01]
    found = judge(off, columns(left, right, left, [5.0] * 5 + [0.0] * 2, leans=1.0), True)
    assert found.outcome == "set down" and "rose by 50.0 mm" in found.text


@pytest.mark.kernels
def test_what_is_set_down_on_something_higher_stays_there() -> None:
    """Fingers that lower it by half and part: it stays where it is."""
    z, body = [0.0, 0.05, 0.025, 0.025, 0.1], [0.0, 0.05, 0.025, 0.025, 0.025]
    found = verdict(PLACED, z, body, [5.0, 5.0, 5.0, 0.0, 0.0])
    assert found.outcome == "set down" and "lowered to 25.0 mm" in found.text


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("z", "body", "force"),
    [
        # lost as high as it was lifted
        ([0.0, 0.025, 0.05, 0.05, 0.05], [0.0, 0.025, 0.05, 0.0, 0.0], [5.0, 5.0, 5.0, 0.0, 0.0]),
        # lost on the way down, which it falls
        ([0.0, 0.05, 0.04, 0.03, 0.06], [0.0, 0.05, 0.04, 0.0, 0.0], [5.0, 5.0, 5.0, 0.0, 0.0]),
        # lost on the way down, in the last step: nobody has seen it fall yet
        ([0.0, 0.05, 0.04, 0.04], [0.0, 0.05, 0.04, 0.038], [5.0, 5.0, 5.0, 0.0]),
        # never came up with them
        (AWAY, [0.0, 0.003, 0.006, 0.003, 0.0, 0.0, 0.0, 0.0], HELD),
    ],
)
def test_what_fell_or_stayed_below_is_not_set_down(
    z: Sequence[float], body: Sequence[float], force: Sequence[float]
) -> None:
    assert verdict(PLACED, z, body, force).outcome == "dropped"


@pytest.mark.kernels
def test_what_is_lowered_and_still_held_is_not_set_down() -> None:
    z = [0.0, 0.025, 0.05, 0.025, 0.0]
    assert verdict(scene(CLOSE, UP, DOWN), z, z, [5.0] * 5).outcome == "finished"


@pytest.mark.kernels
def test_the_curves_show_the_same_rise() -> None:
    """The dashed line ends where the verdict has it, and begins where the tools begin to rise."""
    run = columns([0.02, 0.0, 0.05, 0.066], [0.02, 0.0, 0.05, 0.034], None, [0.0, 5.0, 5.0, 5.0])
    axes: Axes = Figure().subplots()
    recording = object.__new__(Recording)
    recording.scene = scene(CLOSE, UP)
    charts.draw_tool_rise(axes, recording, run)
    x, y = map(np.asarray, axes.lines[0].get_data())
    assert np.allclose(x, [0.2, 0.3, 0.4]) and np.allclose(y, [0.0, 50.0, 50.0])
    assert np.isclose(1e3 * tool_rise(("left", "right"), run)[-1], y[-1])


def test_a_run_without_solutions_has_failed() -> None:
    """A body that never moved, for no step was solved, had `come to its end`."""
    ended = Verdict("finished", "the run came to its end")
    assert with_failures(ended, 0, 10) == ended
    few = with_failures(ended, 2, 10)
    assert few.outcome == "finished" and few.text.endswith(
        "2 of 10 steps found no solution, and the body stood still in them"
    )
    assert with_failures(ended, 5, 10).outcome == "failed"


PRESS = [{"tools": ["ball"], "move": [0, 0, z], "speed": 0.05} for z in (-0.004, 0.004)]


def pressed(force: float, body: Sequence[float], fixed: bool = False) -> Verdict:
    """Of a ball that goes down by 4 mm and up again, with this vertical force on it at its lowest [N]."""
    motion = scene(*PRESS)
    if fixed:
        body_spec = {**SCENE["body"], "fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0.001]}]}  # type: ignore[dict-item]
        motion = Scene.model_validate({**SCENE, "motion": PRESS, "body": body_spec})
    found, z = Columns(0.1, ("ground", "left", "right", "ball")), [0.0, -0.004, -0.002, 0.0]
    like = next(message for message in Squeeze(1).messages() if isinstance(message, StepReport))
    for k, height in enumerate(z):
        position, wrench = np.zeros((4, 3)), np.zeros((4, 6))
        position[3, 2], wrench[3, 2] = height, force * (1.0 + height / 0.008 if height else 0.0)
        header = replace(like.header, step=k, time=0.1 * k)
        quantities = {"slip": 1e-4, "lift_height": body[k]}
        found.add(replace(like, header=header, tool_position=position, wrench=wrench, quantities=quantities))
    return judge(motion, found, True)


@pytest.mark.kernels
@pytest.mark.parametrize("fixed", [False, True])
def test_what_is_pressed_and_left_was_not_to_be_lifted(fixed: bool) -> None:
    assert pressed(2.0, [0.0] * 4, fixed).outcome == "finished"


@pytest.mark.kernels
def test_what_lay_on_a_tool_that_goes_up_was() -> None:
    """A spatula under it: it presses the tool down, and comes up with it, or slides off."""
    assert pressed(-2.0, [0.0, 0.0, 0.002, 0.004]).outcome == "dropped"  # nothing lies on it in the end
    assert pressed(-2.0, [0.0, 0.0, 0.002, 0.004], fixed=True).outcome == "finished"
