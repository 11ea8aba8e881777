"""What finer cells will do, from runs with the same step on coarser ones.

What cells are off by falls with their size. With the reference J*, and with D, which the step s is off by as far as few
cells f tell that were run with it and with a shorter step s0,

    J(c, s) = J* + D + (h_c/h_b)^p [J(b, s) - J* - D],   D = J(f, s) - J(f, s0)            (1)

from the finest cells b that were run. Between them and the next coarser ones each quantity shows its order p; where
there are none, it is taken for 1. What is too fine for a sweep is foretold from what it did, so that only what is
promising is run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from softseam.study.configurations import Fem
from softseam.study.errors import rms
from softseam.study.foretold import Made, Run, by_cells, with_steps
from softseam.study.frame import FEW, Counts
from softseam.study.reference import Reference
from softseam.study.richardson import SLOWEST
from softseam.study.series import Series
from softseam_protocol.scene.spec import Vector

Floats = NDArray[np.float64]

MORE = 8.0
"""finer cells are at most so many times as many as those that were run"""
ACROSS = 20
"""and at most so many along the shortest edge"""
SWIFTEST = 2.0
"""an order above it is not believed: coarse cells are off by more than their size"""
DEARER = 1.55
"""wall time grows with this power of the number of cells that are solved for"""


def refined(runs: Iterable[Run], reference: Reference) -> Iterator[Run]:
    """FEM alone with the default element on finer cells than it was run on with a step, and what it will do by
    eq. (1), each once.

    b are cells of the frame's own levels, equal or graded alike.
    """
    made_by_cells = by_cells(runs)
    steps = with_steps(made_by_cells)
    every = (each for made in made_by_cells.values() for each in made.values() if _is_level(each.fem))
    for _, group in groupby(sorted(every, key=_by_size), key=lambda each: (each.fem.family, each.fem.step)):
        *coarser, base = group
        off = _of_step(base.fem, steps)
        orders = _orders(coarser[-1:], base, off, reference)
        for fem in _finer(base.fem):
            more = fem.n_cells / base.fem.n_cells
            series = _scaled(base.series, off, {k: more ** (-p / 3.0) for k, p in orders.items()}, reference)
            seconds = base.outcome.seconds * (max(FEW, fem.n_solved) / max(FEW, base.fem.n_solved)) ** DEARER
            told = replace(base.outcome, series=series, walls=(seconds,), cpu=0.0)
            yield replace(fem.configuration(), seconds=seconds), told


def _by_size(made: Made) -> tuple[tuple[str, str, bool, Vector, tuple[str, ...]], float, int]:
    return made.fem.family, made.fem.step, made.fem.n_cells


def _levels(fem: Fem) -> Iterator[Counts]:
    """As FEM folds them."""
    return (fem.frame.folding(fem.frame.level(across), fem.towards) for across in range(1, ACROSS + 1))


def _is_level(fem: Fem) -> bool:
    """Whether its cells are a level's, or a sweep's nearly cubic ones, and its element is the default."""
    frame = fem.frame
    plain = [cells(across) for across in range(1, ACROSS + 1) for cells in (frame.level, frame.across)]
    folded = (frame.folding(counts, fem.towards) for counts in plain)
    return fem.element == "hex27" and (fem.counts in plain or fem.counts in folded)


def _finer(fem: Fem) -> list[Fem]:
    """The same on levels of more cells."""
    every = (replace(fem, counts=counts) for counts in dict.fromkeys(_levels(fem)))
    return [one for one in every if fem.n_cells < one.n_cells <= MORE * fem.n_cells]


def _of_step(fem: Fem, steps: Sequence[Mapping[float, Made]]) -> tuple[Series, Series] | None:
    """With this one's step and with the shortest, on the most cells that were run with both; None where none were."""
    for made in reversed(steps):
        shortest = made[min(made)]
        if fem.step in made and shortest.fem.step < fem.step and shortest.fem.integrator == fem.integrator:
            return made[fem.step].series, shortest.series
    return None


def _step_is_off(name: str, off: tuple[Series, Series] | None, time: Floats) -> Floats:
    """D of eq. (1) at times (n,) [s]; nothing where it is not known."""
    if off is None or any(name not in series.values for series in off):
        return np.zeros(len(time))
    return off[0].at(name, time) - off[1].at(name, time)


def _orders(
    coarser: Sequence[Made], base: Made, off: tuple[Series, Series] | None, reference: Reference
) -> dict[str, float]:
    """p of each quantity that the run has and whose truth is known: the slowest where no coarser run tells."""
    found = {name: SLOWEST for name in reference.truth if name in base.series.values}
    for coarse in coarser:
        ratio = (base.fem.n_cells / coarse.fem.n_cells) ** (1.0 / 3.0)
        end = min(base.series.time[-1], coarse.series.time[-1])
        time = reference.time[reference.time <= end + 1e-9]
        for name in found:
            if name in coarse.series.values:
                exact = np.interp(time, reference.time, reference.truth[name].values) + _step_is_off(name, off, time)
                before, now = (rms(made.series.at(name, time) - exact, time) for made in (coarse, base))
                order = np.log(before / now) / np.log(ratio) if before > 0.0 < now else SLOWEST
                found[name] = float(np.clip(order, SLOWEST, SWIFTEST))
    return found


def _scaled(
    base: Series, off: tuple[Series, Series] | None, shares: Mapping[str, float], reference: Reference
) -> Series:
    """Eq. (1) at the run's own times, for quantities with a share of (h_c/h_b)^p."""
    values = {}
    for name, share in shares.items():
        exact = np.interp(base.time, reference.time, reference.truth[name].values)
        exact = exact + _step_is_off(name, off, base.time)
        values[name] = exact + share * (base.values[name] - exact)
    return Series(base.time, base.travel, values)
