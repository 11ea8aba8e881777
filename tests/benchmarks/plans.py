"""Is a plan right? Regenerates docs/results/plans.md: `make plans`, or
`PYTHONPATH=tests python tests/benchmarks/plans.py [SCENE ...]`.

Each scene is swept once, and planned for several tolerances from the sweep's own runs. The planner stops refining its
reference where a tolerance lets it, and stops trying where nothing can be faster; here its choice is held against the
best reference and the whole sweep: the error that it really has, and how much faster the fastest configuration is that
meets the tolerance. Levels of references and runs are kept (in the cache, and in out/plans), so what was interrupted
goes on where it was, and a scene that was done with as many minutes costs nothing; other code begins anew. All scenes
together take 12 times the minutes, and half as much more where nothing in the sweep is accurate enough, on a machine
without other work: 54 minutes, and some ten for timing short runs again; and what runs foretell to be accurate enough
is run for as long as it takes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType

from benchmarks.plans_page import DEARER, SHORT, TOLERANCES, Checked, Judged, page
from rich.console import Console

from softseam.embedded import solver_digest
from softseam.errors import SoftseamError
from softseam.scenes import bundle_of
from softseam.study import beside as beside_sweep
from softseam.study.climb import Watch, climb
from softseam.study.configurations import Configuration, configurations
from softseam.study.counted import counting, counts_to, known_to, looser
from softseam.study.errors import Error, is_hardly_known, not_counted, sure
from softseam.study.foretold import Run
from softseam.study.frame import frame_of
from softseam.study.kept import Goal
from softseam.study.ladder import Ladder
from softseam.study.measure import Outcome, Told, measure, quantity_names
from softseam.study.plan_command import finer, planner_digest
from softseam.study.planner import Measure, NoPlan, choose, judged
from softseam.study.progress import ChartProgress
from softseam.study.reference import Reference, origin
from softseam.study.shipped import digest_of, shipped
from softseam.study.store import Identity, Store
from softseam.study.sweep import sweep
from softseam.study.table import Row, core_share, rows_of, unrun
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.facts import machine
from softseam_protocol.scene.file import bundle_scene, scene_hash

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
"""for a scene: half for the reference where none ships, the rest for the sweep"""
FORETOLD = 2400.0
"""a quarter of it is what a run beside the sweep may be foreseen to take; it is given three times that [s]"""
RUNS = 0
"""further runs of a configuration in the sweep: its first one, which is looked at in every step, is timed"""
AGAIN = 1
"""what is short is timed by so many further runs, brief ones by more, which nobody looks at, as a chart
times; looking costs a good part of a short run's time, and a few percent of a long one's"""


def _silent(text: str, seconds: float) -> Told:
    return lambda done: None


def timed(
    name: str, names: tuple[str, ...], one: Configuration, outcome: Outcome, store: Store, watch: Watch
) -> Outcome:
    """A configuration's outcome; where its run was short, with the time of one that nobody looks at."""
    if outcome.status != "done" or outcome.seconds > SHORT:
        return outcome
    kept = store.read(f"timed-{one.key}")
    if kept is None:
        told = watch(f"timed again: {one.label}", (1 + AGAIN) * outcome.seconds)
        kept = measure(name, (*AS_GIVEN, *one.settings), names, runs=AGAIN, told=told).as_json()
        store.write(f"timed-{one.key}", kept)
    again = Outcome.from_json(kept)
    return replace(outcome, walls=again.walls, cpu=again.cpu) if again.status == "done" else outcome


