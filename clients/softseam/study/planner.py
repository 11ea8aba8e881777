"""Chooses how to simulate a scene: the fastest of the chart's configurations that is accurate enough.

Nothing is guessed. The reference ships with the scene (the chart's shipped.py), or is FEM alone, refined here until it
is known to a fraction of the tolerance (climb.py); the configurations are tried cheapest first, each once, until those
left cannot be faster than the best one found. Cells with shorter steps than the chart's are tried where runs so far
foretell that they are accurate enough (foretold.py), and then finer ones (refined.py). What counts as an error is what
a run differs from the reference by, and what the reference may be off by, as errors that know nothing of each other add
up: e* = sqrt(e^2 + u^2). To be sure of that may cost `CERTAIN` times what the fastest run costs whose e alone is small
enough; where it would cost more, that one is chosen, and the plan says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from softseam.errors import SoftseamError
from softseam.study.configurations import Configuration, Fem
from softseam.study.counted import VAGUEST, WORST_REFERENCE, counting, counts_to, looser
from softseam.study.errors import KNOWN, Error, errors, sure
from softseam.study.foretold import Run, foretold
from softseam.study.kept import Goal, Plan, Tried
from softseam.study.measure import Outcome
from softseam.study.reference import Reference, in_words, origin
from softseam.study.refined import refined
from softseam.study.sweep import learn

HOPE = 1.5
"""a configuration is tried while its foreseen wall time is below this many times the best one's [1]"""

CERTAIN = 1.5
"""a run that is accurate enough with all that the reference may be off by may cost this many times one that is so by
what is known [1]"""
REACH = 3.0
"""the reference is refined while a quantity that does not count is known this many times too little [1]"""
FASTER = 1.2
"""the reference is refined while a run this many times as fast as the best one may be accurate enough [1]"""


MISLED = 3
"""so many runs that fail or are far less accurate than was foretold end the trying: errors of cells and steps meddle"""
FAR = 1.25
"""times the error that was foretold: what is nearer is just not accurate enough, and something a little finer is [1]"""
NEARLY = 1.15
"""times the tolerance: what is foretold to miss it by no more is tried, too, until `MISLED` of these did miss it [1]"""
FAR_DEARER = 3.0
"""where what is foretold to meet it, if anything, takes so many times as long [1]"""
Measure = Callable[[Configuration], Outcome]


class NoPlan(SoftseamError):
    """Nothing that was tried is accurate enough and fast enough."""


class TooSlow(NoPlan):
    """Some are accurate enough, and none of these is fast enough: to know more of the truth is of no use."""


def choose(
    goal: Goal,
    reference: Reference,
    wanted: Sequence[Configuration],
    measure: Measure,
    refine: Callable[[], Reference | None] = lambda: None,
    known: Callable[[], Iterable[Run]] = tuple,
) -> Plan:
    """The fastest configuration that is accurate enough.

    Where a faster one, or any at all, is neither accurate enough nor too far off for all that is known of the truth,
    or where a quantity does not count that nearly does, the reference is refined and every run is judged anew. One that
    ships is more than a plan's minutes can refine, and is taken as it is where there is a plan.

    measure  called at most once for each configuration, but again for what it left out
    refine   a reference that is known better than the last, or None where there is none
    known    the reference's levels so far, and what was run for other tolerances: like others where not wanted anyway

    Raises NoPlan where none is accurate enough, or none of those fast enough; its text names the nearest.
    """
    every = {one.key: one for one in wanted}
    timed = set(every)  # by runs of their own: a level's, which is its first, takes longer
    kept: dict[str, Outcome] = {}
    instead: dict[str, Outcome] = {}  # of runs that did not end

    def once(configuration: Configuration) -> Outcome:
        key = configuration.key
        if key not in kept or kept[key].status == "left out":
            kept[key] = measure(configuration)
            if kept[key].status != "left out":
                # what was foretold and run is a run like others, whatever another reference foretells
                every.setdefault(key, configuration)
                timed.add(key)
        found = kept[key]
        return found if found.status == "done" else instead.get(configuration.key, found)

    while True:
        reference = counting(reference, goal.tolerance)
        plan, why = None, None
        for one, outcome in known():
            if one.key in timed:
                instead[one.key] = outcome
            else:
                every[one.key], kept[one.key] = one, outcome
        try:
            plan = _fastest(goal, reference, list(every.values()), once, kept)
        except NoPlan as error:
            why = error
        slow = isinstance(why, TooSlow)
        least = goal.rtf if plan is None else FASTER * plan.choice.rtf
        open_ones = (one for one in kept.values() if one.rtf > least and _undecided(one, reference, goal))
        vague = reference.uncertainty > WORST_REFERENCE * goal.tolerance or _in_reach(reference, goal.tolerance)
        vague = vague or not (plan is None or plan.is_sure)
        wanting = not reference.shipped and (vague or any(open_ones))
        better = refine() if (plan is None and not slow) or wanting else None
        if better is not None:
            reference = better
        elif plan is None:
            assert why is not None
            raise why
        else:
            return replace(plan, vague=wanting)


