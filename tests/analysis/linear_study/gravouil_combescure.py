"""Gravouil and Combescure: velocity continuity at every fine step, near velocities interpolated in time.

A. Gravouil, A. Combescure, Int. J. Numer. Meth. Engng 50 (2001) 199-225. A velocity is split into a free and a link
part, v = v_free + (L Y) lambda; the near side's free part is linear over its step, its link part takes lambda_j with
the near step's compliance:

    (H_near + H_far) lambda_j = -(L_near ((1 - j/m) v_free,0 + j/m v_free,1) + L_far v_free,j)        (1)

Stable with the Newmark family, implicit Euler and BDF2; the seam only ever takes energy (first order in the step) as
soon as m > 1, and positions drift.
"""

from __future__ import annotations

from analysis.linear_study.split import Split, SplitState, force_of, solve


class GravouilCombescure:
    """The near side takes exactly one step."""

    def step(self, split: Split, state: SplitState) -> SplitState:
        near, far, m = split.near, split.far, split.substeps
        near_p, far_p = split.near_propagator, split.far_propagator
        near_u, near_v = slice(0, near.n), slice(near.n, 2 * near.n)
        far_u, far_v = slice(0, far.n), slice(far.n, 2 * far.n)
        h_near = near.link @ near_p.link[near_v]
        h = h_near + far.link @ far_p.link[far_v]
        free_near = near_p.matrix @ state.near + force_of(near, near_p, state.near)
        v_start = near.link @ state.near[near_v] - h_near @ state.lambda_
        v_end = near.link @ free_near[near_v]
        y, lambda_, work = state.far, state.lambda_, state.work
        for j in range(1, m + 1):
            free = far_p.matrix @ y + force_of(far, far_p, y)
            s = j / m
            last = lambda_
            lambda_ = solve(h, (1.0 - s) * v_start + s * v_end + far.link @ free[far_v])  # eq. (1)
            y_next = free + far_p.link @ lambda_
            w = far_p.work_at_end
            work = work + ((w * lambda_ + (1.0 - w) * last) * (far.link @ (y_next[far_u] - y[far_u]))).sum(axis=0)
            y = y_next
        end_near = free_near + near_p.link @ lambda_
        w = near_p.work_at_end
        push = w * lambda_ + (1.0 - w) * state.lambda_
        work = work + (push * (near.link @ (end_near[near_u] - state.near[near_u]))).sum(axis=0)
        return SplitState(end_near, y, lambda_, work)
