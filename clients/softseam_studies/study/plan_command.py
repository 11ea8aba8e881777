"""`softseam plan`, and what a scene's `tolerance` asks for: find a plan, or read one that was found before."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from pydantic import ValidationError
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam import columns, duration
from softseam.embedded import compile_clock, compile_models
from softseam.errors import BadInput
from softseam.scenes import bundle_of
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.models import MODELS
from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.bundled import digest_of
from softseam_studies.study.configurations import Configuration, configurations
from softseam_studies.study.errors import uncounted
from softseam_studies.study.measure import Clock, Deadline, Outcome, measure, quantity_names
from softseam_studies.study.plan import Goal, Plan, Tried
from softseam_studies.study.planner import choose, counts_to, prescribed, promised, too_vague
from softseam_studies.study.progress import ChartProgress
from softseam_studies.study.store import Store, cache_folder
from softseam_studies.study.study import Study, reference_of, study_of

STARTING = 4.0
"""that the program may take before a search begins, and after it, on a busy machine [s]"""
MINUTES, MINUTES_OF_MESH = 1.0, 3.0
"""that a search may run where nobody says how long, of a block or particles, and of a mesh"""
RUNS = 1
"""further runs of a configuration that is accurate enough, for its time"""
REFERENCE_SHARE = 0.6
"""of the budget, for the reference"""
REFERENCE = 0.25
"""cells and steps may each leave a reference this share of the tolerance uncertain [1]"""
SHOWN, AROUND = 12, 3
"""rows of a plan's table; and of them before the choice, and after it, where it is not among the fastest"""


@dataclass(frozen=True)
class Wishes:
    """What `softseam plan` was asked for; a tolerance or a speed that is None is the scene's."""

    scene: str | Path | Scene
    settings: tuple[str, ...] = ()
    tolerance: float | None = None
    rtf: float | None = None
    quantities: tuple[str, ...] = ()
    minutes: float | None = None
    """longest that the search may run; None: what was found before will do, or else a usual time"""
    fresh: bool = False
    load_factor: float = 1.0
    """see `Goal`"""


def plan(wishes: Wishes, console: Console, began: float | None = None) -> Plan:
    """Find the plan, or read it from the cache, and print it.

    began  when its minutes began, on the clock of perf_counter [s]; None: now

    Raises BadInput, SceneRefused, and NoPlan where nothing is accurate and fast enough.
    """
    found = find(wishes, console, began=began)
    show(found, console)
    return found


def find(
    wishes: Wishes, console: Console, begins: Callable[[str], None] = lambda _: None, began: float | None = None
) -> Plan:
    """The plan, from the cache where it is there and as many minutes would have found no other.

    begins  hears what begins, and how long it may take, where nothing that is stored will do
    began   as of `plan`
    """
    began, goal = perf_counter() if began is None else began, _goal(wishes)
    with compile_clock() as compiled:  # which loads the solvers
        return _found(wishes, goal, console, begins, compiled, began)


def _found(
    wishes: Wishes, goal: Goal, console: Console, begins: Callable[[str], None], compiled: Clock, began: float
) -> Plan:
    began += _compiled(wishes)  # apart from the minutes: no run can begin before
    study = study_of(wishes.scene, wishes.settings)
    is_mesh = study.frame.body.has_cells and block_of(study.frame.body) is None
    usual = MINUTES_OF_MESH if is_mesh else MINUTES
    minutes = usual if wishes.minutes is None else wishes.minutes
    names = promised(study.scene, study.names(wishes.quantities))
    store = Store(
        cache_folder().with_name("plans") / f"{study.scene.name}-{study.identity.folder}",
        study.identity,
        "plan anew with --fresh",
    )
    if wishes.fresh:
        store.clear()
    asked = hashlib.sha256(repr((goal, names, digest_of(study.scene.name), planner_digest())).encode()).hexdigest()
    name = f"plan-{asked[:16]}"
    stored = store.read(name)
    if stored is not None:
        try:
            before = Plan.model_validate(stored)
        except ValidationError as error:
            raise store.refused(name, f"is corrupt ({error.errors()[0]['msg']})") from None
        if wishes.minutes is None or before.holds_for(minutes):
            return before
    begins(
        f"planning {study.scene.name} for {100 * goal.tolerance:.2g} %, which may take {minutes:g} min and is "
        f"stored in {store.folder.parent}: `softseam plan` shows how it gets on"
    )
    deadline = Deadline(60.0 * minutes - STARTING - (perf_counter() - began), compiled)
    found = search(study, goal, names, store, minutes, console, deadline, fresh=wishes.fresh)
    given = {name: why for name, why in prescribed(study.scene).items() if name in study.names(wishes.quantities)}
    found = found.model_copy(update={"left_out": found.left_out | given})
    try:
        store.write(name, found.model_dump(mode="json"))
    except BadInput as error:  # what was found is not lost for that
        console.print(Text(f"the plan is not stored: {error}", style="yellow"), soft_wrap=True)
    return found


