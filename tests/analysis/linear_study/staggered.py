"""Staggered Dirichlet-Neumann: the far side first, then the near side where it finds the far one; the failing control.

The far side takes the step with the last multiplier (Neumann), the near side is put where the far side's seam then is
(Dirichlet), and the force that this takes is the next multiplier. Positions agree to the bit; forces lag by a step. An
error of the multiplier becomes -H_near^-1 H_far times itself every step. For short steps that is minus the ratio of the
masses, however short: added mass (Causin, Gerbeau and Nobile, Comput. Methods Appl. Mech. Engng 194, 2005, 4506-4527,
doi:10.1016/j.cma.2004.12.005).
"""

from __future__ import annotations

import numpy as np

from analysis.linear_study.constant_multiplier import answer, march
from analysis.linear_study.split import Split, SplitState, solve


class Staggered:
    """One exchange a step, one side after the other."""

    def step(self, split: Split, state: SplitState) -> SplitState:
        near, far = split.near, split.far
        end_far, work_far = march(far, split.far_propagator, state.far, split.substeps, state.lambda_, state.lambda_)
        none = np.zeros_like(state.lambda_)
        free, _ = march(near, split.near_propagator, state.near, split.substeps_near, none, none)
        h = near.link @ answer(split.near_propagator, split.substeps_near)[: near.n]
        lambda_ = solve(h, near.link @ free[: near.n] + far.link @ end_far[: far.n])
        end_near, work_near = march(
            near, split.near_propagator, state.near, split.substeps_near, state.lambda_, lambda_
        )
        return SplitState(end_near, end_far, lambda_, state.work + work_near + work_far)
