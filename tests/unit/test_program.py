"""The motion of a scene as steps see it: phases end within a step, unless a force decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.orchestrator.drives import Drives
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.tools.build import build_tools
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.tool_set import ToolSet

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]

SQUEEZE = {"tools": ["left", "right"], "close": 0.02, "until": {"compression": 0.1}}
MOVE = {"tools": ["left", "right"], "move": [0.0, 0.0, 0.03], "speed": 0.07}
TURN = {"tools": ["left", "right"], "turn": [0.0, 0.0, 0.3], "speed": 1.1}


def _scene(step: float, motion: list[dict[str, Any]]) -> Scene:
    plate = {"kind": "box", "size": [0.01, 0.02, 0.02]}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "program",
            "step": step,
            "body": {
                "shape": {"kind": "block", "size": [0.02, 0.02, 0.02]},
                "cell": 0.02,
                "material": {"kind": "linear", "young": 1e4, "poisson": 0.3, "density": 1000.0},
            },
            "tools": {
                "left": {**plate, "position": [-0.02, 0.0, 0.01]},
                "right": {**plate, "position": [0.02, 0.0, 0.01]},
            },
            "motion": motion,
            "regions": {"default": "fem"},
        }
    )


def _program(step: float, motion: list[dict[str, Any]]) -> tuple[Program, ToolSet, Drives]:
    scene = _scene(step, motion)
    body, tools = build_body(scene, {}), build_tools(scene)
    grips = Grips(scene, tools, [body])
    drives = Drives(scene, [body], grips)
    return Program(scene.motion, scene.step, tools, grips, drives.phases), tools, drives


def played(step: float, motion: list[dict[str, Any]]) -> tuple[Floats, Floats, list[Progress]]:
    """Poses after each step (n, t, 3), (n, t, 4), the start first, and the progress, of a motion without forces."""
    program, tools, _ = _program(step, motion)
    position, orientation, progress = tools.position, tools.orientation, Progress()
    places, turns, told = [position], [orientation], [progress]
    while not program.done(progress):
        command, after = program.step(progress, position, orientation)
        assert after is not None
        moved = tool_motion(position, orientation, command, step)
        position, orientation, progress = moved.position_next, moved.orientation_next, after
        places.append(position)
        turns.append(orientation)
        told.append(progress)
    return np.array(places), np.array(turns), told


@pytest.mark.parametrize("step", [0.008, 0.03, 0.2])
def test_poses_at_the_end_of_a_step_are_those_of_the_exact_motion(step: float) -> None:
    motion: list[dict[str, Any]] = [{"hold": 0.0123}, SQUEEZE, MOVE, {"hold": 0.0}, TURN, {"hold": 0.01}]
    fine_places, fine_turns, _ = played(0.001, motion)
    places, turns, _ = played(step, motion)
    time = step * np.arange(len(places))
    fine_time = 0.001 * np.arange(len(fine_places))
    for tool in range(2):
        for axis in range(3):
            exact = np.interp(time, fine_time, fine_places[:, tool, axis])
            # the fine motion's own kinks lie within its steps
            np.testing.assert_allclose(places[:, tool, axis], exact, atol=2e-5)
        for number in range(4):
            exact = np.interp(time, fine_time, fine_turns[:, tool, number])
            np.testing.assert_allclose(turns[:, tool, number], exact, atol=2e-4)
    np.testing.assert_allclose(places[-1], fine_places[-1], atol=1e-12)


def test_as_many_steps_as_the_motion_lasts() -> None:
    motion: list[dict[str, Any]] = [{"hold": 0.0123}, SQUEEZE, MOVE, {"hold": 0.004}]
    for step in (0.001, 0.007, 0.05):
        program, _, _ = _program(step, motion)
        length = program.duration()
        assert length is not None
        assert length == pytest.approx(0.0123 + 0.0120 / 0.04 + 0.03 / 0.07 + 0.004)
        assert len(played(step, motion)[0]) - 1 == int(np.ceil(length / step - 1e-9))


def test_tools_are_looked_at_once_as_they_begin_to_close(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hold ends with a step, or within one: the grip is found where the closing begins, not also the step before."""
    for hold, starts in ((0.1, [10]), (0.105, [10])):
        begun: list[int] = []
        program, tools, _ = _program(0.01, [{"hold": hold}, SQUEEZE])
        monkeypatch.setattr(program.grips, "begin", lambda phase, *poses, at=begun: at.append(phase))
        progress, steps = Progress(), []
        for step in range(14):
            before = begun.count(1)
            _, after = program.step(progress, tools.position, tools.orientation)
            assert after is not None
            steps += [step] * (begun.count(1) - before)
            progress = after
        assert steps == starts


