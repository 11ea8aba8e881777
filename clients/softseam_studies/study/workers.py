"""Who runs the configurations of a sweep: this process, processes side by side, or a Ray cluster."""

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from softseam.scenes import Source
from softseam_protocol.extensions import load_extensions
from softseam_studies.cluster import Workers
from softseam_studies.study.configurations import Configuration
from softseam_studies.study.measure import Outcome, Told, measure

Ended = Iterator[tuple[Configuration, Outcome]]
Work = tuple[tuple[str, ...], float]
"""settings of a run, and its longest processor time [s]"""


@dataclass(frozen=True)
class Measuring:
    """`measure` of a scene, but for what configurations differ in."""

    scene: Source
    names: tuple[str, ...]
    runs: int
    length: float

    def __call__(self, work: Work, report: Told | None = None) -> Outcome:
        settings, limit = work
        return measure(
            self.scene, settings, self.names, runs=self.runs, limit=limit, length=self.length, report=report, look=1
        )


class Runners(Protocol):
    """They run configurations, `size` at a time."""

    size: int

    def begin(self, one: Configuration, work: Work, report: Told) -> None:
        """Have a configuration run; `report` hears of its progress where this process runs it."""

    def ended(self, most: int) -> Ended:
        """Those that ended, waiting until no more than so many run."""


class Here:
    """This process, one at a time."""

    size = 1

    def __init__(self, measuring: Measuring) -> None:
        self._measuring, self._done = measuring, list[tuple[Configuration, Outcome]]()

    def begin(self, one: Configuration, work: Work, report: Told) -> None:
        self._done.append((one, self._measuring(work, report)))

    def ended(self, most: int) -> Ended:
        while len(self._done) > most:
            yield self._done.pop(0)


class Processes:
    """So many of this machine, side by side."""

    def __init__(self, measuring: Measuring, size: int, stack: ExitStack) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = stack.enter_context(ProcessPoolExecutor(size, context, initializer=_begin_process))
        self._measuring, self.size, self._begun = measuring, size, dict[Future[Outcome], Configuration]()

    def begin(self, one: Configuration, work: Work, report: Told) -> None:
        self._begun[self._pool.submit(self._measuring, work)] = one

    def ended(self, most: int) -> Ended:
        while len(self._begun) > most:
            for run in wait(self._begun, return_when=FIRST_COMPLETED).done:
                yield self._begun.pop(run), run.result()


class OnCluster:
    """A Ray cluster, one on each of its processors; what was lost with a machine runs anew on another."""

    def __init__(self, measuring: Measuring, address: str, lost: Callable[[str], None], stack: ExitStack) -> None:
        make = partial(Measuring, measuring.scene, measuring.names, measuring.runs, measuring.length)
        self._workers: Workers[Work, Outcome] = stack.enter_context(Workers(address, make, lost))
        self.size, self._begun = self._workers.size, dict[int, Configuration]()

    def begin(self, one: Configuration, work: Work, report: Told) -> None:
        self._begun[self._workers.begin(work)] = one

    def ended(self, most: int) -> Ended:
        for number, outcome in self._workers.ended(most):
            yield self._begun.pop(number), outcome


def _begin_process() -> None:
    """End with the process that this one works for, whatever ends that."""
    load_extensions()
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end_with() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with, daemon=True).start()