def judge(name: str, minutes: float, console: Console) -> Judged:
    """Sweep a scene, or read what was kept, and plan it for every tolerance."""
    loaded, bundle = bundle_of(name)
    scene = with_settings(loaded, AS_GIVEN)
    frame, names, code = frame_of(scene, name, AS_GIVEN), quantity_names(scene), solver_digest()
    key = scene_hash(bundle_scene(scene, bundle.files))
    folder = ROOT / "out" / "plans" / f"{name}-{key[:8]}-{code[:8]}"
    store = Store(folder, Identity(key, code, machine()), "move it away")
    ours = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:8]
    done = f"judged-{minutes:g}-{planner_digest()}-{ours}-{digest_of(name)}"
    kept = store.read(done)
    if kept is not None:
        return Judged.from_json(kept)
    ladder = Ladder(name, AS_GIVEN, frame, names)
    ladder.open(code, fresh=False)
    wanted, half, finest = configurations(frame), 30.0 * minutes, known_to(min(TOLERANCES))
    with ChartProgress(console) as progress:
        best = shipped(ladder, finest) or climb(ladder, frame, half, progress.reference, finest)
        progress.known(best)
        rest = 2.0 * half if best.shipped else half
        progress.expect(wanted, rest)

        def swept(these: Sequence[Configuration], budget: float) -> dict[str, Outcome]:
            once = sweep(name, AS_GIVEN, frame, names, these, store, budget, progress.configuration, RUNS)
            return {one.key: timed(name, names, one, once[one.key], store, progress.reference) for one in these}

        outcomes = swept(wanted, rest)
        # what another version's planner had run may be the fastest; today's has to foretell it anew
        earlier = {one.key: one for one, _ in beside_sweep.kept(store, frame) if one.key not in outcomes}
        outcomes.update(swept(list(earlier.values()), FORETOLD))
        of_sweep, beside = {one.key for one in wanted}, dict[str, Configuration]()

        def measured(one: Configuration) -> Outcome:
            """Of the sweep; what is foretold only is run now, and kept like the others."""
            if one.key not in of_sweep:
                beside[one.key] = one
                if one.key not in outcomes:
                    beside_sweep.keep(store, one)
                    outcomes.update(swept([one], FORETOLD))
            return outcomes[one.key]

        def planned(tolerance: float) -> Checked:
            # as the planner would, no finer than the tolerance asks for: from what is in the cache, but where the
            # reference ships, whose levels are not there
            levels = finer(ladder, frame, tolerance, lambda: half if best.shipped else 1e-3, progress.reference)
            # a plan of 20 % counts quantities that one of 2 % knows too little of
            known = counts_to(tolerance)
            true = shipped(ladder, finest, known) or climb(ladder, frame, 1e-3, _silent, finest, known)
            held_against = counting(true, tolerance)
            return check(tolerance, levels, wanted, outcomes, held_against, ladder, measured, beside, earlier)

        plans, n_beside = [planned(tolerance) for tolerance in TOLERANCES], 0
        while len(beside) > n_beside:
            # from, and held against, what was run beside the sweep for other tolerances, too
            n_beside = len(beside)
            plans = [planned(tolerance) for tolerance in TOLERANCES]
    rows = rows_of(wanted, outcomes, best)
    found = Judged(
        name,
        tuple(plans),
        origin(best),
        ran(rows),
        not_counted(best.truth),
        core_share(rows),
    )
    store.write(done, asdict(found))
    return found


def ran(rows: Sequence[Row]) -> str:
    """How many configurations of a sweep were run, and whether it is incomplete."""
    n_late = unrun(rows)
    late = f", incomplete: {n_late} had no time" if n_late else ""
    return f"{sum(row.error is not None for row in rows)} of {len(rows)}{late}"


def _surely(row: Row, reference: Reference, tolerance: float) -> Row:
    """The row, judged also by what is known too little to count: by what that is off by at least, or by what it
    differs by where that is more than it is held to."""
    least = sure(row.errors, reference.truth)
    held = looser(reference, tolerance)
    least |= {name: row.errors[name].differs for name, bound in held.items() if row.errors[name].differs > bound}
    name = max(least, key=lambda name: least[name], default=None)
    if name is None or row.error is None or least[name] <= row.error.value:
        return row
    error = Error(least[name], False, least[name])
    return replace(row, errors=dict(row.errors) | {name: error}, error=error)