def test_many_short_phases_fit_in_one_step() -> None:
    there = {"tools": ["left"], "move": [0.0, 0.001, 0.0], "speed": 1.0}
    back = {"tools": ["left"], "move": [0.0, -0.001, 0.002], "speed": 1.0}
    places, _, told = played(0.1, [there, back, there, back, {"hold": 0.05}])
    assert len(places) == 2
    np.testing.assert_allclose(places[-1, 0] - places[0, 0], [0.0, 0.0, 0.004], atol=1e-15)
    assert told[-1].phase == 5


def test_two_turns_take_two_steps_so_that_each_has_one_axis() -> None:
    across = {**TURN, "turn": [0.2, 0.0, 0.0], "about": [0.0, 0.0, 0.0]}
    _, _, told = played(0.2, [{**TURN, "turn": [0.0, 0.0, 0.11]}, across])
    assert [progress.phase for progress in told] == [0, 1, 2]


@pytest.mark.parametrize("ending", [{"force": 0.5}, {"force": 0.5, "compression": 0.1}])
def test_a_phase_that_a_force_ends_takes_whole_steps(ending: dict[str, float]) -> None:
    program, tools, _ = _program(0.1, [{"hold": 0.05}, {**SQUEEZE, "until": ending}, {"hold": 0.1}])
    command, after = program.step(Progress(), tools.position, tools.orientation)
    assert after == Progress(1, 0.0)
    assert not command.any()  # the rest of the step is idle
    command, undecided = program.step(after, tools.position, tools.orientation)
    assert undecided is None
    assert command[0, 0] > 0.0
    goes_on = program.after(after, tools.position, tools.orientation, 0.4)
    assert (goes_on.phase, goes_on.elapsed) == (1, 0.1)
    stands = program.after(after, tools.position, tools.orientation, 0.5)
    command, _ = program.step(stands, tools.position, tools.orientation)
    assert stands.phase == 1 and not command.any()
    assert program.after(stands, tools.position, tools.orientation, 0.5) == Progress(2, 0.0)


def test_tools_go_back_to_the_force_that_ends_their_phase() -> None:
    """On a spring that is met on the way, in steps that pass the force by far."""
    program, tools, _ = _program(0.1, [{**SQUEEZE, "until": {"force": 0.5}}, {"hold": 0.1}])
    position, progress, forces = tools.position.copy(), Progress(), list[float]()
    grip = program.grips.first
    assert grip is not None
    touch, stiffness = grip.gap(position, tools.orientation) - 1.5 * 0.1 * 0.04, 450.0  # [m], [N/m]
    while progress.phase == 0:
        command, undecided = program.step(progress, position, tools.orientation)
        assert undecided is None and np.abs(command).max() <= 0.02 * (1.0 + 1e-12)
        position += 0.1 * command[:, :3]
        forces.append(max(0.0, touch - grip.gap(position, tools.orientation)) * stiffness)
        progress = program.after(progress, position, tools.orientation, forces[-1])
    assert forces[0] == 0.0 and max(forces) > 0.8 and forces[-1] == pytest.approx(0.5, rel=0.02)
    assert len(forces) < 9


def test_tools_that_meet_before_the_force_end_the_run_in_words() -> None:
    program, tools, _ = _program(0.1, [{**SQUEEZE, "until": {"force": 50.0}}])
    position = tools.position.copy()
    program.step(Progress(), position, tools.orientation)
    assert program.grips.first is not None and not program.met(position, tools.orientation)
    position[0] += 1.001 * program.grips.first.gap(position, tools.orientation) * program.grips.first.inward[0]
    assert "have met" in program.met(position, tools.orientation)
    with pytest.raises(StepFailed, match=r"motion\[0\].* have met before they pressed with 50 N: .*until.time"):
        program.step(Progress(), position, tools.orientation)


def test_a_phase_under_a_drive_takes_whole_steps() -> None:
    held = {**SQUEEZE, "force": 0.3}
    program, tools, drives = _program(0.1, [{"hold": 0.05}, held, {"hold": 0.12}, {"hold": 0.12}])
    assert drives.phases == {1, 2, 3, 4}
    _, after = program.step(Progress(2, 0.0), tools.position, tools.orientation)
    assert after is None
    # a stand of 0.12 s ends with the nearest step
    assert program.after(Progress(2, 0.0), tools.position, tools.orientation, 0.0) == Progress(3, 0.0)
    # past the end a drive still has its say, and there is no phase to look at
    command, after = program.step(Progress(4, 0.0), tools.position, tools.orientation)
    assert after == Progress(4, 0.0)
    assert not command.any()


def test_a_step_belongs_to_the_phase_in_which_it_ends() -> None:
    program, _, _ = _program(0.1, [{"hold": 0.1}, {"hold": 0.15}, {"hold": 0.1}])
    assert program.phase_of(Progress(0, 0.0), Progress(1, 0.0)) == 0  # ends at the border
    assert program.phase_of(Progress(1, 0.1), Progress(2, 0.05)) == 2
    assert program.phase_of(Progress(2, 0.05), Progress(3, 0.0)) == 2
    assert program.phase_of(Progress(3, 0.0), Progress(3, 0.0)) == -1
