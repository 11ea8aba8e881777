"""Substeps as long as the integrator's error in time allows, by step doubling.

A piece of the step is taken once whole and once in two halves. Of an integrator of order p the halves are off by
  e = share max |x_halves - x_whole| + O(h^(p + 2)),  share = 1/(2^p - 1)                                        (1)
(Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, II.4, on Richardson extrapolation; for BDF2, whose
error depends on the step before, share follows from its error constant). Pieces have the
length 2^-level of the step. One with e above the bound is rejected and bisected, and its first half, known by then, is
the whole of the next try; one that would keep within half the bound at twice its length, as e grows with h^(p + 1), is
followed by such a piece. The halves are kept as they are: extrapolated positions would sink into tools.

Nothing is assumed of the motion, so a first touch, which makes velocities jump and e shrink with h only, is found like
anything else and cut down to the deepest level, where a piece is accepted whatever its error; the report says so.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .integrators.scheme import Scheme
from .integrators.table import halves_share, order
from .kernels.newton import CONVERGED
from .state import FemState

DEEPEST = 10
"""pieces are no shorter than 2^-DEEPEST of the step"""
_MARGIN = 0.5


@dataclass
class Substeps:
    """What it took to get through a step."""

    status: int = CONVERGED
    """of kernels.newton"""
    level: int = 0
    """of the last piece"""
    n_accepted: int = 0
    """substeps that the motion is made of, two a piece"""
    n_rejected: int = 0
    """pieces whose error was too large, or whose equations could not be solved"""
    error: float = 0.0
    """largest e of an accepted piece [m]"""
    tool_work: float = 0.0
    """[J]"""
    iterations: float = 0.0


Take = Callable[[FemState, FemState, int, int], tuple[int, float, float]]
"""take(begin, end, level, place): the substep of length 2^-level from place * 2^-level on, of which end.x is the first
guess; returns status, work of the tools [J] and iterations"""


def advance(
    take: Take, scheme: Scheme, now: FemState, end: FemState, spare: list[FemState], dt: float, bound: float
) -> Substeps:
    """One step from `now` into `end` over dt, in substeps with e <= bound [m]; spare: four states to compute with."""
    growth = 2.0 ** (order(scheme) + 1)
    report = Substeps(level=now.level)
    begin, (whole, first, second, other) = now, spare
    level, place, known = now.level, 0, False
    work = [0.0, 0.0]

    def solve(index: int, start: FemState, result: FemState, guess: FemState | None, depth: int, at: int) -> bool:
        result.x[:] = guess.x if guess is not None else start.x + dt * 0.5**depth * start.v
        report.status, work[index], iterations = take(start, result, depth, at)
        report.iterations += iterations
        return report.status == CONVERGED

    while place < 1 << level:
        known = known or solve(0, begin, whole, None, level, place)
        halved = solve(0, begin, first, None, level + 1, 2 * place)
        good = halved and solve(1, first, second, whole if known else None, level + 1, 2 * place + 1)
        error = np.inf
        if good and known:
            error = halves_share(scheme, dt * 0.5**level, begin.past) * float(np.abs(second.x - whole.x).max())
        if error <= bound or (level == DEEPEST and error < np.inf):
            begin, second = second, other if begin is now else begin
            place, known = place + 1, False
            report.n_accepted += 2
            report.tool_work += work[0] + work[1]
            report.error = max(report.error, error)
            if level > 0 and place % 2 == 0 and error * growth <= _MARGIN * bound:
                level, place = level - 1, place // 2
        elif level == DEEPEST:
            return report
        else:
            report.n_rejected += 1
            level, place, known = level + 1, 2 * place, halved
            whole, first = first, whole
    begin.into(end)
    end.level = report.level = level
    report.status = CONVERGED
    return report
