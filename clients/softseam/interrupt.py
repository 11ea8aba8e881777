"""Lets another thread end what a process's main thread is doing, between two iterations of a solver."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

from softseam.embedded import halt
from softseam.errors import SimulationFailed

_LOOK = 0.5
"""time between looks at whether it is time [s]"""
_AGAIN = 20
"""looks after which what was to end is ended again, should the first signal be lost on its way"""


class Ended(KeyboardInterrupt):
    """Raised in the main thread when it is to end: what an interrupt may end, this may."""


class Interrupt:
    """A context that is ended from a thread of its own once `is_due`, which is asked twice a second.

    Where it is entered in another thread than a process's main one, it asks but ends nothing: signals are heard by the
    main thread alone. Leaving it, `ended` says whether it was ended, and nothing of that is raised: neither what ended
    it nor that a step has no solution, for its solver may have been halted.
    """

    def __init__(self, name: str, is_due: Callable[[], bool]) -> None:
        self.ended = False
        self._is_due = is_due
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name=name, daemon=True)
        self._main = threading.main_thread().ident
        self._handler: Any = None
        self._ends = self._sent = False

    def __enter__(self) -> Interrupt:
        self._ends = threading.current_thread() is threading.main_thread()
        if self._ends:
            self._handler = signal.signal(signal.SIGUSR1, _end)  # SIGINT is ignored where a script began this process
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        while True:
            try:
                self._stop.set()
                self._thread.join()
                if self._handler is not None:
                    signal.signal(signal.SIGUSR1, self._handler)
                break
            except Ended:
                continue  # it was due as the last of it was done
        if self._ends:
            halt(False)
        self.ended = self._sent and (error is None or isinstance(error, (Ended, SimulationFailed)))
        return self.ended

    def _watch(self) -> None:
        wait = 0
        while not self._stop.wait(_LOOK):
            wait -= 1
            if self._is_due() and wait <= 0 and self._ends and self._main is not None:
                wait, self._sent = _AGAIN, True
                halt(True)
                signal.pthread_kill(self._main, signal.SIGUSR1)


def _end(number: int, frame: FrameType | None) -> None:
    raise Ended
