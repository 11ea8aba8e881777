"""Watches how long a run's steps take: says so while one lasts, and ends a run that gets nowhere.

A run gets on with each step that is solved at once, however long that takes, and with each that is solved somehow, in
parts or with a gap, but soon. Where none does for long, it is ended.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from time import perf_counter
from types import FrameType, TracebackType
from typing import Any

from softseam.errors import SimulationFailed
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
_LOOK = 0.5
"""time between looks at the clock [s]"""
_AGAIN = 10.0
"""time after which a run that was to end is ended again [s]"""
_TELL = 5.0
"""time that a step takes before it is told of, and again each time that this has doubled [s]"""


class _Ended(KeyboardInterrupt):
    """Raised in the main thread as the limit is passed: what an interrupt may end, this may."""


def limit_for(n_nodes: int, afar: bool) -> float:
    """Longest time in which a run need not get on, unless its user says another [s]. afar: over a bus"""
    return _LIMIT + _A_NODE * n_nodes + (_RESTART if afar else 0.0)


class StepWatch:
    """A context around the steps of a run; in another thread than a process's main one it tells, but ends nothing.

    limit     longest time in which the run does not get on [s]; 0: as long as it takes
    tell      receives the number of the step at hand and how long it has taken, now and then [s]
    compiled  time that this process has spent compiling so far [s], which counts for nothing
    Leaving it raises SimulationFailed where the limit was passed.
    """

    def __init__(
        self, limit: float, tell: Callable[[int, float], None], compiled: Callable[[], float] = lambda: 0.0
    ) -> None:
        self._limit, self._tell, self._compiled = limit, tell, compiled
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="softseam step watch", daemon=True)
        self._main = threading.main_thread().ident
        self._handler: Any = None
        self._steps, self._good, self._failed = 0, 0, 0
        self._begun = self._last = self._now()

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
        if threading.current_thread() is threading.main_thread():
            self._handler = signal.signal(signal.SIGUSR1, _end)  # SIGINT is ignored where a script began this process
        else:
            self._limit = 0.0  # signals are heard by the main thread alone
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._stop.set()
            self._thread.join()
        except _Ended:
            pass  # as the last step ended, it was time to
        finally:
            if self._handler is not None:
                signal.signal(signal.SIGUSR1, self._handler)
        if isinstance(error, _Ended):
            raise SimulationFailed(self._words()) from None

    def _now(self) -> float:
        """A clock that stands while kernels are compiled [s]."""
        return perf_counter() - self._compiled()

    def _watch(self) -> None:
        due, over = _TELL, self._limit
        step = self._steps
        while not self._stop.wait(_LOOK):
            now = self._now()
            if self._steps != step:
                step, due = self._steps, _TELL
            if now - self._begun >= due:
                due *= 2.0
                self._tell(step + 1, now - self._begun)
            if self._limit and now - self._last >= over and self._main is not None:
                over = now - self._last + _AGAIN  # should it be lost on its way
                signal.pthread_kill(self._main, signal.SIGUSR1)

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


def _end(number: int, frame: FrameType | None) -> None:
    raise _Ended
