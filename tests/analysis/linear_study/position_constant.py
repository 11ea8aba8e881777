"""Position continuity at the end of the macro step, multiplier constant over it: the default.

Stable with implicit Euler or midpoint on the near side and implicit Euler on the far side, any number of substeps. With
implicit Euler a side's balance is dE = lambda . L du - |dv|_M^2/2 - |du|_K^2/2; the gap being zero at both ends of the
step, the seam's work on both sides cancels exactly. Unstable with BDF2 and Newmark on the near side.
"""

from __future__ import annotations

from analysis.linear_study.constant_multiplier import solve_step
from analysis.linear_study.split import Split, SplitState


class PositionConstant:
    """The absolute gap enters every step, so that it does not accumulate."""

    def step(self, split: Split, state: SplitState) -> SplitState:
        return solve_step(split, state, row=0)