class _Search:
    """What was run against one reference, and the fastest of it that is accurate enough."""

    def __init__(self, goal: Goal, reference: Reference, measure: Measure) -> None:
        self._goal, self._reference, self._measure = goal, reference, measure
        self._pace: dict[str, float] = {}
        self._took: dict[str, list[tuple[float, float]]] = {}
        """by cells of FEM: steps, and what runs with them took [s]"""
        self.runs: dict[str, Run] = {}
        self.tried: list[Tried] = []
        self.best: Tried | None = None
        self.likely: Tried | None = None
        """the fastest that is accurate enough, whatever the reference may be off by"""
        self._winner: Configuration | None = None
        self.late: Configuration | None = None
        """the cheapest of what is foretold to be accurate enough, and was given no time"""
        self._best_seconds = self._likely_seconds = float("inf")

    def attempt(self, wanted: Sequence[Configuration], kept: Mapping[str, Outcome]) -> None:
        """Run those that may be the fastest, cheapest first; of those that are kept it is known what they take."""
        for one in sorted(wanted, key=lambda c: (c.seconds, c.key)):
            ran, seconds = kept.get(one.key), self._foreseen(one)
            if self._may_be_fastest(ran.seconds if ran is not None and ran.status == "done" else seconds):
                learn(self._pace, one, self._run(one))

    def _foreseen(self, one: Configuration) -> float:
        """Wall time of what was not run [s]: as its method's pace says, or no more than as many steps take of longer
        ones on the same cells."""
        paced = one.seconds * self._pace.get(one.method, 1.0)
        if one.fem is None:
            return paced
        took = self._took.get(one.fem.cells, ())
        return min([paced, *(seconds * step / one.fem.step for step, seconds in took if step >= one.fem.step)])

    def attempt_foretold(self) -> None:
        """Run what is foretold to be accurate enough and may be the fastest, cheapest first; each run tells more.

        First cells that were run, with shorter steps; then finer cells, too. As long as none of these does, what is
        foretold to be nearly accurate enough, as it may be off either way: the nearest first, where there is nothing
        better or that is far dearer.
        """
        misled = self._attempt_told(foretold)
        given_up = {one.key for one, _ in foretold(list(self.runs.values()))} if misled else set()
        self._attempt_told(
            lambda runs: (run for run in _told(runs, self._reference) if run[0].key not in given_up), NEARLY
        )

    def _attempt_told(self, tell: Callable[[Sequence[Run]], Iterable[Run]], nearly: float = 1.0) -> bool:
        """Run what is told to be accurate enough, or nearly so; whether that was given up since it misled."""
        misled = missed = 0
        while misled < MISLED:
            told = [run for run in tell(list(self.runs.values())) if self._is_new(run[0])]
            hoped = {one.key: self._judged(one, outcome) for one, outcome in told}
            good = [one for one, _ in told if self._is_worth(one, hoped[one.key])]
            one = min(good, key=lambda c: (c.seconds, c.key), default=None)
            if self.best is None and missed < MISLED:
                bar, dear = nearly * self._goal.tolerance, np.inf if one is None else one.seconds / FAR_DEARER
                near = (c for c, _ in told if c.seconds <= dear and self._may_be_fastest(c.seconds))
                near = (c for c in near if hoped[c.key].error <= bar)
                one = min(near, key=lambda c: (hoped[c.key].error, c.key), default=one)
            if one is None or not self._may_be_fastest(one.seconds):
                return False
            hope, is_good = hoped[one.key], one in good
            outcome = self._run(one)
            if outcome.was_late and is_good:
                self.late = self.late or one
            done, surely = outcome.status == "done", hope.error <= self._goal.tolerance
            error, hoped_for = (
                (self.tried[-1].error, hope.error) if surely or not is_good else (self.tried[-1].differs, hope.differs)
            )
            misled += outcome.status == "failed" or (done and error > max(self._goal.tolerance, FAR * hoped_for))
            missed += not is_good and not (done and error <= self._goal.tolerance)
        return True

    def _is_worth(self, one: Configuration, hope: Tried) -> bool:
        """Whether a run is foretold to be accurate enough: surely, or by its distance alone and then the plan."""
        if hope.error <= self._goal.tolerance:
            return True
        first = self.likely is None or one.seconds < self._likely_seconds
        cheaper = self.best is None or CERTAIN * one.seconds < self._best_seconds
        return hope.differs <= self._goal.tolerance and first and cheaper

    def _is_new(self, one: Configuration) -> bool:
        """Whether it was not run, and is not the best one on finer cells or with shorter steps: these take longer."""
        return one.key not in self.runs and (self._winner is None or not _is_finer(one.fem, self._winner.fem))

    def _may_be_fastest(self, seconds: float) -> bool:
        return seconds <= HOPE * min(self._best_seconds, CERTAIN * self._likely_seconds)

    def _run(self, one: Configuration) -> Outcome:
        outcome = self._measure(one)
        self.runs[one.key] = one, outcome
        if one.fem is not None and outcome.status == "done":
            self._took.setdefault(one.fem.cells, []).append((one.fem.step, outcome.seconds))
        found = self._judged(one, outcome)
        self.tried.append(found)
        if found.error <= self._goal.tolerance and (self.best is None or found.rtf > self.best.rtf):
            self.best, self._winner, self._best_seconds = found, one, outcome.seconds
        if found.differs <= self._goal.tolerance and (self.likely is None or found.rtf > self.likely.rtf):
            self.likely, self._likely_seconds = found, outcome.seconds
        return outcome

    def _judged(self, one: Configuration, outcome: Outcome) -> Tried:
        return judged(one, outcome, self._reference, self._goal.harder, self._goal.tolerance)


