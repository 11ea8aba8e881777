"""`softseam plan`, and what a scene's `tolerance` asks for: find a plan, or read one that was found before."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.embedded import solver_digest
from softseam.errors import BadInput, SoftseamError, require_extra
from softseam.scenes import bundle_of
from softseam.study import beside
from softseam.study.climb import Watch, climb
from softseam.study.configurations import Configuration, configurations
from softseam.study.counted import counts_to, known_to
from softseam.study.errors import uncounted
from softseam.study.foretold import Run
from softseam.study.frame import Frame, frame_of
from softseam.study.kept import Goal, Plan, Tried
from softseam.study.ladder import Ladder
from softseam.study.measure import Outcome, measure, quantity_names
from softseam.study.planner import choose
from softseam.study.progress import ChartProgress
from softseam.study.reference import Reference
from softseam.study.shipped import better_of, digest_of, shipped
from softseam.study.store import Identity, Store, cache_folder
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.facts import machine
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import bundle_scene, scene_hash
from softseam_protocol.scene.scene import Scene

MINUTES = 5.0
"""that a search may run where nobody says how long"""
RUNS = 1
"""timed runs of a configuration"""
REFERENCE_SHARE = 0.5
"""of the budget, for the reference"""
FINEST = 1e-4
"""no reference is asked to be known better than this [1]"""
SHOWN, BESIDE = 12, 3
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
    """longest that the search may run; None: what was found before will do, however long that took, else `MINUTES`"""
    fresh: bool = False
    harder: float = 1.0
    """see `Goal`"""


def plan(wishes: Wishes, console: Console) -> Plan:
    """Find the plan, or read it from the cache, and print it.

    Raises BadInput, SceneRefused, and NoPlan where nothing is accurate and fast enough.
    """
    found = find(wishes, console)
    show(found, console)
    return found


def find(wishes: Wishes, console: Console, begins: Callable[[str], None] = lambda _: None) -> Plan:
    """The plan, from the cache where it is there and as many minutes would have found no other.

    begins  is told what begins, and how long it may take, where nothing that is kept will do
    """
    require_extra("solve", "planning, which simulates in this process,")
    loaded, bundle = bundle_of(wishes.scene)
    asked = with_settings(loaded, wishes.settings)
    if not isinstance(asked.body, BodySpec):
        raise BadInput(
            f"planning compares models of a body in cells, and {asked.name!r} has a {asked.body.kind}, which only pbd "
            "moves: set models.pbd.substeps, and read the violations that a run reports"
        )
    minutes = MINUTES if wishes.minutes is None else wishes.minutes
    goal = _goal(wishes, minutes, asked)
    wishes = replace(wishes, settings=(*wishes.settings, *AS_GIVEN))
    scene = with_settings(loaded, wishes.settings)
    names = _names(scene, wishes.quantities)
    key = scene_hash(bundle_scene(scene, bundle.files))
    code, here = solver_digest(), machine()
    folder = cache_folder().with_name("plans") / f"{scene.name}-{key[:12]}-{_short(code)}-{_short(here)}"
    store = Store(folder, Identity(key, code, here), "plan anew with --fresh")
    if wishes.fresh:
        store.clear()
    name = f"plan-{_short(repr((goal, names, digest_of(scene.name))))}-{planner_digest()}"
    kept = store.read(name)
    if kept is not None:
        try:
            before = Plan.from_json(kept)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise store.refused(name, f"is corrupt ({error})") from None
        if wishes.minutes is None or before.holds_for(minutes):
            return before
    begins(
        f"planning {scene.name} for {100 * goal.tolerance:.2g} %, which may take {minutes:g} minutes and is kept in "
        f"{store.folder.parent}: `softseam plan` shows how it gets on"
    )
    found = replace(_search(wishes, minutes, scene, goal, names, code, store, console), minutes=minutes)
    try:
        store.write(name, found.as_json())
    except BadInput as error:  # what was found is not lost for that
        console.print(Text(f"the plan is not kept: {error}", style="yellow"), soft_wrap=True)
    return found


def _search(
    wishes: Wishes,
    minutes: float,
    scene: Scene,
    goal: Goal,
    names: tuple[str, ...],
    code: str,
    store: Store,
    console: Console,
) -> Plan:
    frame = frame_of(scene, wishes.scene, wishes.settings)
    wanted = configurations(frame)
    swept = {one.key for one in wanted}
    ladder = Ladder(wishes.scene, wishes.settings, frame, names)
    ladder.open(code, fresh=wishes.fresh)
    budget = 60.0 * minutes
    spent = 0.0
    with ChartProgress(console) as progress:
        share = REFERENCE_SHARE * budget
        levels = finer(ladder, frame, goal.tolerance, lambda: min(share, budget - spent), progress.reference)
        reference = next(levels)
        progress.known(reference)
        progress.expect(wanted, budget)

        def run(configuration: Configuration) -> Outcome:
            nonlocal spent
            data = store.read(configuration.key)
            if data is not None:
                return Outcome.from_json(data)
            left = budget - spent - (ladder.spent_in_all if reference.shipped else share)
            if left < configuration.seconds:
                return Outcome("left out", "give more --minutes")
            settings = (*wishes.settings, *configuration.settings)
            told = progress.configuration(configuration, (1 + RUNS) * configuration.seconds)
            outcome = measure(
                wishes.scene,
                settings,
                quantity_names(scene),
                runs=RUNS,
                limit=left,
                length=frame.length,
                told=told,
                look=1,
            )
            spent += outcome.spent
            if outcome.status != "stopped":
                if configuration.key not in swept:
                    beside.keep(store, configuration)
                store.write(configuration.key, outcome.as_json())
            return outcome

        def known() -> list[Run]:
            return [*ladder.tried(), *beside.kept(store, frame)]

        return choose(goal, reference, wanted, run, lambda: next(levels, None), known)


def planner_digest() -> str:
    """Digest of the sources that choose and judge runs: with another digest, perhaps another plan of the same runs."""
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for path in sorted(here.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:8]


def finer(
    ladder: Ladder, frame: Frame, tolerance: float, budget: Callable[[], float], watch: Watch
) -> Iterator[Reference]:
    """References for plans of a tolerance, each known better than the one before, while the budget [s] lasts: own time
    of all their levels, asked for whenever more are to be made.

    What ships comes first, before anything is run. It comes again with new levels, runs that a plan may choose, until
    what these lead to is known better.
    """
    target, n_levels, known = known_to(tolerance), 0, counts_to(tolerance)
    ships = shipped(ladder, target, known)
    if ships is not None:
        yield ships
    while True:
        try:
            reference = climb(ladder, frame, budget(), watch, target, known)
        except SoftseamError:
            if ships is None and not n_levels:
                raise
            return
        if len(reference.levels) > n_levels:
            n_levels = len(reference.levels)
            yield reference if ships is None else better_of(ships, reference)
        elif not reference.complete or target < FINEST:
            return
        target *= 0.5


def planned(wishes: Wishes, console: Console) -> tuple[str, ...]:
    """The settings with which a scene is simulated as its tolerance asks for; says on one line what they are."""
    found = find(wishes, console)
    choice = found.choice
    off = f"off by {100 * choice.error:.2g} % ({label(choice.decided_by)})"
    if not found.is_sure:
        off = f"{100 * choice.differs:.2g} % off the reference, and may be {off} with what that is"
    text = (
        f"planned for {100 * found.goal.tolerance:.2g} %: {choice.label}, which is {off} and ran at {choice.rtf:.3g} "
        f"times real time; the reference {found.truth}"
    )
    console.print(Text(text, style="dim"), soft_wrap=True)
    if found.left_out:
        console.print(Text(_left_out(found), style="yellow"), soft_wrap=True)
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
        style = "bold green" if chosen else "" if one.error <= found.goal.tolerance else "dim"
        mark = Text(("> " if chosen else "  ") + one.label, style=style)
        known = one.error < float("inf")
        error = f"{100 * one.error:.2g} %" if known else ""
        rtf = f"{one.rtf:.3g}" if one.rtf > 0.0 else ""
        table.add_row(mark, rtf, error, label(one.decided_by) if known else one.decided_by)
    console.print(table)
    choice = found.choice
    text = (
        f"{choice.label} is accurate to {100 * found.goal.tolerance:.2g} % and the fastest of {found.n_run} run that "
        f"is: its worst error is {100 * choice.error:.2g} % ({label(choice.decided_by)}); the reference {found.truth}"
    )
    if not found.is_sure:
        surely = max(
            (one for one in found.tried if one.error <= found.goal.tolerance), key=lambda one: one.rtf, default=None
        )
        dearer = "nothing that was tried surely is"
        if surely is not None:
            dearer = f"{surely.label} surely is, and takes {choice.rtf / surely.rtf:.2g} times as long"
        text = (
            f"{choice.label} is {100 * choice.differs:.2g} % off the reference, within "
            f"{100 * found.goal.tolerance:.2g} %, and the fastest of {found.n_run} run that is. The reference "
            f"{found.truth}, with which it may be {100 * choice.error:.2g} % off ({label(choice.decided_by)}); {dearer}"
        )
    console.print(Text(text), soft_wrap=True)
    late = [f"{found.n_late} had no time"] if found.n_late else []
    late += ["the reference is not known as well as it was wanted to be"] if found.vague else []
    if late:
        text = f"{', '.join(late)}: more --minutes may find a faster one{'' if found.is_sure else ', or a surer one'}"
        console.print(Text(text, style="yellow"), soft_wrap=True)
    if found.left_out:
        console.print(Text(_left_out(found), style="yellow"), soft_wrap=True)
    console.print(Text(" ".join(f"--set '{setting}'" for setting in choice.settings), style="dim"), soft_wrap=True)


def _left_out(found: Plan) -> str:
    return f"not counted, or by what it is off by at least: {uncounted(found.left_out)}"


def listed(found: Plan) -> list[Tried | int]:
    """What to show of what was tried, fastest first: the fastest, the choice and what is next to it; a number is how
    many are left out there."""
    ranked = sorted(found.tried, key=lambda one: -one.rtf)
    at = ranked.index(found.choice)
    near = range(at - BESIDE, at + BESIDE + 1)
    fastest = range(SHOWN) if min(near.stop, len(ranked)) <= SHOWN else range(SHOWN - len(near))
    shown = [i for i in range(len(ranked)) if i in fastest or i in near]
    rows: list[Tried | int] = []
    for i, before in zip(shown, [-1, *shown], strict=False):
        rows += [i - before - 1, ranked[i]] if i > before + 1 else [ranked[i]]
    rest = len(ranked) - 1 - shown[-1]
    return [*rows, rest] if rest else rows


def _goal(wishes: Wishes, minutes: float, scene: Scene) -> Goal:
    tolerance = scene.tolerance if wishes.tolerance is None else wishes.tolerance
    if tolerance is None:
        raise BadInput("say how accurate it has to be: --tolerance 0.05 allows every quantity to be 5 % off")
    if not 0.0 < tolerance < 1.0:
        raise BadInput(f"--tolerance {tolerance:g}: give a number between 0 and 1, e.g. 0.05 for 5 %")
    kept = 0.0 if scene.budget is None else scene.budget.rtf
    rtf = kept if wishes.rtf is None else wishes.rtf
    if not 0.0 <= rtf < 1e9:
        raise BadInput(f"--rtf {rtf:g}: give a number above zero, e.g. 20 for twenty times real time")
    if not 0.0 < minutes < 1e5:
        raise BadInput(f"--minutes {minutes:g}: give a number above zero")
    return Goal(tolerance, rtf, wishes.harder)


def _names(scene: Scene, wanted: Sequence[str]) -> tuple[str, ...]:
    """The quantities that count: those asked for, or all that the scene has."""
    there = quantity_names(scene)
    for name in wanted:
        if name not in there:
            raise BadInput(f"--quantity {name}: the scene {scene.name!r} observes {', '.join(there)}")
    return tuple(wanted) or there


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]
