"""One or two threads at a step, whichever is faster; the result is the same. See `kernels.thread_team`."""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np

from softseam_protocol.facts import cores
from softseam_services.body.body import Floats, Ints

from .kernels.block import new_workspace
from .kernels.thread_team import MASK, new_team, start_team

WORTH_TWO = 400
"""batches from which on a second thread pays; with half as many it gains nothing"""
TRIAL = 32
"""every so many steps the slower way is tried again: whether there is a core to spare may change"""
FORGET = 1.25
"""a step slower than the last counts as at most so much slower: one that was held up says little"""


@cache
def _second() -> ThreadPoolExecutor:
    """The second thread of this process, whichever regions it works for."""
    return ThreadPoolExecutor(1, thread_name_prefix="pbd")


def share_out(work: Callable[[int], None]) -> None:
    """work(0) by this thread and work(1) by a second one, or after it, where that is busy; they share nothing."""
    other = _second().submit(work, 1)
    try:
        work(0)
    finally:  # whatever happens here, nobody is left at work
        idle = other.cancel()
        if not idle:
            other.result()
    if idle:
        work(1)


class TwoThreads:
    """Runs a kernel by this thread, and by a second one beside it where the region is large and a core is free."""

    def __init__(self, ws: Floats, colours: Ints, n_nodes: int) -> None:
        n_batches = int(colours[-1])
        self.possible = n_batches >= WORTH_TWO and n_nodes < MASK and cores() > 1
        """whether a second thread is ever tried"""
        self._all, self._colours = np.array([0, n_batches], dtype=np.int32), colours
        self._alone, self._crew = new_team(alone=True), new_team(alone=False)
        self._ws = ws
        self._other_ws = new_workspace() if self.possible else ws
        self.seconds = [0.0, 0.0]
        """that the last run took by one thread, and by two, over its amount [s]; 0: none yet"""
        self.n_runs = 0
        """so far"""

    def run(self, amount: int, kernel: Callable[..., None], *arguments: Any) -> None:
        """kernel(*arguments, parts, team, worker, workspace) to the end; its time goes with `amount`."""
        two = self.pays()
        began = time.perf_counter()
        if two:
            start_team(self._crew)
            other = _second().submit(kernel, *arguments, self._colours, self._crew, 1, self._other_ws)
            kernel(*arguments, self._colours, self._crew, 0, self._ws)
            if not other.cancel():
                other.result()
        else:
            kernel(*arguments, self._all, self._alone, 0, self._ws)
        now = (time.perf_counter() - began) / amount
        before = self.seconds[two]
        self.seconds[two] = min(now, FORGET * before) if before > 0.0 else now
        self.n_runs += 1

    def pays(self) -> bool:
        """Two threads, if they were faster of late; each way is tried at the start and now and then."""
        if not self.possible:
            return False
        faster = self.seconds[1] < self.seconds[0]
        return faster != (self.n_runs % TRIAL == TRIAL - 1)