def _is_finer(one: Fem | None, than: Fem | None) -> bool:
    """Whether it is of the same family, on no fewer cells, no fewer of them solved for, and with no longer step."""
    if one is None or than is None:
        return False
    finer = one.n_cells >= than.n_cells and one.n_solved >= than.n_solved and one.step <= than.step
    return one.family == than.family and finer


def _told(runs: Sequence[Run], reference: Reference) -> Iterable[Run]:
    """What runs foretell of finer cells and of shorter steps, each once."""
    finer = list(refined(runs, reference))
    every = (*foretold(runs), *finer, *foretold(runs, finer))
    return {one.key: (one, outcome) for one, outcome in reversed(every)}.values()


def _fastest(
    goal: Goal,
    reference: Reference,
    wanted: Sequence[Configuration],
    measure: Measure,
    kept: Mapping[str, Outcome],
) -> Plan:
    """Try the configurations, and what their runs foretell, until none that is left can be faster than the best one."""
    if not reference.uncertainty <= VAGUEST * goal.tolerance:
        raise NoPlan(
            f"what is true is known to {in_words(reference.uncertainty)} only, too little to plan for "
            f"{_percent(goal.tolerance)}: give more --minutes, or leave out the quantities that are not known better"
        )
    search = _Search(goal, reference, measure)
    search.attempt(wanted, kept)
    search.attempt_foretold()
    best, likely = search.best, search.likely
    if likely is not None and (best is None or likely.rtf > CERTAIN * best.rtf or best.rtf < goal.rtf <= likely.rtf):
        best = likely
    if best is None or best.rtf < goal.rtf:
        why = _nearest(goal, best, search.tried)
        if best is None and search.late is not None:
            why += f"; runs so far foretell that {search.late.label} is: give more --minutes"
        raise (NoPlan if best is None else TooSlow)(why)
    tried = tuple(search.tried)
    left_out = {name: true.left_out for name, true in reference.truth.items() if true.left_out}
    return Plan(goal, best, tried, reference.uncertainty, left_out, origin(reference))


def _in_reach(reference: Reference, tolerance: float) -> bool:
    """Whether a quantity does not count that would if it were known a little better."""
    return any(
        true.left_out and true.uncertainty < REACH * counts_to(tolerance)
        for name, true in reference.truth.items()
        if true.has_limit
    )