def _compiled(wishes: Wishes) -> float:
    """Compile the models that a plan chooses from; returns how long that took [s]."""
    scene, _ = bundle_of(wishes.scene)
    began = perf_counter()
    if "cells" in scene.kinds:
        compile_models(MODELS)
    return perf_counter() - began


def search(
    study: Study,
    goal: Goal,
    names: tuple[str, ...],
    store: Store,
    minutes: float,
    console: Console,
    deadline: Deadline,
    *,
    fresh: bool = False,
) -> Plan:
    """Find the plan by runs, each stored as soon as it is done; at the deadline all end."""
    levels = study.levels(names, fresh=fresh)
    wanted = configurations(study.frame)
    budget, first = 60.0 * minutes, True
    levels.deadline = deadline.before((1.0 - REFERENCE_SHARE) * budget)
    with ChartProgress(console) as progress:
        share, target = REFERENCE_SHARE * budget, REFERENCE * goal.tolerance
        reference = reference_of(levels, share, progress.reference, target, counts_to(goal.tolerance))
        if too_vague(reference, goal.tolerance):  # levels are runs that may be chosen, too
            levels.deadline = deadline
            reference = reference_of(levels, budget, progress.reference, target, counts_to(goal.tolerance))
        progress.known(reference)
        progress.expect(wanted, budget)

        def run(one: Configuration, worth: Callable[[Outcome], bool]) -> Outcome:
            nonlocal first
            found = store.outcome(one.key)
            if found is not None:
                return found
            if not first and not deadline.fits(one.seconds):
                return Outcome("left out", "give more --minutes")
            first = False
            found = measure(
                study.name,
                (*study.settings, *one.settings),
                quantity_names(study.scene),
                runs=RUNS,
                limit=budget,
                left=deadline.left,
                length=study.frame.length,
                report=progress.configuration(one, one.seconds),
                look=1,
                worth=worth,
            )
            deadline.learn(found)
            if found.status != "stopped":
                store.write(one.key, found.as_json())
            return found

        found = choose(goal, reference, wanted, run, levels.runs())
    return found.model_copy(update={"minutes": minutes})


def planner_digest() -> str:
    """Digest of the sources that choose and judge runs: with another digest, perhaps another plan of the same runs."""
    digest = hashlib.sha256()
    shared = (Path(file) for file in (columns.__file__, duration.__file__))
    for path in (*sorted(Path(__file__).parent.glob("*.py")), *shared):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:8]


def planned(wishes: Wishes, console: Console) -> tuple[str, ...]:
    """The settings with which a scene is simulated as its tolerance asks for; says on one line what they are."""
    found = find(wishes, console)
    choice = found.choice
    off = f"off by {_percent(choice.error)} ({label(choice.decided_by)})"
    if not found.is_sure:
        off = f"{_percent(choice.differs)} off the reference, and may be {off} with what that is"
    text = (
        f"planned for {100 * found.goal.tolerance:.2g} %: {choice.label}, which is {off} and ran at {choice.rtf:.3g} "
        f"times real time; the reference {found.truth}"
    )
    console.print(Text(text, style="dim"), soft_wrap=True)
    _tell_left_out(found, console)
    return settings_of(found)


def settings_of(found: Plan) -> tuple[str, ...]:
    """The settings that a plan consists of."""
    return (*AS_GIVEN, *found.choice.settings)


