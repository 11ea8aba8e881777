"""Levels that other code left behind: taken over where it did what today's does, and never in part by chance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.truths import take_over
from rich.console import Console

from softseam.scenes import load_scene
from softseam.study.frame import Frame
from softseam.study.ladder import Ladder
from softseam.study.measure import Outcome, Told
from softseam.study.series import Series
from softseam.study.store import Identity, Store, cache_folder

NEW, OLD = "new" * 20, "old" * 20
RUNGS = [(2, 0.01), (3, 0.01), (6, 0.01), (2, 0.005), (2, 0.0025)]
QUICK = [(3, 0.01), (2, 0.005)]
"""of those that take no longer than a check may: of most cells at the longest step, and of the shortest step"""


def level(across: float, step: float) -> Outcome:
    time = np.arange(0.0, 1.0, 0.01)
    series = Series(time, np.zeros(100), {"grip_force": 1.0 + 0.1 / across + step + 0.0 * time})
    spent = 2.0 if across < 6 and step > 0.004 else 60.0
    return Outcome("done", series=series, walls=(spent,), spent=spent, simulated=1.0)


class Known(Ladder):
    """Of tofu_grasp, by a formula; what is asked for is noted."""

    def __init__(self) -> None:
        super().__init__("tofu_grasp", (), Frame(load_scene("tofu_grasp"), np.full(3, 0.05)), ("grip_force",))
        self.asked = list[tuple[float, float]]()

    def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        self.asked.append((across, step))
        self.done[across, step] = level(across, step)
        assert self._store is not None
        self._store.write(name(across, step), level(across, step).as_json())
        return self.done[across, step]


def name(across: float, step: float) -> str:
    return f"level-{across:g}-{1e3 * step:g}ms-all"


def folder(code: str) -> Path:
    return cache_folder() / f"tofu_grasp-{Known().key[:12]}-{code[:8]}"


def left(change: Callable[[tuple[float, float]], float], code: str = OLD) -> None:
    """Levels of other code, whose force differs by this share."""
    store = Store(folder(code), Identity(Known().key, code), "")
    for rung in RUNGS:
        found = level(*rung)
        assert found.series is not None
        force = found.series.values["grip_force"] * (1.0 + change(rung))
        store.write(name(*rung), replace(found, series=replace(found.series, values={"grip_force": force})).as_json())


def taken() -> set[str]:
    """What there is of today's code after a call."""
    ladder = Known()
    ladder.open(NEW, fresh=False)
    take_over(ladder, NEW, Console(quiet=True))
    assert sorted(ladder.asked) in ([], sorted(QUICK))
    return {path.stem for path in folder(NEW).glob("level-*")}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def test_levels_of_code_that_did_the_same_are_taken_over_but_for_steps_that_no_check_reaches() -> None:
    left(lambda rung: 1e-8)
    assert taken() == {name(*rung) for rung in RUNGS if rung[1] > 0.004}
    assert taken() == {name(*rung) for rung in RUNGS if rung[1] > 0.004}, "called again"


@pytest.mark.parametrize("moved", QUICK)
def test_levels_of_code_that_did_something_else_are_never_taken_over(moved: tuple[int, float]) -> None:
    """Nor when asked again, now that the levels that told so are there."""
    left(lambda rung: 1e-3 if rung == moved else 0.0)
    assert taken() == {name(*rung) for rung in QUICK}
    assert taken() == {name(*rung) for rung in QUICK}


def test_files_that_are_spoilt_are_left_alone_and_other_code_is_not() -> None:
    left(lambda rung: 0.0)
    spoilt = folder("aaa" * 20)
    left(lambda rung: 0.0, "aaa" * 20)
    (spoilt / f"{name(2, 0.01)}.json").write_text("{}")
    assert taken() == {name(*rung) for rung in RUNGS if rung[1] > 0.004}
