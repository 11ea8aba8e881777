"""Shows how a run gets on: simulated time, real-time factor, time left, and the grip where tools move.

On a terminal it is a bar; elsewhere (a log, a pipe) a line every tenth of the run or every few seconds.
"""

from __future__ import annotations

from collections import deque
from time import perf_counter
from types import TracebackType

from rich.console import Console

from softseam.bar import Bar
from softseam.duration import expected_duration
from softseam.observation import Observation
from softseam_protocol.scene.scene import Scene

_REFRESH = 0.1
"""time between updates of the bar [s]"""
_WINDOW = 3.0
"""wall time that the estimate of the time left looks back [s]"""
_LINE = 5.0
"""longest time between lines where there is no terminal [s]"""


class RunProgress:
    """Follows one run; a context manager. Hand its `update` to Session.run."""

    def __init__(self, scene: Scene, console: Console, label: str) -> None:
        self._console = console
        self._label = label
        self._total = expected_duration(scene)
        self._moves = bool(scene.motion)
        self._began: float | None = None
        self._first = 0.0
        self._recent: deque[tuple[float, float]] = deque()
        """(wall time, simulated time) of the last moments: the time left follows from them [s]"""
        self._shown = 0.0
        self._tenth = 0
        self._bar: Bar | None = None
        self.rtf = 0.0
        """simulated over wall seconds since the first step, which compiles"""

    def __enter__(self) -> RunProgress:
        if self._console.is_terminal:
            self._bar = Bar(self._console, self._label, self._total, "setting up")
        else:
            self._console.print(f"{self._label}: setting up", highlight=False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, observation: Observation) -> None:
        """Show an observation, unless the last one was shown a moment ago."""
        now = perf_counter()
        if self._began is None:
            self._began, self._first = now, observation.time
        elif now > self._began:
            self.rtf = (observation.time - self._first) / (now - self._began)
        self._recent.append((now, observation.time))
        while now - self._recent[0][0] > _WINDOW:
            self._recent.popleft()
        if self._bar is not None:
            if now - self._shown >= _REFRESH or observation.done:
                self._shown = now
                done = self._total if observation.done else observation.time
                self._bar.show(done, self._state(observation))
            return
        tenth = 10 if observation.done else int(10 * observation.time / self._total) if self._total else 0
        if tenth > self._tenth or now - self._shown >= _LINE:
            self._tenth, self._shown = tenth, now
            self._console.print(f"{self._label}: {self._state(observation)}", highlight=False)

    def wait(self, step: int, seconds: float) -> None:
        """Show that a step has taken so long so far [s]; may be called by another thread."""
        state = f"step {step} has taken {seconds:.0f} s so far"
        if self._bar is not None:
            self._bar.show(None, state)
        else:
            self._console.print(f"{self._label}: {state}", highlight=False)

    def _state(self, observation: Observation) -> str:
        total = f" of {self._total:.2f}" if self._total else ""
        rtf = f"RTF {self.rtf:.1f}" if self.rtf else "RTF -"
        state = f"t {observation.time:.2f}{total} s  {rtf}  ETA {self._eta(observation)}"
        if not self._moves:
            return state
        grip = max((v for name, v in observation.quantities.items() if name.endswith("grip_force")), default=0.0)
        return f"{state}  grip {grip:.2f} N"

    def _eta(self, observation: Observation) -> str:
        if observation.done:
            return "0 s"
        wall, simulated = self._recent[0]
        done = observation.time - simulated
        if not self._total or done <= 0.0:
            return "-"
        return f"{max(0.0, self._total - observation.time) * (self._recent[-1][0] - wall) / done:.1f} s"
