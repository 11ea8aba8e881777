"""Is a plan right? Regenerates docs/results/plans.md: `make plans`, or
`PYTHONPATH=tests python tests/benchmarks/plans.py [SCENE ...]`.

Each scene is swept once, and planned for several tolerances from the sweep's own runs. The planner stops trying where
nothing can be faster; here its choice is held against the whole sweep: the error that it really has, and how much
faster the fastest configuration is that meets the tolerance. Runs are stored in out/plans, so what was interrupted goes
on where it was; other code begins anew. All scenes together take 12 times the minutes on a machine without other work,
and some more for timing short runs again and for what the planner runs beyond the sweep.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.plans_page import DEARER, SHORT, TOLERANCES, Checked, Judged, page
from rich.console import Console

from softseam.errors import SoftseamError
from softseam.view.colors import label
from softseam_studies.study.configurations import Configuration, configurations
from softseam_studies.study.errors import Error, errors, is_hardly_known, not_counted
from softseam_studies.study.levels import Watch
from softseam_studies.study.measure import Outcome, measure
from softseam_studies.study.plan import Goal, Plan
from softseam_studies.study.plan_command import REFERENCE
from softseam_studies.study.planner import NoPlan, choose, counts_to, judged, promised
from softseam_studies.study.progress import ChartProgress
from softseam_studies.study.reference import Reference, origin
from softseam_studies.study.store import Store
from softseam_studies.study.study import Study, reference_of, study_of
from softseam_studies.study.sweep import sweep
from softseam_studies.study.table import Row, core_share, rows_of, unrun

ROOT = Path(__file__).resolve().parents[2]
SCENES = (
    "tofu_grasp",
    "tofu_pads",
    "tofu_slab",
    "tofu_push",
    "tofu_drop",
    "silken_tofu",
    "cantilever",
    "sausage",
    "sausage_bend",
    "dumpling",
    "heavy_on_soft",
    "stiff_inclusion",
)
"""the suite, but for bodies of particles, which have no reference, and calamari, whose cells are its file's"""
MINUTES = 3.0
"""for a scene's sweep"""
BEYOND = 600.0
"""what runs beyond the sweep may take [s]"""
RUNS = 0
"""further runs of a configuration in the sweep: its first one, which is looked at in every step, is timed"""
AGAIN = 1
"""what is short is timed by so many further runs, brief ones by more, which nobody looks at, as a chart
times; looking costs a good part of a short run's time, and a few percent of a long one's"""


def timed(study: Study, one: Configuration, outcome: Outcome, store: Store, watch: Watch) -> Outcome:
    """A configuration's outcome; where its run was short, with the time of one that nobody looks at."""
    if outcome.status != "done" or outcome.seconds > SHORT:
        return outcome
    again = store.outcome(f"timed-{one.key}")
    if again is None:
        report = watch(f"timed again: {one.label}", (1 + AGAIN) * outcome.seconds)
        again = measure(study.name, (*study.settings, *one.settings), study.names(), runs=AGAIN, report=report)
        store.write(f"timed-{one.key}", again.as_json())
    return replace(outcome, walls=again.walls, cpu=again.cpu) if again.status == "done" else outcome


def judge(name: str, minutes: float, console: Console) -> Judged:
    """Sweep a scene, or read what was stored, and plan it for every tolerance."""
    study = study_of(name)
    folder = ROOT / "out" / "plans" / f"{name}-{study.identity.scene[:8]}-{study.identity.code[:8]}"
    store = Store(folder, study.identity, "move it away")
    names = promised(study.scene, study.names())
    levels, wanted, target = study.levels(names), configurations(study.frame), REFERENCE * min(TOLERANCES)
    with ChartProgress(console) as progress:
        best = reference_of(levels, 60.0 * minutes, progress.reference, target)
        progress.known(best)
        progress.expect(wanted, 60.0 * minutes)
        outcomes = sweep(study, wanted, store, 60.0 * minutes, progress.configuration, RUNS)
        every = {one.key: one for one in wanted}

        def run(one: Configuration, _: object = None) -> Outcome:
            """Of the sweep; what is beyond that is run now, and stored like the others."""
            every[one.key] = one
            if one.key not in outcomes:
                outcomes.update(sweep(study, [one], store, BEYOND, progress.configuration, RUNS))
            outcomes[one.key] = timed(study, one, outcomes[one.key], store, progress.reference)
            return outcomes[one.key]

        plans: list[Plan | str] = []
        for one in wanted:
            run(one)
        for tolerance in TOLERANCES:
            known = reference_of(levels, 60.0 * minutes, progress.reference, target, counts_to(tolerance))
            try:
                plans.append(choose(Goal(tolerance=tolerance), known, wanted, run, levels.runs()))
            except NoPlan as error:
                plans.append(str(error).split(": ")[0])
        every |= {one.key: one for one, _ in levels.runs()}
        outcomes |= {one.key: outcome for one, outcome in levels.runs() if one.key not in outcomes}
        checked = []
        for tolerance, plan in zip(TOLERANCES, plans, strict=True):
            known = reference_of(levels, 60.0 * minutes, progress.reference, target, counts_to(tolerance))
            checked.append(check(tolerance, plan, list(every.values()), outcomes, known))
    rows = rows_of(wanted, outcomes, best)
    return Judged(name, tuple(checked), origin(best), ran(rows), not_counted(best.truth), core_share(rows))