def _sign(worst: str, row: Row, reference: Reference, tolerance: float) -> str:
    """What stands before an error that is no distance: a bound from above, or one from below."""
    assert row.error is not None
    if row.error.bound:
        return "<= "
    return ">= " if worst not in reference.counted and worst not in looser(reference, tolerance) else ""


def _unsure(row: Row, reference: Reference, tolerance: float) -> str:
    """What does not count fully and is farther from the reference than the tolerance, with what it is known to."""
    told = []
    for name, error in row.errors.items():
        true = reference.truth[name]
        counts = not true.left_out or not true.has_limit or is_hardly_known(name, true.uncertainty)
        if not counts and error.differs > tolerance:
            told.append(f"{label(name)} {100 * error.differs:.2g} ({100 * true.uncertainty:.2g})")
    return ", ".join(told)


def check(
    tolerance: float,
    levels: Iterator[Reference],
    wanted: Sequence[Configuration],
    outcomes: Mapping[str, Outcome],
    known: Reference,
    ladder: Ladder,
    run: Measure,
    beside: Mapping[str, Configuration],
    earlier: Mapping[str, Configuration] = MappingProxyType({}),
) -> Checked:
    """Plan from the kept outcomes, and compare the choice with what is true of every run, beside the sweep too, and
    also of those that are kept from an earlier judgement."""
    tried: set[str] = set()

    def measured(configuration: Configuration) -> Outcome:
        outcome = run(configuration)
        if outcome.status in ("done", "failed"):
            tried.add(configuration.key)
        return outcome

    def at_hand() -> list[Run]:
        return [*ladder.tried(), *((one, outcomes[one.key]) for one in beside.values() if one.key in outcomes)]

    plan, why = None, ""
    try:
        plan = choose(Goal(tolerance), next(levels), wanted, measured, lambda: next(levels, None), at_hand)
    except NoPlan as error:
        why = str(error).split(": ")[0]
    # a level of the ladder is a run that a plan may choose, like those of the sweep, and so is what runs foretell
    every = (
        dict(earlier) | {one.key: one for one in wanted} | dict(beside) | {one.key: one for one, _ in ladder.tried()}
    )
    ended = dict(outcomes) | {one.key: outcome for one, outcome in ladder.tried()}
    rows = rows_of(list(every.values()), ended, known)
    truth = {row.configuration.settings: _surely(row, known, tolerance) for row in rows if row.error is not None}
    able = [row for row in truth.values() if row.error is not None and row.error.value <= tolerance]
    least = max(able, key=lambda row: row.outcome.rtf, default=None)
    told = "none" if least is None else f"{least.configuration.label}, {least.outcome.rtf:.3g}"
    if plan is None:
        return Checked(tolerance, (f"*none*: {why}", "", "", "", "", told, "", str(len(tried))))
    row = truth[plan.choice.settings]
    assert row.error is not None
    ratio = 1.0 if least is None else max(1.0, least.outcome.rtf / row.outcome.rtf)
    worst = next(name for name, error in row.errors.items() if error == row.error)
    met = row.error.value <= tolerance
    cells = (
        row.configuration.label,
        f"{row.outcome.rtf:.3g}",
        f"{_sign(worst, row, known, tolerance)}{100 * row.error.value:.2g}{'' if met else ' **missed**'}",
        label(worst),
        _unsure(row, known, tolerance),
        told,
        f"{ratio:.2f}" if ratio <= DEARER else f"**{ratio:.2f}**",
        str(len(tried)),
    )
    # what the planner asks of a run, asked of all of them
    demanded = (judged(one, ended[one.key], known, tolerance=tolerance) for one in every.values() if one.key in ended)
    fastest = max((one.rtf for one in demanded if one.error <= tolerance), default=row.outcome.rtf)
    return Checked(tolerance, cells, True, met, met and ratio <= DEARER, met and fastest <= DEARER * row.outcome.rtf)


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
            # the other scenes are worth their minutes; what this one has done so far is kept
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
