"""Prakash and Hjelmstad: velocity continuity at the end of the macro step, multiplier linear over it.

A. Prakash, K. D. Hjelmstad, Int. J. Numer. Meth. Engng 61 (2004) 2183-2204, doi:10.1002/nme.1136. The far side's
substep j sees lambda_j = lambda_n + theta_j (lambda_(n+1) - lambda_n), theta_j = (j - 1 + where)/m. No work at the seam
for trapezoidal Newmark on both sides. Stable with implicit Euler, BDF2 and Newmark, and with midpoint only where the
near side gets the ramp's value at its midpoint (`where` = 1/2), not the one at the end. Positions drift.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.linear_study.integrators import LinearSide, Propagator
from analysis.linear_study.split import Split, SplitState, force_of, solve

Floats = NDArray[np.float64]


class PrakashHjelmstad:
    """Needs an initial multiplier that is consistent with the initial state."""

    def step(self, split: Split, state: SplitState) -> SplitState:
        near, far = split.near, split.far
        near_v, far_v = slice(near.n, 2 * near.n), slice(far.n, 2 * far.n)
        none = np.zeros_like(state.lambda_)
        y_near = _answer(split.near_propagator, split.substeps_near)
        y_far = _answer(split.far_propagator, split.substeps)
        h = near.link @ y_near[near_v] + far.link @ y_far[far_v]
        last = state.lambda_
        free_near, _ = _march(near, split.near_propagator, state.near, split.substeps_near, last, none)
        free_far, _ = _march(far, split.far_propagator, state.far, split.substeps, last, none)
        lambda_ = solve(h, near.link @ free_near[near_v] + far.link @ free_far[far_v])
        end_near, work_near = _march(near, split.near_propagator, state.near, split.substeps_near, last, lambda_)
        end_far, work_far = _march(far, split.far_propagator, state.far, split.substeps, last, lambda_)
        return SplitState(end_near, end_far, lambda_, state.work + work_near + work_far)


def _march(
    side: LinearSide, propagator: Propagator, y: Floats, m: int, first: Floats, last: Floats
) -> tuple[Floats, Floats]:
    """m steps with the multiplier going from `first` to `last`; the end state and the work of the seam [J]."""
    n = side.n
    share = force_of(side, propagator, y)
    work = np.zeros(y.shape[1:])
    for j in range(m):
        theta = (j + propagator.where) / m
        y_next = propagator.matrix @ y + propagator.link @ (first + theta * (last - first)) + share
        mean = theta if propagator.where < 1.0 else (j + propagator.work_at_end) / m
        work = work + ((first + mean * (last - first)) * (side.link @ (y_next[:n] - y[:n]))).sum(axis=0)
        y = y_next
    return y, work


def _answer(propagator: Propagator, m: int) -> Floats:
    """End state after m steps from rest per unit of the multiplier at the end, starting from zero (4n, s)."""
    y = np.zeros_like(propagator.link)
    for j in range(m):
        y = propagator.matrix @ y + (j + propagator.where) / m * propagator.link
    return y
