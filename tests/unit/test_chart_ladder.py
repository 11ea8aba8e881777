"""The ladder of a reference: which levels it takes, and what it leaves out, on a body of known error C h + D dt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softseam.errors import SceneRefused, SoftseamError
from softseam.scenes import load_scene
from softseam.session import open_as_given
from softseam.study.assemble import NEAR
from softseam.study.climb import climb, climb_graded, fine, short_enough, steps_at, with_halves
from softseam.study.frame import Frame, frame_of
from softseam.study.ladder import Ladder
from softseam.study.measure import Outcome, Told, measure
from softseam.study.richardson import Limit
from softseam.study.series import Series
from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.scene.scene import Scene

TIME = np.arange(0.0, 1.0, 0.01)


class Known(Ladder):
    """Levels of J = 1 + h/10 + dt, and of one that grows by `rise` where h is halved; both take `cost`/(h dt)."""

    def __init__(self, frame: Frame, cost: float, rise: float = 0.0) -> None:
        super().__init__("tofu_grasp", (), frame, ("grip_force",))
        self.graded = None
        self.cost, self.rise, self.asked = cost, rise, list[tuple[float, float]]()

    def cached(self, across: float, step: float) -> Outcome | None:
        return self.done.get((across, step))

    def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        if (across, step) not in self.done:
            self.asked.append((across, step))
            force = np.full(len(TIME), 1.0 + 0.1 / across + step)
            sag = np.full(len(TIME), 1.0 + self.rise * np.log2(across))
            spent = self.cost * across**3 * 0.01 / step
            self.spent += spent
            series = Series(TIME, np.zeros(len(TIME)), {"grip_force": force, "sag": sag})
            self.done[across, step] = Outcome("done", series=series, walls=(spent,), spent=spent)
        return self.done[across, step]


class Meddling(Known):
    """Levels of J = 1 + 10 dt + h (1/10 - 8 dt): what cells do to it depends on the step."""

    def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        found = super().run(across, step, limit_s, told)
        if found.series is not None:
            found.series.values["grip_force"][:] = 1.0 + 10.0 * step + (0.1 - 8.0 * step) / across
        return found


def told(text: str, seconds: float) -> Told:
    return lambda done: None


def frame(name: str = "tofu_grasp", extent: tuple[float, ...] = (0.05, 0.05, 0.05)) -> Frame:
    scene = load_scene(name)
    assert isinstance(scene, Scene)
    return Frame(scene, np.array(extent))


def test_levels_end_with_the_last_that_ends_within_the_budget() -> None:
    """Six cells across would take 22 s of 30, with 26 s for the cells and 22 spent."""
    ladder = Known(frame(), 0.1)
    found = climb(ladder, frame(), 30.0, told, target=1e-6)
    across = [level.across for level in found.levels if level.step == 0.01]
    assert across == [2, 3, 4, 5] and not found.complete
    assert found.truth["grip_force"].values == pytest.approx(np.ones(len(TIME)), abs=1e-9)


def test_what_no_whole_level_fits_in_goes_to_levels_between() -> None:
    """Whole levels to seven across and steps leave some of 125 s, and eight across do not fit."""
    slab = frame("tofu_slab", (0.24, 0.16, 0.06))
    ladder = Known(slab, 0.1)
    found = climb(ladder, slab, 125.0, told, target=1e-6)
    across = [level.across for level in found.levels if level.step == slab.scene.step]
    whole = [each for each in across if each == int(each)]
    assert whole == list(range(2, int(across[-1]) + 1)) and 8 not in across
    assert across == sorted(across) and len(across) > len(whole)
    assert ladder.spent <= 125.0
    force = found.truth["grip_force"]
    assert force.uncertainty < 0.02
    assert force.values == pytest.approx(np.ones(len(TIME)), abs=force.uncertainty)


def test_levels_between_are_tried_from_the_finest_each_of_other_cells_than_all() -> None:
    """Of tofu_slab 4.5 across are 18 x 12 x 4 cells; of a cube half of them are those of the next level."""
    asked: list[float] = []

    def take(across: float) -> bool:
        asked.append(across)
        return across < 5

    slab = frame("tofu_slab", (0.24, 0.16, 0.06))
    assert with_halves(Known(slab, 0.1), slab, [2, 3, 4, 5, 6], take) == [2, 2.5, 3, 3.5, 4, 4.5, 5, 6]
    assert asked == [5.5, 4.5, 3.5, 2.5]
    counts = [slab.level(across) for across in (2, 2.5, 3, 3.5, 4, 4.5, 5)]
    assert len({slab.n_cells(each) for each in counts}) == len(counts)
    assert with_halves(Known(frame(), 0.1), frame(), [2, 4, 6], lambda across: True) == [2, 3, 4, 5, 6]


def test_levels_that_divide_cells_alike_have_none_between() -> None:
    heavy = frame("heavy_on_soft", (0.06, 0.04, 0.04))
    assert with_halves(Known(heavy, 0.1), heavy, [2, 4, 6], lambda across: True) == [2, 4, 6]


def test_levels_between_have_cells_of_another_size() -> None:
    """What differs along an axis that little changes along, alone, is of one size."""
    scene = load_scene("tofu_grasp")
    along = {"kind": "cylinder", "radius": 0.01, "length": 0.1, "axis": [0, 1, 0]}
    tools = {name: along | {"position": [x, 0.0, 0.025]} for name, x in (("left", -0.05), ("right", 0.05))}
    rods = Scene.model_validate(scene.model_dump() | {"tools": tools})
    block = Frame(rods, np.full(3, 0.05))
    assert block.even == 1
    found = with_halves(Known(block, 0.1), block, [2, 3, 4, 5, 6, 7, 8], lambda across: True)
    sizes = [block.size(block.level(across)) for across in found]
    assert sizes == sorted(set(sizes), reverse=True)


def test_a_level_that_fails_ends_the_refining_and_not_the_reference() -> None:
    class Failing(Known):
        most = 99

        def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
            if across > self.most:
                raise SoftseamError("the reference cannot be computed")
            return super().run(across, step, limit_s, told)

    ladder = Failing(frame(), 1e-4)
    ladder.most = 5
    found = climb(ladder, frame(), 30.0, told, target=1e-6)
    assert max(level.across for level in found.levels) == 5 and not found.complete
    assert found.truth["grip_force"].values == pytest.approx(np.ones(len(TIME)), abs=1e-3)
    ladder = Failing(frame(), 1e-4)
    ladder.most = 3
    with pytest.raises(SoftseamError, match="cannot be computed"):
        climb(ladder, frame(), 30.0, told, target=1e-6)


def test_slip_is_waited_for_where_it_is_alone() -> None:
    """Where others are asked for, too, it decides nothing."""
    first = Limit(np.ones(4), 0.2, 1.0, True)
    assert fine({"slip": first, "sag": replace(first, uncertainty=1e-6)}, 0.01, 5)
    assert not fine({"slip": first}, 0.01, 5)


def test_a_body_too_thin_for_a_reference_is_refused_for_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    thin = ("body.shape.size=[0.3, 0.3, 0.001]", "body.cell=[0.05, 0.05, 0.001]")
    sheet = frame_of(with_settings(load_scene("tofu_grasp"), thin), "tofu_grasp", thin)
    with pytest.raises(SceneRefused, match=r"'tofu_grasp' these are 720,000 cells, .* too thin"):
        Ladder("tofu_grasp", thin, sheet, ("sag",)).open("code", fresh=False)


class Thinner(Known):
    """A second family: J = 1 + h/30 + dt + `apart`, on an eighth more cells."""

    def __init__(self, frame: Frame, cost: float, apart: float = 0.0) -> None:
        super().__init__(frame, cost)
        self._grading, self.apart, self.most = 4.0, apart, 99

    def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        if (across, step) not in self.done:
            found = super().run(across, step, limit_s, told)
            force = np.full(len(TIME), 1.0 + 0.1 / 3 / across + step + self.apart)
            series = Series(TIME, np.zeros(len(TIME)), {"grip_force": force, "sag": np.ones(len(TIME))})
            self.done[across, step] = replace(found, series=series, n_cells=int(1.125 * across**3))
        return self.done[across, step]


def test_what_is_left_of_the_budget_goes_to_a_second_family_of_levels() -> None:
    """Of 60 s 30 are for equal cells, up to five across, which take 22. Three of a second family are too few; what
    many say, and the first does, is what is known."""
    ladder, second = Known(frame(), 0.1), Thinner(frame(), 0.1)
    alone = climb(ladder, frame(), 60.0, told, target=1e-6)
    ladder = Known(frame(), 0.1)
    ladder.graded = second
    both = climb(ladder, frame(), 60.0, told, target=1e-6)
    assert {across for across, _ in second.done} == {3, 4, 5}
    assert all(level.grading == 1.0 for level in both.levels)
    assert second.spent > 0.0 and ladder.spent_in_all == ladder.spent + second.spent <= 60.0
    ladder = Known(frame(), 0.1)
    ladder.graded = Thinner(frame(), 1e-3)
    both = climb(ladder, frame(), 60.0, told, target=1e-6)
    thinner = [level.across for level in both.levels if level.grading == 4.0]
    assert thinner[0] == 3 and thinner[-1] > 12, "two cells are equal ones, however graded"
    assert both.truth["grip_force"].values == pytest.approx(np.ones(len(TIME)), abs=1e-6)
    assert both.truth["grip_force"].uncertainty < 0.5 * alone.truth["grip_force"].uncertainty


@pytest.mark.parametrize("apart", [0.0, 0.2])
def test_families_that_disagree_leave_more_uncertain(apart: float) -> None:
    ladder = Known(frame(), 1e-4)
    ladder.graded = Thinner(frame(), 1e-4, apart)
    found = climb(ladder, frame(), 30.0, told, target=1e-6).truth["grip_force"]
    assert np.abs(found.values - 1.0).max() <= apart + 1e-6
    assert (found.uncertainty > 0.02) is (apart > 0.0)


def test_levels_of_no_more_cells_are_left_out() -> None:
    """Between planes, seven across may be what six are."""
    ladder, cells = Thinner(frame(), 1e-4), {3.0: 27, 4.0: 64, 5.0: 64, 6.0: 60, 7.0: 125}

    def take(across: float) -> bool:
        if across in cells:
            found = ladder.run(across, 0.01, 1.0)
            ladder.done[across, 0.01] = replace(found, n_cells=cells[across])
        return across in cells

    assert climb_graded(ladder, frame(), 0.01, take) == [(3, 0.01), (4, 0.01), (7, 0.01)]


def test_thin_cells_that_fail_end_their_family_and_not_the_reference() -> None:
    class Failing(Thinner):
        def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
            if across > self.most:
                raise SoftseamError("the reference cannot be computed")
            return super().run(across, step, limit_s, told)

    for most, used in ((2, []), (5, []), (6, [3, 4, 5, 6])):
        ladder, second = Known(frame(), 1e-4), Failing(frame(), 1e-4)
        second.most, ladder.graded = most, second
        found = climb(ladder, frame(), 30.0, told, target=1e-6)
        assert [level.across for level in found.levels if level.grading > 1.0] == used
        assert found.truth["grip_force"].values == pytest.approx(np.ones(len(TIME)), abs=1e-3)


def test_levels_of_graded_cells_have_a_folder_and_settings_of_their_own() -> None:
    """To tools' edges where these lie well inside faces, else to the faces: silken_tofu's plates end 0.5 mm above its
    lower face, which cells of 10 mm have no border for. None where cells follow a ball."""
    pads = Ladder("tofu_pads", (), frame("tofu_pads"), ("grip_force",))
    assert pads.graded is not None and pads.graded.graded is None and pads.graded.key != pads.key
    cells = "\n".join(pads.graded._level(5, 0.01))
    assert (
        'towards=["left", "right"]' in cells and "grading=4" in cells and "grading" not in "".join(pads._level(5, 0.01))
    )
    towards = {
        "tofu_slab": ("lower", "table", "upper"), "silken_tofu": (), "tofu_grasp": (), "heavy_on_soft": (),
        "stiff_inclusion": None, "cantilever": None, "sausage_bend": None, "dumpling": None,
    }  # fmt: skip
    assert {name: frame_of(load_scene(name), name, ()).towards for name in towards} == towards


def test_graded_levels_are_thin_at_faces_and_where_materials_meet() -> None:
    """Each layer of heavy_on_soft is as fine at the border as at its face: there a hard one ends on a soft one."""
    heavy = Ladder("heavy_on_soft", (), frame("heavy_on_soft", (0.06, 0.04, 0.04)), ("sag",))
    assert heavy.graded is not None
    cells = heavy.graded._level(8, 0.01)
    with open_as_given("heavy_on_soft", settings=(*AS_GIVEN, *cells)) as session:
        z = np.unique(session.reset().surface[:, 2].round(9))
    edges = np.diff(z[z <= 0.02 + 1e-9])[::2]
    assert edges[0] == pytest.approx(edges[-1]) and edges[len(edges) // 2] > 2.0 * edges[0]
    assert 0.02 in z


def test_cells_are_refined_at_a_short_step_where_the_scenes_changes_what_they_do() -> None:
    """The sum of what cells do at 10 ms and of what steps do on 4 x 4 x 4 would be 2 % off: 0.08/4."""
    ladder = Meddling(frame(), 1e-3)
    reference = climb(ladder, frame(), 60.0, told)
    short = min(step for across, step in ladder.asked if across == 5)
    assert short == 0.0025
    error = abs(reference.truth["grip_force"].values[-1] - 1.0)
    assert error <= reference.truth["grip_force"].uncertainty and error < 0.006
    levels = {(level.across, level.step) for level in reference.levels}
    assert (5, short) in levels and (5, 0.01) not in levels, "what does not count does not ship"


def test_a_step_that_changes_little_is_the_scenes_own() -> None:
    """1 % of grip_force by 10 ms; and 8 %, of which 2 are left at 2.5 ms."""
    for ladder, expected in ((Known(frame(), 1e-3), 0.01), (Meddling(frame(), 1e-3), 0.0025)):
        rungs = [(4, 0.01 / 2**k) for k in range(8)]
        for rung in rungs:
            ladder.run(*rung, 1.0)
        assert short_enough(ladder, rungs) == expected


def test_steps_are_refined_on_more_than_the_coarsest_cells_where_these_are_few() -> None:
    assert steps_at(frame()) == 4
    assert steps_at(frame("tofu_push", (0.06, 0.06, 0.04))) == 4, "3 x 3 x 2 cells sway otherwise than 6 x 6 x 4"
    assert steps_at(frame("heavy_on_soft", (0.06, 0.04, 0.04))) == 4, "its layers end between cells of a fourth"
    assert steps_at(frame("tofu_slab", (0.24, 0.16, 0.06))) == 2, "12 x 8 x 3 are many"
    assert steps_at(frame("sausage_bend", (0.12, 0.02, 0.02))) == 3
    ladder = Known(frame("tofu_slab", (0.24, 0.16, 0.06)), 0.01)
    climb(ladder, frame("tofu_slab", (0.24, 0.16, 0.06)), 30.0, told, target=1e-6)
    assert {across for across, step in ladder.asked if step < 0.01} == {2}


@pytest.mark.parametrize(("share", "counts"), [(0.8, True), (1.8, False)])
@pytest.mark.parametrize("target", [1e-3, 0.05])
def test_levels_that_went_no_farther_than_what_has_to_be_known_are_known(
    share: float, counts: bool, target: float
) -> None:
    """Though they do not fall, and whatever target they were taken for, which three levels may meet."""
    ladder = Known(frame(), 1e-4, share * NEAR * 0.05)  # the last four levels halve h, or nearly
    sag = climb(ladder, frame(), 30.0, told, target=target).truth["sag"]
    assert sag.has_limit is counts and (not sag.left_out) is counts


def test_a_level_that_did_not_end_in_time_is_not_begun_again_in_as_much(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it was seen to take is kept: a chart that is drawn anew does not spend half of its minutes on it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def slowly(*given: Any, **named: Any) -> Outcome:
        """On a machine so slow that no level takes as little as foreseen, whatever this one is."""
        outcome = measure(*given, **named)
        return replace(outcome, spent=100.0 * outcome.spent)

    monkeypatch.setattr("softseam.study.ladder.measure", slowly)
    block = frame()
    first, again = (Ladder("tofu_grasp", (), block, ("grip_force",)) for _ in range(2))
    for ladder in (first, again):
        ladder.open("code", fresh=False)
    before = first.seconds(6, 0.01)
    stopped = first.run(6, 0.01, 0.02)
    assert stopped.status == "stopped" and stopped.simulated < block.length
    assert again.seconds(6, 0.01) == pytest.approx(stopped.spent * block.length / stopped.simulated)
    assert again.seconds(6, 0.01) > max(before, 0.02) and again.cached(6, 0.01) is None
    again.open("code", fresh=True)
    assert again.seconds(6, 0.01) == before


def test_levels_are_kept_of_all_quantities_and_each_ladder_sees_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plan of a force alone leaves nothing behind that a later chart would take for all there is."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scene = load_scene("cantilever")
    block = Frame(scene, np.array([0.2, 0.05, 0.05]))
    short = ("duration=0.01",)
    first, again = (Ladder("cantilever", short, block, names) for names in (("tip_deflection",), scene.quantities))
    for ladder in (first, again):
        ladder.open("code", fresh=False)
    first.run(2, 0.002, 60.0)
    assert [*first.series((2, 0.002)).values] == ["tip_deflection"]
    found = again.cached(2, 0.002)
    assert found is not None and found.series is not None and [*found.series.values] == [*scene.quantities]


def test_levels_of_another_machine_are_known_and_are_no_plan_of_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two machines may share a home folder: what one computed is true on the other, and its time is not."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scene = load_scene("cantilever")
    block, names = Frame(scene, np.array([0.2, 0.05, 0.05])), ("tip_deflection",)
    first, again = (Ladder("cantilever", ("duration=0.01",), block, names) for _ in range(2))
    for ladder in (first, again):
        ladder.open("code", fresh=False)
    first.run(2, 0.002, 60.0)
    again.run(2, 0.002, 60.0)
    assert len(first.tried()) == len(again.tried()) == 1 and again.spent == 0.0
    monkeypatch.setattr("softseam.study.ladder.machine", lambda: "another, 64 cores")
    again.run(2, 0.002, 60.0)
    assert again.spent == 0.0 and again.tried() == []
    again.run(2, 0.001, 60.0)
    assert len(again.tried()) == 1


def test_scenes_that_ask_for_others_keep_their_levels_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They belong to one motion, and share what both ask for."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    asked = ("tip_deflection",), ("peak_von_mises",), ("peak_von_mises", "tip_deflection")
    ladders = []
    for names in asked:
        settings = ("duration=0.01", f"quantities=[{', '.join(names)}]")
        scene = with_settings(load_scene("cantilever"), settings)
        ladders.append(Ladder("cantilever", settings, Frame(scene, np.array([0.2, 0.05, 0.05])), names))
        ladders[-1].open("code", fresh=False)
    for ladder in ladders[:2]:
        assert ladder.cached(2, 0.002) is None
        ladder.run(2, 0.002, 60.0)
    assert all(ladder.cached(2, 0.002) is not None for ladder in ladders[:2])
    assert ladders[2].cached(2, 0.002) is None
    ladders[2].run(2, 0.002, 60.0)
    assert all(ladder.cached(2, 0.002) is not None for ladder in ladders)
