"""Tools that hold a force let go of it where they are opened, or moved apart, and go as far as they are told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

STEP, FINGERS = 0.01, ["left", "right"]
HOLD: dict[str, Any] = {"tools": FINGERS, "close": 0.02, "force": 1.0, "until": {"force": 0.9, "time": 1.0}}


def run(motion: list[dict[str, Any]], model: str = "fem", **finger: Any) -> tuple[list[StepReport], list[str]]:
    """Of a cube of 3 cm between two plates 1 mm clear of it; what each step tells, and what was not done."""
    plate = {"kind": "box", "size": [0.01, 0.04, 0.03], "friction": 0.7, **finger}
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "opening",
            "step": STEP,
            "body": {
                "shape": {"kind": "block", "size": [0.03, 0.03, 0.03]},
                "cell": 0.015,
                "material": {"young": 3e4, "poisson": 0.4, "density": 1000.0, "retardation_time": 0.005},
            },
            "tools": {
                "ground": {"kind": "plane", "friction": 0.5},
                "left": {**plate, "position": [-0.021, 0, 0.018]},
                "right": {**plate, "position": [0.021, 0, 0.018]},
            },
            "motion": motion,
            "regions": {"default": model},
        }
    )
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
        assert len(reports) < 500
    told = [event.message for event in simulation.events if event.kind is EventKind.NOT_DONE]
    simulation.close()
    return reports, told


def ends(reports: list[StepReport], phase: int) -> StepReport:
    """The last step of a phase."""
    return [report for report in reports if report.phase == phase][-1]


def gone(reports: list[StepReport], phase: int) -> np.ndarray:
    """How far the plates went in it along x [m]."""
    return np.asarray(ends(reports, phase).tool_position[1:, 0] - ends(reports, phase - 1).tool_position[1:, 0])


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_finger_that_is_moved_off_lets_go_and_the_other_stays(model: str) -> None:
    off: dict[str, Any] = {"tools": ["left"], "move": [-0.0123, 0, 0], "speed": 0.05}
    reports, told = run([HOLD, {"hold": 0.1}, off, {"hold": 0.1}], model)
    assert ends(reports, 1).quantities["grip_force"] == pytest.approx(1.0, rel=0.05)
    np.testing.assert_allclose(gone(reports, 2), [-0.0123, 0.0], atol=1e-9)
    np.testing.assert_allclose(gone(reports, 3), 0.0, atol=1e-9)
    assert not ends(reports, 3).wrench[1, :3].any() and told == []


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_tools_open_by_a_way_or_to_where_they_began(model: str) -> None:
    opened = {"tools": ["right", "left"], "open": 0.03, "until": {"way": 0.0007}}
    reports, told = run([HOLD, {"hold": 0.1}, opened, {"hold": 0.05}, {"tools": FINGERS, "open": 0.05}], model)
    both = gone(reports, 2) + gone(reports, 3)  # it ends within a step
    np.testing.assert_allclose(both, [-0.0007, 0.0007], atol=1e-9)
    np.testing.assert_allclose(reports[-1].tool_position[1:, 0], [-0.021, 0.021], atol=1e-9)
    assert not reports[-1].wrench[1:, :3].any() and told == []
    assert ends(reports, 1).quantities["compression"] > ends(reports, 3).quantities["compression"]
    assert reports[-1].quantities["compression"] == 0.0


def test_what_was_opened_can_be_closed_and_held_again() -> None:
    motion = [HOLD, {"hold": 0.1}, {"tools": FINGERS, "open": 0.05}, HOLD, {"hold": 0.3}]
    reports, told = run(motion)
    assert ends(reports, 4).quantities["grip_force"] == pytest.approx(1.0, rel=0.03) and told == []


def test_a_hold_goes_on_while_both_or_others_move() -> None:
    """Aside, across, in a turn about their middle, and while the ground goes down."""
    moves: list[dict[str, Any]] = [
        {"tools": FINGERS, "move": [0, 0, 0.01], "speed": 0.05},
        {"tools": FINGERS, "move": [0.02, 0, 0], "speed": 0.05},
        {"tools": FINGERS, "turn": [0, 0, 0.3], "speed": 1.0},
        {"tools": ["ground"], "move": [0, 0, -0.01], "speed": 0.05},
        {"hold": 0.3},
    ]
    reports, told = run([HOLD, {"hold": 0.1}, *moves])
    assert reports[-1].quantities["grip_force"] == pytest.approx(1.0, rel=0.02) and told == []


def test_a_finger_that_is_held_up_by_its_limit_is_told_of_in_millimetres() -> None:
    push = {"tools": ["left"], "move": [0.011, 0, 0], "speed": 0.05}
    wall = [{"tools": ["right"], "move": [-0.001, 0, 0], "speed": 0.1}]
    reports, told = run([*wall, push], force_limit=0.5)
    went = 1e3 * float(gone(reports, 1)[0])
    assert 1.0 < went < 9.0
    (text,) = told
    assert f"motion[1]: left went {went:.1f} of 11.0 mm" in text and "force_limit" in text
