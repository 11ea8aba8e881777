"""docs/results/plans.md: what counts as run, what its speeds are of, and which code it is of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks import plans
from benchmarks.plans import check, ran, timed
from benchmarks.plans_page import TOLERANCES, Checked, Judged, page

from softseam.embedded import solver_digest
from softseam_studies.study.configurations import Configuration, Fem
from softseam_studies.study.errors import Truth
from softseam_studies.study.measure import Outcome, Told
from softseam_studies.study.plan import Goal
from softseam_studies.study.planner import choose
from softseam_studies.study.reference import Part, Reference
from softseam_studies.study.series import Series
from softseam_studies.study.store import Identity, Store
from softseam_studies.study.study import study_of
from softseam_studies.study.table import rows_of

TIME, FLAT = np.linspace(0.0, 1.0, 5), np.ones(5)
LEFT_OUT = Outcome("left out", "give more --minutes")


def done(seconds: float, error: float = 0.0) -> Outcome:
    series = Series(TIME, np.zeros(5), {"sag": FLAT * (1.0 + error)})
    return Outcome("done", series=series, walls=(seconds,), cpu=seconds, simulated=1.0, steps=5)


def reference() -> Reference:
    truth = {"sag": Truth(FLAT, 1.0, 0.001)}
    return Reference(TIME, truth, {"sag": Part(0.0, 0.0, 1.0, 1.0, 0.0)}, (), "implicit_euler", True)


WANTED = [Configuration(key, "XPBD", key, (f"name={key}",), i + 1.0) for i, key in enumerate(("a", "b", "c", "d"))]
OUTCOMES = {"a": LEFT_OUT, "b": Outcome("refused", "no"), "c": Outcome("failed", "it diverged"), "d": done(4.0)}


def test_a_plan_is_held_against_the_fastest_run_that_meets_it() -> None:
    runs = OUTCOMES | {"a": done(1.0, 0.04), "d": done(4.0, 0.03)}
    plan = choose(Goal(tolerance=0.05), reference(), WANTED[1:], lambda one, worth: runs[one.key])
    found = check(0.05, plan, WANTED, runs, reference())
    assert found.made and found.met and not found.cheap and found.cells[-2:] == ("**4.00**", "2")
    wrong = check(0.02, plan, WANTED, runs, reference())
    assert wrong.made and not wrong.met and "**missed**" in wrong.cells[2]
    assert check(0.02, "no plan", WANTED, runs, reference()).cells[0] == "*none*: no plan"


def test_what_was_left_out_makes_its_sweep_incomplete() -> None:
    assert ran(rows_of(WANTED, OUTCOMES, reference())) == "1 of 4, incomplete: 1 had no time"
    assert ran(rows_of(WANTED[1:], OUTCOMES, reference())) == "1 of 3"


def told(text: str, seconds: float) -> Told:
    return lambda done: None


@pytest.mark.kernels
def test_a_short_run_has_the_time_of_one_that_nobody_looks_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = study_of("tofu_push")
    one = Fem(study.frame, (2, 2, 1), 0.08).configuration()
    store = Store(tmp_path, Identity("scene", "code"), "")
    short, long = done(0.9), done(1.1)
    found = timed(study, one, short, store, told)
    assert found.walls != short.walls and found.series is short.series and found.simulated == 1.0
    monkeypatch.setattr(plans, "measure", None)  # what was timed is stored
    assert timed(study, one, short, store, told).walls == found.walls
    assert timed(study, one, long, store, told) is long
    assert timed(study, one, LEFT_OUT, store, told) is LEFT_OUT


@pytest.mark.kernels
def test_the_page_says_which_code_it_is_of() -> None:
    none = tuple(Checked(tolerance, ("*none*", "", "", "", "none", "", "0")) for tolerance in TOLERANCES)
    text = page([Judged("cube", none, "ships", "1 of 4, incomplete: 1 had no time", "", 1.0)])
    assert f"; solvers' digest {solver_digest()[:8]}.\n" in text
    assert "| cube | ships | 1 of 4, incomplete: 1 had no time |" in text and "{" not in text