def show(found: Plan, console: Console) -> None:
    """What was chosen, and what else was tried: the fastest ones, what is next to the choice, and what is wrong with
    them."""
    table = Table(box=None, padding=(0, 2))
    for name in ("", "real-time factor", "error", "decided by"):
        table.add_column(name, justify="right" if name in ("real-time factor", "error") else "left")
    for one in listed(found):
        if isinstance(one, int):
            table.add_row(Text(f"  … {one} more", style="dim"))
            continue
        chosen = one is found.choice
        style = "bold green" if chosen else "" if one.surely_within(found.goal.tolerance) else "dim"
        mark = Text(("> " if chosen else "  ") + one.label, style=style)
        rtf = f"{one.rtf:.3g}" if one.rtf > 0.0 else ""
        known = one.error is not None
        table.add_row(mark, rtf, _percent(one.error), label(one.decided_by) if known else one.decided_by)
    console.print(table)
    choice, tolerance = found.choice, f"{100 * found.goal.tolerance:.2g} %"
    text = (
        f"{choice.label} is accurate to {tolerance} and the fastest of {found.n_run} run that is: its worst error is "
        f"{_percent(choice.error)} ({label(choice.decided_by)}); the reference {found.truth}"
    )
    if not found.is_sure:
        surely = [one for one in found.tried if one.surely_within(found.goal.tolerance)]
        dearer = "nothing that was tried surely is"
        if surely:
            fastest = max(surely, key=lambda one: one.rtf)
            dearer = f"{fastest.label} surely is, and takes {choice.rtf / fastest.rtf:.2g} times as long"
        text = (
            f"{choice.label} is {_percent(choice.differs)} off the reference, within {tolerance}, and the fastest of "
            f"{found.n_run} run that is. The reference {found.truth}, with which it may be {_percent(choice.error)} "
            f"off ({label(choice.decided_by)}); {dearer}"
        )
    console.print(Text(text), soft_wrap=True)
    if found.n_late:
        text = f"{found.n_late} had no time: more --minutes may find a faster one"
        console.print(Text(text, style="yellow"), soft_wrap=True)
    _tell_left_out(found, console)
    console.print(Text(" ".join(f"--set '{setting}'" for setting in choice.settings), style="dim"), soft_wrap=True)


def listed(found: Plan) -> list[Tried | int]:
    """What to show of what was tried, fastest first: the fastest, the choice and what is next to it; a number is how
    many are left out there."""
    ranked = sorted(found.tried, key=lambda one: -one.rtf)
    at = ranked.index(found.choice)
    near = range(at - AROUND, at + AROUND + 1)
    fastest = range(SHOWN if min(near.stop, len(ranked)) <= SHOWN else SHOWN - len(near))
    rows: list[Tried | int] = []
    for i, one in enumerate(ranked):
        if i in fastest or i in near:
            rows.append(one)
        elif rows and isinstance(rows[-1], int):
            rows[-1] += 1
        else:
            rows.append(1)
    return rows


def _tell_left_out(found: Plan, console: Console) -> None:
    if found.left_out:
        text = f"not counted, or by what it is off by at least: {uncounted(found.left_out)}"
        console.print(Text(text, style="yellow"), soft_wrap=True)


def _goal(wishes: Wishes) -> Goal:
    scene = with_settings(bundle_of(wishes.scene)[0], wishes.settings)
    tolerance = scene.tolerance if wishes.tolerance is None else wishes.tolerance
    if tolerance is None:
        raise BadInput("say how accurate it has to be: --tolerance 0.05 allows every quantity to be 5 % off")
    if not 0.0 < tolerance < 1.0:
        raise BadInput(f"--tolerance {tolerance:g}: give a number between 0 and 1, e.g. 0.05 for 5 %")
    budget = 0.0 if scene.budget is None else scene.budget.rtf
    rtf = budget if wishes.rtf is None else wishes.rtf
    if not 0.0 <= rtf < 1e9:
        raise BadInput(f"--rtf {rtf:g}: give a number above zero, e.g. 20 for twenty times real time")
    if wishes.minutes is not None and not 0.0 < wishes.minutes < 1e5:
        raise BadInput(f"--minutes {wishes.minutes:g}: give a number above zero")
    return Goal(tolerance=tolerance, rtf=rtf, load_factor=wishes.load_factor)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.2g} %"
