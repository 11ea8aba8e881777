"""What a plan promises: what was asked, but for what any run has because the motion prescribes it; and its minutes."""

from __future__ import annotations

import json
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.scenes import load_scene
from softseam_protocol.scene.file import scene_json
from softseam_protocol.scene.scene import Scene
from softseam_studies.study import plan_command
from softseam_studies.study.errors import Truth
from softseam_studies.study.measure import READING, Deadline, Outcome, measure
from softseam_studies.study.planner import NoPlan, promised
from softseam_studies.study.reference import Part, Reference, counted
from softseam_studies.study.refine import fine
from softseam_studies.study.richardson import Limit

CLOSE = {"tools": ["left", "right"], "close": 0.02}
LIFT = {"tools": ["left", "right"], "move": [0, 0, 0.01], "speed": 0.05}


def scene(*motion: dict[str, Any]) -> Scene:
    return Scene.model_validate({**json.loads(scene_json(load_scene("tofu_grasp"))), "motion": list(motion)})


@pytest.mark.parametrize(
    ("motion", "given"),
    [
        ([CLOSE | {"until": {"compression": 0.1}}], {"compression"}),
        ([CLOSE | {"until": {"time": 0.1}}, LIFT], {"compression", "lift_height"}),
        ([CLOSE | {"until": {"compression": 0.1, "force": 1.0}}], set()),
        ([CLOSE | {"until": {"time": 0.1}, "force": 2.0}], {"grip_force"}),
        ([LIFT | {"move": [0.01, 0, 0]}], set()),
    ],
)
def test_what_the_motion_prescribes_is_not_promised(motion: list[dict[str, Any]], given: set[str]) -> None:
    """A way that is ordered, and a force that is held; where a force ends the way, it is the body's."""
    asked = ("grip_force", "compression", "lift_height", "sag")
    assert set(promised(scene(*motion), asked)) == {*asked} - given


def test_where_all_is_prescribed_there_is_no_plan() -> None:
    """It would be any run: one cell has the compression that is ordered."""
    with pytest.raises(NoPlan, match=r"promise nothing: compression \(the motion prescribes it.*grip_force"):
        promised(scene(CLOSE | {"until": {"compression": 0.1}}), ["compression"])


def test_a_force_whose_levels_grow_is_known_to_how_far_they_went() -> None:
    """By ever more, if by little: it is no stress beside an edge, and counts, or is looked at; a stress does not."""
    curve, names = np.ones(5), ("grip_force", "core.von_mises", "sag")
    parts = {name: Part(0.02, 0.0, np.nan, 1.0, 0.0, converges=False) for name in names}
    parts["sag"] = Part(0.0, 0.0, 2.0, 1.0, 0.0)
    truth = {name: Truth(curve, 1.0, parts[name].uncertainty) for name in names}
    grown = Reference(np.linspace(0.0, 1.0, 5), truth, parts, (), "implicit_euler", True)
    known = counted(grown, names, known=0.0375)
    assert known.counted == ["grip_force", "sag"]
    assert "no limit" in known.truth["core.von_mises"].left_out
    vague = counted(grown, names, known=0.001)
    assert vague.truth["grip_force"].has_limit and "known to 2 % only" in vague.truth["grip_force"].left_out
    assert not vague.truth["core.von_mises"].has_limit
    limit = Limit(curve, 0.02, np.nan, False)
    assert fine({"core.von_mises": limit}, 0.001, 9) and not fine({"grip_force": limit}, 0.001, 9)


def test_a_deadline_is_of_wall_time_and_knows_a_busy_machine() -> None:
    """Compiling comes on top, reading what was compiled does not; runs that took thrice their processor's time do."""
    compiled = [0.0]
    deadline = Deadline(10.0, lambda: (99.0, compiled[0]))
    assert 9.5 < deadline.left() <= 10.0 and deadline.before(4.0).left() == pytest.approx(6.0, abs=0.5)
    assert deadline.fits(9.0) and not deadline.fits(9.0, keep=2.0)
    deadline.learn(Outcome("done", walls=(3.0,), cpu=1.0))
    assert deadline.fits(3.0) and not deadline.fits(4.0)
    compiled[0] = READING + 5.0
    assert deadline.left() == pytest.approx(15.0, abs=0.5)


@pytest.mark.kernels
def test_runs_end_when_no_time_is_left() -> None:
    """The one that is under way, and those that would time it anew; what computes is halted within a step."""
    began = perf_counter()
    stopped = measure("tofu_grasp", (), ("grip_force",), left=lambda: began - perf_counter())
    assert stopped.status == "stopped" and stopped.series is None
    once = measure("tofu_grasp", ("motion=[{hold: 0.02}]",), ("grip_force",), runs=3, left=lambda: 1e-9)
    assert once.status == "done" and len(once.walls) == 1


@pytest.mark.kernels
@pytest.mark.parametrize(("known", "wanted"), [(0.06, [36.0, 60.0]), (0.01, [36.0])])
def test_what_is_vaguely_known_is_refined_with_all_of_the_minutes(
    known: float, wanted: list[float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its levels are runs that may be chosen; a plan that can be made keeps the rest for runs."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    budgets = list[float]()
    truth, part = {"grip_force": Truth(np.ones(5), 1.0, known)}, Part(0.0, 0.0, 2.0, 1.0, 0.0)
    made = Reference(np.linspace(0.0, 1.0, 5), truth, {"grip_force": part}, (), "implicit_euler", True)

    def reference_of(levels: object, budget: float, *_: object) -> Reference:
        budgets.append(budget)
        return made

    monkeypatch.setattr(plan_command, "reference_of", reference_of)
    monkeypatch.setattr(plan_command, "measure", lambda *_, **how: Outcome("failed", "not now"))
    wishes = plan_command.Wishes("tofu_grasp", tolerance=0.05, quantities=("grip_force",), minutes=1.0)
    with pytest.raises(NoPlan):
        plan_command.find(wishes, Console(quiet=True))
    assert budgets == wanted


@pytest.mark.kernels
def test_minutes_begin_when_solvers_are_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other processes compile them, which took all minutes of a first plan."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    left = list[float]()

    def search(*given: Any, **how: Any) -> None:
        left.append(given[6].left())
        raise NoPlan("enough is known")

    monkeypatch.setattr(plan_command, "search", search)
    wishes = plan_command.Wishes("tofu_grasp", tolerance=0.05, quantities=("grip_force",), minutes=1.0)
    for waits in (0.0, 1.5):
        monkeypatch.setattr(plan_command, "compile_models", lambda models, waits=waits: sleep(waits))
        with pytest.raises(NoPlan, match="enough"):
            plan_command.find(wishes, Console(quiet=True))
    assert left[1] > left[0] - 0.5
