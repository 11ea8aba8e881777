"""What cells will do with a shorter step, from runs that were made: errors of cells and of steps hardly meddle,

    J(c, s) = J(c, s') + [J(f, s) - J(f, s')]                                              (1)

with few cells f that were run with both steps: as a reference is put together (assemble.py). Few cells with short
steps cost next to nothing, and many are run with a long one: what only both at once would reach is foretold from these,
so that only what is promising is run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from softseam.study.configurations import Configuration, Fem
from softseam.study.measure import Outcome
from softseam.study.series import Series

Run = tuple[Configuration, Outcome]


def foretold(runs: Sequence[Run], more: Sequence[Run] = ()) -> Iterator[Run]:
    """FEM alone with shorter steps than its cells were run with, and what it will do by eq. (1), each once.

    f are the most cells that were run with both steps, by the same scheme; what a run will take [s] goes by that of c,
    and by what f took with both.

    more  were not run, but are foretold otherwise (refined.py): they may be c, and not f
    """
    families = with_steps(by_cells(runs))
    for made in by_cells([*more, *runs]).values():
        base = made[min(made)]
        alike = [each for each in families if base.fem.step in each and _any(each).integrator == base.fem.integrator]
        of_most = {step: each for each in alike for step in each if step < base.fem.step}
        for step, each in of_most.items():
            one = replace(base.fem, step=step).configuration()
            # shorter steps take fewer iterations each: what f took of both tells how many times as long
            longer = each[step].outcome.seconds / max(1e-9, each[base.fem.step].outcome.seconds)
            seconds = base.outcome.seconds * min(max(1.0, longer), base.fem.step / step)
            series = _sum(base.series, each[step].series, each[base.fem.step].series)
            yield replace(one, seconds=seconds), replace(base.outcome, series=series)


class Made(NamedTuple):
    """A run of FEM alone."""

    fem: Fem
    outcome: Outcome
    series: Series


def by_cells(runs: Iterable[Run]) -> dict[str, dict[float, Made]]:
    """Those of the runs that are FEM alone and ended well, by their cells and scheme, then by their step [s]."""
    found: dict[str, dict[float, Made]] = {}
    for one, outcome in runs:
        if one.fem is not None and outcome.status == "done" and outcome.series is not None:
            found.setdefault(one.fem.cells, {})[one.fem.step] = Made(one.fem, outcome, outcome.series)
    return found


def with_steps(made_by_cells: Mapping[str, dict[float, Made]]) -> list[dict[float, Made]]:
    """Cells that were run with more than one step; those that say most of it last."""
    return sorted((made for made in made_by_cells.values() if len(made) > 1), key=_standing)


def _any(made: dict[float, Made]) -> Fem:
    return next(iter(made.values())).fem


def _standing(made: dict[float, Made]) -> tuple[int, bool, str]:
    """More cells say more of a step; of as many, the default's."""
    cells = _any(made)
    return cells.n_cells, cells.is_plain, cells.cells


def _sum(base: Series, shorter: Series, longer: Series) -> Series:
    """Eq. (1) at the shorter step's times, for as long as all three lasted: between long steps base and longer are the
    same straight lines, and these cancel."""
    time = shorter.time[shorter.time <= min(base.time[-1], longer.time[-1]) + 1e-9]
    values = {
        name: base.at(name, time) + shorter.at(name, time) - longer.at(name, time)
        for name in base.values
        if name in shorter.values and name in longer.values
    }
    return Series(time, np.interp(time, base.time, base.travel), values)
