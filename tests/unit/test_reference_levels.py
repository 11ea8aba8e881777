"""The levels of a reference: which it takes, and what it leaves out, on a body of known error C h + D dt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softseam.errors import SceneRefused, SoftseamError
from softseam.scenes import load_scene
from softseam.variants import with_settings
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.frame import Frame, frame_of
from softseam_studies.study.levels import Levels
from softseam_studies.study.measure import Outcome, Told
from softseam_studies.study.reference import NEAR, counted
from softseam_studies.study.refine import fine, refine
from softseam_studies.study.richardson import Limit
from softseam_studies.study.series import Series

TIME = np.arange(0.0, 1.0, 0.01)


class Known(Levels):
    """Levels of J = 1 + h/10 + dt, and of one that grows by `rise` where h is halved; both take `cost`/(h dt)."""

    def __init__(self, frame: Frame, cost: float, rise: float = 0.0) -> None:
        super().__init__("tofu_grasp", (), frame, ("grip_force", "sag"))
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


def told(text: str, seconds: float) -> Told:
    return lambda done: None


def frame(name: str = "tofu_grasp", extent: tuple[float, ...] = (0.05, 0.05, 0.05)) -> Frame:
    scene = load_scene(name)
    assert isinstance(scene, Scene)
    return Frame(scene, np.array(extent))


def test_levels_end_with_the_last_that_ends_within_the_budget() -> None:
    """Five cells across would take some 17 s of 30, with 24 s for the cells and 10 spent."""
    levels = Known(frame(), 0.1)
    found = refine(levels, 30.0, told, target=1e-6)
    across = [level.across for level in found.levels if level.step == 0.01]
    assert across == [2, 3, 4] and not found.complete
    assert found.truth["grip_force"].values == pytest.approx(np.ones(len(TIME)), abs=1e-9)


def test_a_level_that_fails_ends_the_refining_and_not_the_reference() -> None:
    class Failing(Known):
        most = 99

        def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
            if across > self.most:
                raise SoftseamError("the reference cannot be computed")
            return super().run(across, step, limit_s, told)

    levels = Failing(frame(), 1e-4)
    levels.most = 5
    found = refine(levels, 30.0, told, target=1e-6)
    assert max(level.across for level in found.levels) == 5 and not found.complete
    assert found.truth["grip_force"].values == pytest.approx(np.ones(len(TIME)), abs=1e-3)
    levels = Failing(frame(), 1e-4)
    levels.most = 3
    with pytest.raises(SoftseamError, match="cannot be computed"):
        refine(levels, 30.0, told, target=1e-6)


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
        Levels("tofu_grasp", thin, sheet, ("sag",)).open("code", fresh=False)


@pytest.mark.parametrize(("share", "counts"), [(0.8, True), (1.8, False)])
@pytest.mark.parametrize("target", [1e-3, 0.05])
def test_levels_that_went_no_farther_than_what_has_to_be_known_are_known(
    share: float, counts: bool, target: float
) -> None:
    """Though they do not fall, and whatever target they were taken for, which three levels may meet; of stress, for a
    way has a limit, and is known to how far its levels went."""
    levels = Known(frame(), 1e-4, share * NEAR * 0.05)  # the last four levels halve h, or nearly
    found = refine(levels, 30.0, told, target=target)
    assert found.truth["sag"].has_limit and not found.truth["sag"].left_out
    truth, parts = dict(found.truth), dict(found.parts)
    truth["core.von_mises"], parts["core.von_mises"] = truth.pop("sag"), parts.pop("sag")
    stress = counted(replace(found, truth=truth, parts=parts), truth).truth["core.von_mises"]
    assert stress.has_limit is counts and (not stress.left_out) is counts


@pytest.mark.kernels
def test_levels_are_kept_of_all_quantities_and_each_levels_sees_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plan of a force alone leaves nothing behind that a later chart would take for all there is."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scene = load_scene("cantilever")
    block = Frame(scene, np.array([0.2, 0.05, 0.05]))
    short = ("duration=0.01",)
    first, again = (Levels("cantilever", short, block, names) for names in (("tip_deflection",), scene.quantities))
    for levels in (first, again):
        levels.open("code", fresh=False)
    first.run(2, 0.002, 60.0)
    assert [*first.series((2, 0.002)).values] == ["tip_deflection"]
    found = again.cached(2, 0.002)
    assert found is not None and found.series is not None and [*found.series.values] == [*scene.quantities]


@pytest.mark.kernels
def test_scenes_that_ask_for_others_store_their_levels_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They belong to one motion, and share what both ask for."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    asked = ("tip_deflection",), ("peak_von_mises",), ("peak_von_mises", "tip_deflection")
    levelss = []
    for names in asked:
        settings = ("duration=0.01", f"quantities=[{', '.join(names)}]")
        scene = with_settings(load_scene("cantilever"), settings)
        levelss.append(Levels("cantilever", settings, Frame(scene, np.array([0.2, 0.05, 0.05])), names))
        levelss[-1].open("code", fresh=False)
    for levels in levelss[:2]:
        assert levels.cached(2, 0.002) is None
        levels.run(2, 0.002, 60.0)
    assert all(levels.cached(2, 0.002) is not None for levels in levelss[:2])
    assert levelss[2].cached(2, 0.002) is None
    levelss[2].run(2, 0.002, 60.0)
    assert all(levels.cached(2, 0.002) is not None for levels in levelss)
