"""Shows how a run gets on: simulated time, real-time factor, time left, and the grip where tools move."""

from __future__ import annotations

from collections import deque
from time import perf_counter

from rich.console import Console

from softseam.bar import Bar
from softseam.duration import expected_duration
from softseam.observation import Observation
from softseam_protocol.scene.scene import Scene

_WINDOW = 3.0
"""wall time that the estimate of the time left looks back [s]"""


class RunProgress:
    """Follows one run; a context manager. Hand its `update` to Session.run."""

    def __init__(self, scene: Scene, console: Console, label: str) -> None:
        self._total = expected_duration(scene)
        self._moves = bool(scene.motion)
        self._began: float | None = None
        self._first = 0.0
        self._recent: deque[tuple[float, float]] = deque()
        """(wall time, simulated time) of the last moments: the time left follows from them [s]"""
        self._bar = Bar(console, label, self._total)
        self.rtf = 0.0
        """simulated over wall seconds since the first step, which compiles"""

    def __enter__(self) -> RunProgress:
        self._bar.show(None, "setting up", force=True)
        return self

    def __exit__(self, *_: object) -> None:
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
        done = self._total if observation.done else observation.time
        self._bar.show(done, self._state(observation), force=observation.done)

    def wait(self, step: int, seconds: float) -> None:
        """Show that a step has taken so long so far [s]; may be called by another thread."""
        self._bar.show(None, f"step {step} has taken {seconds:.0f} s so far", force=True)

    def _state(self, observation: Observation) -> str:
        total = f" of {self._total:.2f}" if self._total else ""
        rtf = f"RTF {self.rtf:.3g}" if self.rtf else "RTF -"
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