def _undecided(outcome: Outcome, reference: Reference, goal: Goal) -> bool:
    """Whether a run may be accurate enough and may be not, for all that is known of the truth."""
    if outcome.status != "done" or outcome.series is None:
        return False
    tolerance = goal.tolerance - _grown(outcome, goal.harder)
    found = errors(outcome.series, reference.time, reference.truth)
    vague = {name: reference.truth[name].uncertainty for name in reference.counted}
    may_be = all(found[name].bound or found[name].value - vague[name] <= tolerance for name in vague)
    is_so = all(_with(found[name], vague[name]) <= tolerance for name in vague)
    known = all(least <= tolerance for least in sure(found, reference.truth).values())
    return may_be and known and not is_so


def judged(
    configuration: Configuration, outcome: Outcome, reference: Reference, harder: float = 1.0, tolerance: float = 0.0
) -> Tried:
    """A run's worst error: what it differs from the reference by, what that may be off by, and a harder motion adds.

    A quantity that is not known well enough to count does so with what it is off by at least. What is good enough for
    half the tolerance, for which fewer are known well enough, is so for this one, if the others differ by no more than
    that: who allows more gets no dearer plan.
    """
    label, settings = configuration.label, configuration.settings
    if outcome.status != "done" or outcome.series is None:
        why = f"{outcome.status}: {outcome.reason}"
        return Tried(label, settings, 0.0, float("inf"), why, status=outcome.status)
    found, grown = errors(outcome.series, reference.time, reference.truth), _grown(outcome, harder)
    worst, half = _worst(found, reference, np.inf), 0.5 * tolerance
    differs = max((found[name].differs, name) for name in reference.counted)
    while worst[0] + grown > tolerance >= differs[0] + grown and half >= KNOWN:
        strict = _worst(found, reference, counts_to(half))
        worst = max(strict, differs) if strict[0] + grown <= half else worst
        half *= 0.5
    least = max(differs[0], *sure(found, reference.truth).values(), 0.0)
    for name, bound in looser(reference, tolerance).items():
        off, alone = _with(found[name], reference.truth[name].uncertainty), found[name].differs
        worst = max(worst, (off, name)) if off + grown > bound else worst
        least = max(least, alone) if alone + grown > bound else least
    return Tried(label, settings, outcome.rtf, worst[0] + grown, worst[1], outcome.estimate, differs=least + grown)


def _worst(found: Mapping[str, Error], reference: Reference, vaguest: float) -> tuple[float, str]:
    """The worst error, and of which quantity, where what is known worse than `vaguest` does not count."""
    truth = {
        name: replace(true, left_out=true.left_out or ("vague" if true.uncertainty > vaguest else ""))
        for name, true in reference.truth.items()
    }
    bounds = {name: _with(found[name], true.uncertainty) for name, true in truth.items() if not true.left_out}
    bounds |= sure(found, truth)
    decisive = max(bounds, key=lambda name: bounds[name], default="")
    return bounds.get(decisive, float("inf")), decisive


def _grown(outcome: Outcome, harder: float) -> float:
    """By how much more a run is off in a harder motion: what it estimates of itself grows, other errors stay."""
    return (harder - 1.0) * outcome.estimate


def _with(error: Error, uncertainty: float) -> float:
    """What a run differs from the reference by, together with what that may be off by."""
    return float(np.hypot(error.differs, uncertainty))


def _nearest(goal: Goal, best: Tried | None, tried: Sequence[Tried]) -> str:
    """Why there is no plan, and what comes nearest."""
    done = [one for one in tried if np.isfinite(one.error)]
    if not done:
        reasons = "; ".join(dict.fromkeys(one.decided_by for one in tried)) or "there was nothing to try"
        return f"no configuration could be run: {reasons}"
    if best is None:
        near = min(done, key=lambda one: one.error)
        return (
            f"nothing that was tried is accurate to {_percent(goal.tolerance)}: {near.label} comes nearest with "
            f"{_percent(near.error)} at {near.rtf:.3g} times real time ({near.decided_by}): allow more, or ask for "
            "fewer quantities"
        )
    fast = [one for one in done if one.rtf >= goal.rtf]
    text = (
        f"nothing that was tried is accurate to {_percent(goal.tolerance)} at {goal.rtf:.3g} times real time: "
        f"{best.label} is accurate at {best.rtf:.3g} times"
    )
    if fast:
        near = min(fast, key=lambda one: one.error)
        text += f", {near.label} fast enough with {_percent(near.error)} ({near.decided_by})"
    return text


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"
