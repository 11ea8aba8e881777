"""Chooses how to simulate a scene: the fastest configuration that is accurate enough, of those that were run.

The chart's configurations are run cheapest first, until those left cannot be faster than the best one found. Where none
is accurate enough, the most accurate run of FEM is refined in steps, in cells, or in both, until one is; and from the
best one on, longer steps, fewer cells and the softer element are tried while they do. What counts as an error is what a
run differs from the reference by, e, and what that may be off by, u, as errors that know nothing of each other add up:
sqrt(e^2 + u^2). To be sure of that may cost `CERTAIN` times what the fastest run costs whose e alone is small enough;
where it would cost more, that one is chosen, and the plan says so.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from softseam.columns import rms, unit_of
from softseam.errors import SoftseamError
from softseam.view.colors import label
from softseam_protocol.scene.motion import ClosePhase, MovePhase
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.configurations import Configuration, Fem
from softseam_studies.study.errors import KNOWN, errors, sure
from softseam_studies.study.measure import Outcome
from softseam_studies.study.plan import Goal, Plan, Tried
from softseam_studies.study.reference import Reference, in_words, origin
from softseam_studies.study.sweep import learn

Run = tuple[Configuration, Outcome]
Measure = Callable[[Configuration, Callable[[Outcome], bool]], Outcome]
"""runs a configuration, and times it anew where its first run is worth that"""

HOPE = 2.0
"""a configuration is tried while its foreseen time is below this many times the best one's [1]"""
CERTAIN = 1.5
"""a run that is accurate enough with all that the reference may be off by may cost this many times one that is so by
what is known [1]"""
GAIN = 1.25
"""a run that is so many times more accurate is refined further before others are tried [1]"""
WORST_REFERENCE = 0.75
"""what is known worse than this share of the tolerance, or of 5 %, does not count [1]"""
VAGUEST = 0.95
"""no plan is made where what counts is known worse than this share of the tolerance: next to nothing would be left for
runs [1]"""
_NOTHING = "a plan would promise nothing"
_ASK_FOR_MORE = "ask for more, e.g. quantities: [grip_force, sag]"


class NoPlan(SoftseamError):
    """Nothing that was tried is accurate enough and fast enough, or nothing that was asked for can be promised."""


def promised(scene: Scene, names: Iterable[str]) -> tuple[str, ...]:
    """Of these quantities those that a plan can promise: what the motion prescribes any run has. Raises NoPlan where
    it prescribes all."""
    given, asked = prescribed(scene), tuple(names)
    if found := tuple(name for name in asked if name not in given):
        return found
    texts = "; ".join(f"{label(name)} ({given[name]})" for name in asked)
    raise NoPlan(f"{_NOTHING}: {texts}; {_ASK_FOR_MORE}")


def counts_to(tolerance: float) -> float:
    """How uncertain a quantity may be that counts in a plan of this tolerance [1]: whoever wants less than 5 % wants it
    of all that a plan of 5 % counts."""
    return WORST_REFERENCE * max(KNOWN, tolerance)


def looser(reference: Reference, tolerance: float) -> dict[str, float]:
    """Stresses that are known well enough for some tolerance from this one to 5 %, and for which [1].

    A stress follows from derivatives, and is known an order worse than what moves and presses. It forbids no plan, but
    has to be within the tolerance that it is known well enough for. Where nothing else counts, it does.
    """
    held = {
        name: reference.truth[name].uncertainty / WORST_REFERENCE
        for name in reference.counted
        if unit_of(name) == "Pa" and reference.truth[name].uncertainty > WORST_REFERENCE * tolerance
    }
    return {} if len(held) == len(reference.counted) else held


def too_vague(reference: Reference, tolerance: float) -> bool:
    """Whether what counts is known too little for a plan."""
    return reference.uncertainty_but(looser(reference, tolerance)) > VAGUEST * tolerance


