"""Runs one configuration after another, cheapest first, or several at a time; each is stored as soon as it is done."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack
from typing import Any

from softseam.study.configurations import Configuration
from softseam.study.measure import RUNS, Outcome, Told, measure
from softseam.study.store import Store
from softseam.study.study import Study
from softseam_protocol.extensions import load_extensions

SLACK = 3.0
"""a run may take this many times what it was foreseen to, where the budget has it [1]"""
LONGEST = 0.25
"""share of the budget that a single run may take [1]"""

Watch = Callable[[Configuration, float], Told]
"""told which configuration runs now and its foreseen seconds; returns what is told of its progress"""


def finished(store: Store, wanted: Sequence[Configuration]) -> dict[str, Outcome]:
    """Outcomes stored by an earlier sweep, by key. Raises BadInput, naming a corrupt or foreign file."""
    found = {one.key: store.outcome(one.key) for one in wanted}
    return {key: outcome for key, outcome in found.items() if outcome is not None}


def sweep(
    study: Study,
    wanted: Sequence[Configuration],
    store: Store,
    budget: float,
    watch: Watch,
    runs: int = RUNS,
    jobs: int = 1,
) -> dict[str, Outcome]:
    """Outcome of every configuration, by key; what is not run for its cost is an outcome with that reason.

    budget  processor time of the runs, without compiling [s]; what was stored before costs nothing
    runs    timed runs of a configuration
    jobs    processes that run configurations side by side
    """
    outcomes, pace, spent, names = finished(store, wanted), dict[str, float](), 0.0, study.names()
    for one in wanted:
        if one.key in outcomes:
            learn(pace, one, outcomes[one.key])

    def done(one: Configuration, outcome: Outcome) -> None:
        nonlocal spent
        outcomes[one.key] = outcome
        if outcome.status != "stopped":
            store.write(one.key, outcome.as_json())
        spent += outcome.spent
        learn(pace, one, outcome)

    with ExitStack() as stack:
        pool = _Pool(jobs, stack)
        for one in wanted:
            if one.key in outcomes:
                continue
            for earlier, outcome in pool.ended(jobs - 1):
                done(earlier, outcome)
            once, left = one.seconds * pace.get(one.method, 1.0), budget - spent
            if once > min(left, LONGEST * budget):
                outcomes[one.key] = Outcome("left out", f"a run would take some {once:.2g} s: give more --minutes")
                continue
            told = watch(one, (1 + runs) * once)
            limit = min(left, max(SLACK * once, LONGEST * budget))
            how = {"runs": runs, "limit": limit, "length": study.frame.length, "look": 1}
            pool.begin(one, told, study.name, (*study.settings, *one.settings), names, **how)
        for one, outcome in pool.ended(0):
            done(one, outcome)
    return outcomes


class _Pool:
    """Runs configurations in processes side by side; of one job, in this process."""

    def __init__(self, jobs: int, stack: ExitStack) -> None:
        self._pool, self._begun = None, dict[Future[Outcome], Configuration]()
        if jobs > 1:
            context = multiprocessing.get_context("spawn")
            self._pool = stack.enter_context(ProcessPoolExecutor(jobs, context, initializer=_begin_process))

    def begin(self, one: Configuration, told: Told, *what: Any, **how: Any) -> None:
        """Have this configuration run: `measure` of what is given."""
        if self._pool is not None:
            run = self._pool.submit(measure, *what, **how)
        else:
            run = Future()
            run.set_result(measure(*what, told=told, **how))
        self._begun[run] = one

    def ended(self, most: int) -> Iterator[tuple[Configuration, Outcome]]:
        """Those that ended, waiting until no more than so many run."""
        while len(self._begun) > most:
            for run in wait(self._begun, return_when=FIRST_COMPLETED).done:
                yield self._begun.pop(run), run.result()


def _begin_process() -> None:
    """End with the process that this one works for, whatever ends that."""
    load_extensions()
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end_with() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with, daemon=True).start()


def learn(pace: dict[str, float], configuration: Configuration, outcome: Outcome) -> None:
    """Note how this machine's time compares with the rough estimate, by method; updated in place."""
    if outcome.status == "done" and outcome.walls:
        found = outcome.seconds / configuration.seconds
        pace[configuration.method] = 0.5 * (pace.get(configuration.method, found) + found)