def ran(rows: Sequence[Row]) -> str:
    """How many configurations of a sweep were run, and whether it is incomplete."""
    n_late = unrun(rows)
    late = f", incomplete: {n_late} had no time" if n_late else ""
    return f"{sum(row.error is not None for row in rows)} of {len(rows)}{late}"


def _unsure(found: Mapping[str, Error], reference: Reference, tolerance: float) -> str:
    """What does not count fully and is farther from the reference than the tolerance, with what it is known to."""
    told = []
    for name, error in found.items():
        true = reference.truth[name]
        counts = not true.left_out or not true.has_limit or is_hardly_known(name, true.uncertainty)
        if not counts and error.differs > tolerance:
            told.append(f"{label(name)} {100 * error.differs:.2g} ({100 * true.uncertainty:.2g})")
    return ", ".join(told)


def check(
    tolerance: float,
    plan: Plan | str,
    every: Sequence[Configuration],
    outcomes: Mapping[str, Outcome],
    known: Reference,
) -> Checked:
    """Compare a plan, or why there is none, with what is true of every run."""
    goal = Goal(tolerance=tolerance)
    judgements = [judged(one, outcomes[one.key], known, goal) for one in every]
    least = max((one for one in judgements if one.within(tolerance)), key=lambda one: one.rtf, default=None)
    told = "none" if least is None else f"{least.label}, {least.rtf:.3g}"
    if isinstance(plan, str):
        return Checked(tolerance, (f"*none*: {plan}", "", "", "", "", told, "", ""))
    mine = next(one for one in judgements if one.settings == plan.choice.settings)
    key = next(one.key for one in every if one.settings == plan.choice.settings)
    ratio = 1.0 if least is None else max(1.0, least.rtf / mine.rtf)
    met = mine.within(tolerance)
    series = outcomes[key].series
    assert series is not None and mine.differs is not None
    cells = (
        mine.label,
        f"{mine.rtf:.3g}",
        f"{100 * mine.differs:.2g}{'' if met else ' **missed**'}",
        label(mine.decided_by),
        _unsure(errors(series, known.time, known.truth), known, tolerance),
        told,
        f"{ratio:.2f}" if ratio <= DEARER else f"**{ratio:.2f}**",
        str(plan.n_run),
    )
    surely = max((one.rtf for one in judgements if one.surely_within(tolerance)), default=mine.rtf)
    return Checked(tolerance, cells, True, met, met and ratio <= DEARER, met and surely <= DEARER * mine.rtf)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these; the page is then printed, not written")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="for a scene")
    given = parser.parse_args()
    console = Console(stderr=True)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    found, failed = [], []
    for name in given.scenes or SCENES:
        console.rule(name)
        try:
            found.append(judge(name, given.minutes, console))
        except SoftseamError as error:
            # the other scenes are worth their minutes; what this one has done so far is stored
            console.print(f"{name}: {error}", style="red", markup=False)
            failed.append(name)
    if failed and (given.scenes or not found):
        raise SystemExit(f"not judged: {', '.join(failed)}")
    text = page(found)
    if given.scenes:
        Console(width=200).print(text, markup=False, highlight=False, soft_wrap=True)
    else:
        (ROOT / "docs" / "results" / "plans.md").write_text(text)
    if failed:
        raise SystemExit(f"docs/results/plans.md is written without {', '.join(failed)}: see why above")


if __name__ == "__main__":
    main()