def choose(
    goal: Goal, reference: Reference, wanted: Sequence[Configuration], measure: Measure, levels: Iterable[Run] = ()
) -> Plan:
    """The fastest configuration that is accurate enough.

    measure  called once for each configuration
    levels   of the reference, where they were run here: configurations like others

    Raises NoPlan where none is accurate enough, or none of those fast enough; its text names the nearest.
    """
    held = looser(reference, goal.tolerance)
    if too_vague(reference, goal.tolerance):
        known = in_words(reference.uncertainty_but(held))
        raise NoPlan(
            f"what is true is known to {known} only, too little to plan for {_percent(goal.tolerance)}: give more "
            "--minutes, or leave out the quantities that are not known better"
        )
    counted = {name: reference.truth[name] for name in reference.counted}
    if all(rms(true.values, reference.time) <= goal.tolerance * true.scale for true in counted.values()):
        names = " and ".join(label(name) for name in counted)
        raise NoPlan(f"{_NOTHING}: {names} is so little that a run in which nothing happens has it; {_ASK_FOR_MORE}")
    search = _Search(goal, reference, measure)
    for one, outcome in levels:
        search.take(one, outcome)
    search.sweep(wanted)
    search.refine()
    search.cheapen()
    best = search.choice
    if best is None or best.rtf < goal.rtf:
        raise NoPlan(_nearest(goal, best, search.tried))
    left_out = {name: true.left_out for name, true in reference.truth.items() if true.left_out}
    for name, bound in held.items():
        left_out[name] = f"known to {in_words(reference.truth[name].uncertainty)} only, and held to {in_words(bound)}"
    return Plan(goal=goal, choice=best, tried=tuple(search.tried), left_out=left_out, truth=origin(reference, held))


class _Search:
    """What was run against a reference, and the fastest of it that is accurate enough."""

    def __init__(self, goal: Goal, reference: Reference, measure: Measure) -> None:
        self._goal, self._reference, self._measure = goal, reference, measure
        self._pace: dict[str, float] = {}
        self._runs: dict[str, tuple[Configuration, Outcome, Tried]] = {}

    @property
    def tried(self) -> list[Tried]:
        return [tried for _, _, tried in self._runs.values()]

    @property
    def choice(self) -> Tried | None:
        """The fastest that surely is accurate enough, or that is so by what is known where that is far faster."""
        likely = max((one for one in self.tried if one.within(self._goal.tolerance)), key=_rtf, default=None)
        best = max((one for one in self.tried if one.surely_within(self._goal.tolerance)), key=_rtf, default=None)
        if best is None or likely is None or (likely.rtf <= CERTAIN * best.rtf and best.rtf >= self._goal.rtf):
            return best or likely
        return likely if likely.rtf > CERTAIN * best.rtf or likely.rtf >= self._goal.rtf else best

    def sweep(self, wanted: Sequence[Configuration]) -> None:
        """Run those that may be the fastest, cheapest first."""
        for one in sorted(wanted, key=lambda c: (c.seconds, c.key)):
            if self._foreseen(one) <= HOPE * self._longest():
                self._run(one)

    def refine(self) -> None:
        """From the most accurate run of FEM on, a shorter step, finer cells, or both, until one is accurate enough."""
        while self.choice is None and (before := self._most_accurate()) is not None:
            error, base = before
            finer, shorter = base.finer(), replace(base, step=0.5 * base.step)
            for other in (shorter, finer, replace(finer, step=shorter.step)):
                self._run(other.configuration())
                after = self._most_accurate()
                if self.choice is not None or (after is not None and GAIN * after[0] <= error):
                    break
            if self._most_accurate() == before:
                return

    def _most_accurate(self) -> tuple[float, Fem] | None:
        """Error of the most accurate run of FEM, and what it is."""
        done = [(tried.error, one.key, one.fem) for one, _, tried in self._runs.values() if tried.error is not None]
        found = [(error, key, fem) for error, key, fem in done if fem is not None]
        error, _, fem = min(found, key=lambda each: each[:2], default=(0.0, "", None))
        return None if fem is None else (error, fem)

    def cheapen(self) -> None:
        """From the fastest accurate run of FEM on, what is cheaper in one way, while one of these is accurate, too."""
        before, base = None, self._fastest()
        while base is not None and base != before:
            for other in base.cheaper():
                if self._foreseen(other.configuration()) <= HOPE * self._longest():
                    self._run(other.configuration())
            before, base = base, self._fastest()

    def _fastest(self) -> Fem | None:
        """Of the runs of FEM that are accurate enough by what is known."""
        found = [(tried.rtf, one) for one, _, tried in self._runs.values() if tried.within(self._goal.tolerance)]
        fems = [(rtf, one.key, one.fem) for rtf, one in found if one.fem is not None]
        return max(fems, key=lambda each: each[:2], default=(0.0, "", None))[2]

    def _foreseen(self, one: Configuration) -> float:
        """Time of a run [s]: what it took, or as its method's pace says, or as runs on the same cells do."""
        if one.key in self._runs and self._runs[one.key][1].seconds:
            return self._runs[one.key][1].seconds
        paced = one.seconds * self._pace.get(one.method, 1.0)
        same = [
            outcome.seconds * other.fem.step / one.fem.step
            for other, outcome, _ in self._runs.values()
            if one.fem and other.fem and other.fem.cells == one.fem.cells and outcome.status == "done"
        ]
        return min([paced, *same])

    def _longest(self) -> float:
        """Time of a run that may be chosen [s]."""
        tolerance = self._goal.tolerance
        surely = [o.seconds for _, o, tried in self._runs.values() if tried.surely_within(tolerance)]
        likely = [o.seconds for _, o, tried in self._runs.values() if tried.within(tolerance)]
        return min(min(surely, default=np.inf), CERTAIN * min(likely, default=np.inf))

    def _run(self, one: Configuration) -> None:
        if one.key not in self._runs:
            self.take(one, self._measure(one, lambda outcome: self._judged(one, outcome).within(self._goal.tolerance)))

    def take(self, one: Configuration, outcome: Outcome) -> None:
        """Judge a run."""
        learn(self._pace, one, outcome)
        self._runs[one.key] = one, outcome, self._judged(one, outcome)

    def _judged(self, one: Configuration, outcome: Outcome) -> Tried:
        return judged(one, outcome, self._reference, self._goal)


