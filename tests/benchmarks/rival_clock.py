"""How long a rival takes: the time inside its steps, and how often a run is repeated. Needs nothing but Python."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from time import perf_counter, process_time
from typing import Any

RUNS = 3
ENOUGH = 12.0
"""no further run begins once those before took this much wall time together [s]"""
BRIEF, MOST = 0.5, 12
"""brief runs go on until they took this long together [s], or were so many, as ours do"""


class Clock:
    """Wall and processor time inside it, summed [s]."""

    def __init__(self) -> None:
        self.wall = self.cpu = 0.0

    def __enter__(self) -> None:
        self._began = perf_counter(), process_time()

    def __exit__(self, *_: object) -> None:
        self.wall += perf_counter() - self._began[0]
        self.cpu += process_time() - self._began[1]


def timed(run: Callable[[], tuple[dict[str, list[float]], Clock]]) -> dict[str, Any]:
    """The curves of a first run, and the times of those after it [s]; of a long one, its own."""
    curves, first = run()
    clocks: list[Clock] = []
    spent = 0.0
    while first.wall + spent < ENOUGH and (len(clocks) < RUNS or (len(clocks) < MOST and spent < BRIEF)):
        clocks.append(run()[1])
        spent += clocks[-1].wall
    clocks = clocks or [first]
    return {"curves": curves, "walls": [c.wall for c in clocks], "cpu": statistics.median(c.cpu for c in clocks)}
