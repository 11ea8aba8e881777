"""How a chart gets on: what runs, how much of the whole is done, and the time left."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

from rich.console import Console

from softseam.bar import Bar
from softseam_studies.study.configurations import Configuration
from softseam_studies.study.measure import Told, timed_for
from softseam_studies.study.reference import Reference, origin


class ChartProgress:
    """A context manager, whose bar is shown from when it is made."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bar = Bar(console, "reference", 1.0, "setting up; the first runs compile")
        self._total = 0.0
        self._rough: dict[str, float] = {}
        self._finished = 0.0
        self._spent = 0.0
        """what the finished work was foreseen to take, and took [s]"""
        self._end = perf_counter()

    def __enter__(self) -> ChartProgress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def reference(self, text: str, seconds: float) -> Told:
        """A level of the reference begins, or another run that is not of the sweep."""
        began = perf_counter()
        self._bar.show(0.0, f"some {seconds:.0f} s" if seconds >= 1.0 else "", text, force=True)

        def show(done: float) -> None:
            taken = perf_counter() - began
            self._bar.show(done, f"ETA {taken / done - taken:.0f} s" if done > 0.05 else "", text)

        return show

    def known(self, reference: Reference) -> None:
        """The reference is there."""
        text = f"the reference {origin(reference)}"
        self._console.print(text, highlight=False, style="dim")

    def lost(self, text: str) -> None:
        """A worker of a cluster is lost."""
        self._console.print(text, style="yellow", highlight=False)

    def expect(self, wanted: Sequence[Configuration], budget: float) -> None:
        """The sweep begins; it ends within the budget [s], but for compiling."""
        self._end = perf_counter() + budget
        self._rough = {c.key: c.seconds + timed_for(c.seconds) for c in wanted}
        self._total = sum(self._rough.values())

    def configuration(self, configuration: Configuration, seconds: float) -> Told:
        """A configuration begins; those before it in the sweep are done."""
        if configuration.key not in self._rough:
            return self.reference(f"not of the sweep: {configuration.label}", seconds)
        keys = list(self._rough)
        at = keys.index(configuration.key)
        before = sum(self._rough[key] for key in keys[:at])
        now = perf_counter()
        if not self._spent:
            self._spent, self._finished = now, before
        text = f"{at + 1} of {len(keys)}: {configuration.label}"
        self._told(text, before, 0.0)

        def show(done: float) -> None:
            self._told(text, before, done * self._rough[configuration.key])

        return show

    def _told(self, text: str, before: float, part: float) -> None:
        done = before + part - self._finished
        taken = perf_counter() - self._spent
        left = max(0.0, self._total - before - part)
        # until something was measured, the rough estimates stand
        pace = taken / done if done > 0.02 * self._total else 1.0
        ends = self._end - perf_counter()
        # past it only what runs now is still to come, or what compiling held up
        self._bar.show((before + part) / self._total, f"ETA {min(pace * left, ends):.0f} s" if ends > 0.0 else "", text)
