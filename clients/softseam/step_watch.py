"""Watches how long a run's steps take: says so while one lasts, and ends a run that gets nowhere.

A run gets on with each step that is solved at once, however long that takes, and with each that is solved somehow, in
parts or with a gap, but soon. Where none does for long, it is ended.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from types import TracebackType

from softseam.errors import SimulationFailed
from softseam.interrupt import Interrupt
from softseam.observation import Observation
from softseam_protocol.messages.outcomes import EventKind

_LIMIT = 20.0
"""longest time in which a run of a small body does not get on [s]"""
_A_NODE = 1e-2
"""what each node of a body adds to that [s]: a step of 10,000 nodes takes a second or so for each of its iterations"""
_RESTART = 60.0
"""what is added over a bus, where services that died are waited for [s]"""
_SOON = 0.1
"""of the limit: what is not solved at once gets on where it takes no longer [1]"""
_HARD = {EventKind.SOLVER, EventKind.STEP, EventKind.SEAM, EventKind.MONITOR}
"""events of steps that were not solved at once"""
TELL = 5.0
"""time that a step takes before it is reported, and again each time that this has doubled [s]"""


def limit_for(n_nodes: int, afar: bool) -> float:
    """Longest time in which a run need not get on, unless its user says another [s]. afar: over a bus"""
    return _LIMIT + _A_NODE * n_nodes + (_RESTART if afar else 0.0)


class StepWatch:
    """A context around the steps of a run; in another thread than a process's main one it reports, but ends nothing.

    limit     longest time in which the run does not get on [s]; 0: as long as it takes
    report    receives the number of the step at hand and how long it has taken, now and then [s]
    compiled  time that this process has spent compiling so far [s], which counts for nothing
    Leaving it raises SimulationFailed where the limit was passed.
    """

    def __init__(
        self, limit: float, report: Callable[[int, float], None], compiled: Callable[[], float] = lambda: 0.0
    ) -> None:
        self._limit, self._report, self._compiled = limit, report, compiled
        self._interrupt = Interrupt("softseam step watch", self._looks)
        self._steps, self._good, self._failed = 0, 0, 0
        self._begun = self._last = self._now()
        self._told_step, self._due = 0, TELL

    def taken(self, observation: Observation) -> None:
        """A step was taken."""
        now, kinds = self._now(), {event.kind for event in observation.events}
        soon = now - self._begun <= _SOON * self._limit
        self._steps, self._begun = observation.step, now
        if EventKind.SOLVER in kinds:
            self._failed += 1
        elif soon or kinds.isdisjoint(_HARD):
            self._last, self._good, self._failed = now, observation.step, 0

    def __enter__(self) -> StepWatch:
        self._begun = self._last = self._now()
        self._interrupt.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._interrupt.__exit__(kind, error, trace):
            raise SimulationFailed(self._words()) from None

    def _now(self) -> float:
        """A clock that stands while kernels are compiled [s]."""
        return perf_counter() - self._compiled()

    def _looks(self) -> bool:
        """Tell of a step that takes long; whether the limit is passed."""
        now = self._now()
        if self._steps != self._told_step:
            self._told_step, self._due = self._steps, TELL
        if now - self._begun >= self._due:
            self._due *= 2.0
            self._report(self._steps + 1, now - self._begun)
        return bool(self._limit) and now - self._last >= self._limit

    def _words(self) -> str:
        what = f"step {self._steps + 1} was not solved within {self._limit:.0f} s"
        if self._steps > self._good:
            after = f" after step {self._good}" if self._good else ""
            what = f"no step{after} was solved at once, for {self._limit:.0f} s"
            what += f", and {self._failed} had no solution" if self._failed else ""
        return (
            f"{what}: heed the warnings above, shorten `step`, ask less of the body (slower tools, a smaller squeeze, "
            "a stiffer material), or give it fewer cells by a longer `body.cell`; --step-limit waits longer, with 0 "
            "for ever"
        )
