"""Velocity continuity at the end of the macro step, multiplier constant over it: the failing control.

Looks fine on easy cases; the positions drift apart, and with substeps the seam creates energy.
"""

from __future__ import annotations

from analysis.linear_study.constant_multiplier import solve_step
from analysis.linear_study.split import Split, SplitState


class VelocityConstant:
    """Kept to show what not to do."""

    def step(self, split: Split, state: SplitState) -> SplitState:
        return solve_step(split, state, row=1)
