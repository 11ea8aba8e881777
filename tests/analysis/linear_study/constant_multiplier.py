"""What the two schemes with one constant multiplier a macro step share: march a side, and solve for the multiplier.

A side's end state is linear in the multiplier, y_end = y_free + Y lambda, so the continuity of row r (u or v) is

    (L_near Y_near,r + L_far Y_far,r) lambda = -(L_near y_near,r + L_far y_far,r)_free
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.linear_study.integrators import LinearSide, Propagator
from analysis.linear_study.split import Split, SplitState, force_of, solve

Floats = NDArray[np.float64]


def march(
    side: LinearSide, propagator: Propagator, y: Floats, m: int, lambda_last: Floats, lambda_: Floats
) -> tuple[Floats, Floats]:
    """m steps with a constant multiplier; the end state and the work of the seam on this side [J]."""
    n = side.n
    share = propagator.link @ lambda_ + force_of(side, propagator, y)
    work = np.zeros(y.shape[1:])
    before = lambda_last
    for _ in range(m):
        y_next = propagator.matrix @ y + share
        w = propagator.work_at_end if propagator.where == 1.0 else 1.0
        work = work + ((w * lambda_ + (1.0 - w) * before) * (side.link @ (y_next[:n] - y[:n]))).sum(axis=0)
        y, before = y_next, lambda_
    return y, work


def answer(propagator: Propagator, m: int) -> Floats:
    """Y (4n, s): end state after m steps from rest per unit of constant multiplier."""
    y = np.zeros_like(propagator.link)
    for _ in range(m):
        y = propagator.matrix @ y + propagator.link
    return y


def solve_step(split: Split, state: SplitState, row: int) -> SplitState:
    """One macro step with continuity of row 0 (positions) or 1 (velocities) at its end."""
    near, far = split.near, split.far
    near_rows = slice(row * near.n, (row + 1) * near.n)
    far_rows = slice(row * far.n, (row + 1) * far.n)
    y_near, y_far = answer(split.near_propagator, split.substeps_near), answer(split.far_propagator, split.substeps)
    h = near.link @ y_near[near_rows] + far.link @ y_far[far_rows]
    none = np.zeros_like(state.lambda_)
    free_near, _ = march(near, split.near_propagator, state.near, split.substeps_near, none, none)
    free_far, _ = march(far, split.far_propagator, state.far, split.substeps, none, none)
    lambda_ = solve(h, near.link @ free_near[near_rows] + far.link @ free_far[far_rows])
    end_near, work_near = march(near, split.near_propagator, state.near, split.substeps_near, state.lambda_, lambda_)
    end_far, work_far = march(far, split.far_propagator, state.far, split.substeps, state.lambda_, lambda_)
    return SplitState(end_near, end_far, lambda_, state.work + work_near + work_far)
