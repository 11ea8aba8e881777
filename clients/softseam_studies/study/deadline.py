"""When a search ends: so many seconds of wall time after it began, whatever it does then.

What kernels take to compile, once after an install, comes on top: no run can begin before.
"""

from __future__ import annotations

from time import perf_counter

from softseam_studies.study.measure import Clock, Outcome

READING = 3.0
"""processor time that reading kernels may take, which were compiled before; more is compiling [s]"""


class Deadline:
    """Begins as it is made.

    seconds   that the search may take [s]
    compiled  wall and processor time that kernels took so far [s]
    """

    def __init__(self, seconds: float, compiled: Clock) -> None:
        self._compiled = compiled
        self._ends = perf_counter() + seconds
        self._busy = 1.0

    def before(self, seconds: float) -> Deadline:
        """One so much sooner [s]."""
        return Deadline(self._ends - perf_counter() - seconds, self._compiled)

    def left(self) -> float:
        """Until it [s]."""
        return self._ends - perf_counter() + max(0.0, self._compiled()[1] - READING)

    def fits(self, seconds: float, keep: float = 0.0) -> bool:
        """Whether a run whose processor is foreseen to take so long ends before it, and leaves `keep` [s]."""
        return self._busy * seconds <= self.left() - keep

    def learn(self, outcome: Outcome) -> None:
        """Take over from a run how much longer than its processor's time it took, for other work held it up."""
        if outcome.walls and outcome.cpu > 0.0:
            self._busy = max(1.0, max(outcome.walls) / outcome.cpu)
