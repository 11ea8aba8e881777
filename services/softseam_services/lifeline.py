"""A service's heartbeat: what its supervisor and the bus see of its state.

A thread of its own reports, a few times a second, what the service does and for how long. So a long computation or
compilation is seen as such, and only a process that does not run at all falls silent. The thread also notices when the
supervisor is gone, and stops the service: no orphans.
"""

from __future__ import annotations

import json
import os
import select
import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

BEAT_VARIABLE = "SOFTSEAM_LIFELINE"
"""environment variable: file descriptor on which a supervised process reports its state"""
PERIOD = 0.25
"""time between beats [s]"""


STOPPING = frozenset((signal.SIGTERM, signal.SIGINT))
"""signals that ask a service to stop"""


def heard_elsewhere(number: int, frame: FrameType | None) -> None:
    """Handle a signal whose number is read from the wake-up pipe."""


class Lifeline:
    """State of this process, sent every PERIOD; a context manager that also turns SIGTERM and SIGINT into `stop`."""

    def __init__(self, state: str = "starting", *, signals: bool = True) -> None:
        self.stop = threading.Event()
        """set when the service shall end"""
        self.on_beat: list[Callable[[], None]] = []
        """called in the heartbeat's thread with every beat"""
        self.busy_of: Callable[[], float] = lambda: 0.0
        """wall time spent in the request at hand [s]"""
        self._on_stop: list[Callable[[], None]] = []
        self._state = state
        self._signals = signals
        self._end = threading.Event()
        self._waking = threading.Lock()
        self._woken, self._waker = os.pipe()
        os.set_blocking(self._woken, False)
        os.set_blocking(self._waker, False)
        text = os.environ.pop(BEAT_VARIABLE, "")
        self._fd = int(text) if text else -1
        self._thread = threading.Thread(target=self._beat, name="softseam lifeline", daemon=True)

    def __enter__(self) -> Lifeline:
        if self._fd >= 0:
            os.set_blocking(self._fd, False)
        if self._signals:
            # a handler in Python only runs once the main thread comes round, which may be waiting for a request;
            # the number of the signal is written here at once
            signal.set_wakeup_fd(self._waker, warn_on_full_buffer=False)
            for number in STOPPING:
                signal.signal(number, heard_elsewhere)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._wake()
        self._thread.join()
        if self._signals:
            signal.set_wakeup_fd(-1)
        with self._waking:
            os.close(self._woken)
            os.close(self._waker)
            self._waker = -1
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    @property
    def state(self) -> str:
        return self._state

    @state.setter
    def state(self, state: str) -> None:
        self._state = state
        self._wake()

    def when_stopping(self, action: Callable[[], None]) -> None:
        """Call `action` (which must not block) when the service is asked to stop, from a thread of its own."""
        self._on_stop.append(action)
        if self.stop.is_set():
            action()

    def request_stop(self) -> None:
        self.stop.set()
        self._wake()

    def _wake(self) -> None:
        """Let the thread beat now, if it still does."""
        with self._waking:
            if self._waker < 0:
                return
            try:
                os.write(self._waker, b"\0")
            except BlockingIOError:
                return  # it will

    def _beat(self) -> None:
        said = False
        while True:
            if self.stop.is_set() and not said:
                said = True
                self._state = "stopping"
                for action in list(self._on_stop):
                    action()
            if self._fd >= 0 and not self._tell():
                self.stop.set()  # the supervisor is gone
                continue
            for call in list(self.on_beat):
                call()
            if self._end.is_set():
                return
            if select.select([self._woken], [], [], PERIOD)[0] and not STOPPING.isdisjoint(os.read(self._woken, 4096)):
                self.stop.set()

    def _tell(self) -> bool:
        line = json.dumps({"state": self._state, "busy": round(self.busy_of(), 3)}) + "\n"
        try:
            os.write(self._fd, line.encode())
        except BlockingIOError:
            return True  # nobody reads just now
        except OSError:
            os.close(self._fd)
            self._fd = -1
            return False
        return True
