"""How long a call takes, for benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

SHORT = 1e-3
"""calls shorter than this are timed by the many: a clock is not that fine [s]"""


def least(act: Callable[[], object], seconds: float = 0.3, clock: Callable[[], float] = process_time) -> float:
    """Least CPU time of a call, or what another clock says, within about `seconds` [s].

    Long calls one by one; of short ones as many at a time as take a fifth of that, and the mean of these.
    """
    began = clock()
    act()
    first = max(clock() - began, 1e-6)
    together = max(1, int(0.2 * seconds / first)) if first < SHORT else 1
    best, spent, n = float("inf") if together > 1 else first, first, 0
    while n < 2 or (spent < 1.5 * seconds and n < 200):
        began = clock()
        for _ in range(together):
            act()
        took = clock() - began
        best, spent, n = min(best, took / together), spent + took, n + 1
    return best