def judged(one: Configuration, outcome: Outcome, reference: Reference, goal: Goal) -> Tried:
    """A run's worst error: what it differs from the reference by, what that may be off by, and what a heavier load
    adds: what it estimates of itself grows.

    A quantity that is not known well enough to count does so with what it is off by at least.
    """
    if outcome.status != "done" or outcome.series is None:
        why = f"{outcome.status}: {outcome.reason}"
        return Tried(label=one.label, settings=one.settings, decided_by=why, status=outcome.status)
    found, truth = errors(outcome.series, reference.time, reference.truth), reference.truth
    held, grown = looser(reference, goal.tolerance), (goal.load_factor - 1.0) * outcome.estimate
    least = [(bound, name) for name, bound in sure(found, truth).items()]

    def worst(off: Callable[[str], float]) -> tuple[float, str]:
        counted = [(off(name), name) for name in reference.counted if name not in held]
        beyond = [(off(name), name) for name, bound in held.items() if off(name) + grown > bound]
        return max([*counted, *beyond, *least], default=(float("inf"), ""))

    differs, _ = worst(lambda name: found[name].differs)
    error, name = worst(lambda name: float(np.hypot(found[name].differs, truth[name].uncertainty)))
    return Tried(
        label=one.label,
        settings=one.settings,
        rtf=outcome.rtf,
        error=error + grown,
        differs=differs + grown,
        decided_by=name,
        estimate=outcome.estimate,
    )


def _rtf(one: Tried) -> float:
    return one.rtf


def _nearest(goal: Goal, best: Tried | None, tried: Sequence[Tried]) -> str:
    """Why there is no plan, and what comes nearest."""
    done = [(one.error, one) for one in tried if one.error is not None and np.isfinite(one.error)]
    if not done:
        reasons = "; ".join(dict.fromkeys(one.decided_by for one in tried)) or "there was nothing to try"
        return f"no configuration could be run: {reasons}"
    text = f"nothing that was tried is accurate to {_percent(goal.tolerance)}"
    late = sum(one.status in ("left out", "stopped") for one in tried)
    if best is None:
        error, near = min(done, key=lambda each: each[0])
        more = f"give more --minutes ({late} had no time), " if late else ""
        return (
            f"{text}: {near.label} comes nearest with {_percent(error)} at {near.rtf:.3g} times real time "
            f"({near.decided_by}): {more}allow more, or ask for fewer quantities"
        )
    text += f" at {goal.rtf:.3g} times real time: {best.label} is accurate at {best.rtf:.3g} times"
    fast = [each for each in done if each[1].rtf >= goal.rtf]
    if fast:
        error, near = min(fast, key=lambda each: each[0])
        text += f", {near.label} fast enough with {_percent(error)} ({near.decided_by})"
    return text


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"


def prescribed(scene: Scene) -> dict[str, str]:
    """Names of quantities, and what prescribes each."""
    grips = [phase for phase in scene.motion if isinstance(phase, ClosePhase)]
    found = {}
    if any(grip.force is not None for grip in grips):
        found["grip_force"] = "the motion prescribes it: tools hold this force"
    elif grips and all(grip.until.force is None for grip in grips):
        found["compression"] = "the motion prescribes it: tools close by so much"
    moves = (phase for phase in scene.motion if isinstance(phase, MovePhase))
    if any(way[2] > 0.0 for phase in moves for way in phase.ways.values()):
        found["lift_height"] = "the motion prescribes it: tools rise by so much"
    return found
