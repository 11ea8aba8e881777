"""The loop of Prakash and Hjelmstad: velocities agree at the end of a step, multipliers are linear over it.

With lambda_0 known from the step before, all parts advance under lambda_0 + (t/dT) (lambda_1 - lambda_0): substep j of
m feels it at t = j dT/m, a part without substeps where its integrator takes forces (at the end; midpoint in the
middle). The unknown is lambda_1, and what it is to close is the gap that the step would open,

    dT sum_p B_p v_p + r = 0,   W = dT sum_p B_p (dv_p/df_p) B_p^T                                             (1)

with r what the steps before left of it, within the tolerance, so that this does not add up

(A. Prakash, K. D. Hjelmstad, Int. J. Numer. Meth. Engng 61, 2004, 2183-2204, doi:10.1002/nme.1136). Stable with every
implicit integrator of FEM, see `analysis.linear_study.prakash_hjelmstad`; positions drift by what the parts do
within a step, and the gap that is reported is that of positions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.accelerations.memory import Acceleration
from analysis.loops.fixed_point import FixedPoint
from softseam_coupling.loops.coupled_part import gap_of, parts_of
from softseam_coupling.loops.loop import (
    NOT_CONVERGED,
    Ask,
    Correct,
    LoopSetup,
    Outcome,
    PartRequest,
    StepDiverged,
    StepRefused,
    largest,
)
from softseam_protocol.messages.participant import Advanced, Capabilities

Floats = NDArray[np.float64]


class PrakashHjelmstad:
    """A `Loop` of any parts and interfaces."""

    def __init__(self, setup: LoopSetup, acceleration: Acceleration | None = None) -> None:
        self._setup = setup
        self._parts, self._offset = parts_of(setup.interfaces, {name: len(m) for name, m in setup.mobility.items()})
        self._found = FixedPoint(self._parts, setup.mobility, setup.first, acceleration)
        self._left = np.zeros_like(self._offset)  # r of eq. (1) [m]

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """Steps of this loop are not corrected."""

    def multipliers(self) -> Floats:
        """The last committed ones, at the end of their step (c, 3) [N]."""
        return self._found.last

    def solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool = False) -> Outcome:
        """Redo the step until it opens no more than the tolerance."""
        most = self._setup.exchanges
        start, multipliers = self._found.last, self._found.begin(dt)
        for exchange in range(1, most + 1):
            replies = ask(
                {
                    name: PartRequest(part.force(multipliers), self._found.asks, start=part.force(start))
                    for name, part in self._parts.items()
                }
            )
            self._hear(replies, dt)
            rate = gap_of(
                self._parts, {name: reply.coupling.v for name, reply in replies.items()}, np.zeros_like(start)
            )
            left = dt * rate + self._left  # eq. (1)
            if not math.isfinite(largest(left)):
                raise StepDiverged("a part's answer is not finite")
            proposed = self._found.next(multipliers, left)
            if largest(left) <= self._setup.tolerance:
                return self._commit(replies, multipliers, left, exchange, "")
            if exchange < most:
                multipliers = proposed
        if may_refuse:
            raise StepRefused(most)
        return self._commit(replies, multipliers, left, most, NOT_CONVERGED)

    def _hear(self, replies: Mapping[str, Advanced], dt: float) -> None:
        """Take the compliances, where they were asked for and all parts report theirs."""
        if not self._found.asks or not all(reply.coupling.compliance.size for reply in replies.values()):
            return
        for name, part in self._parts.items():
            part.compliance = dt * replies[name].coupling.compliance
        self._found.set_compliance(np.sum([part.row_compliance() for part in self._parts.values()], axis=0))

    def _commit(
        self, replies: dict[str, Advanced], multipliers: Floats, left: Floats, exchanges: int, note: str
    ) -> Outcome:
        self._found.commit(multipliers)
        self._left = left
        gap = largest(gap_of(self._parts, {name: reply.coupling.x for name, reply in replies.items()}, self._offset))
        return Outcome(replies, multipliers, gap, exchanges, note)

    def forget_sent(self) -> None:
        """Nothing that the parts keep is counted on."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        return {**self._found.to_arrays(), "left": self._left.copy()}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._found.take(arrays)
        self._left[:] = arrays["left"]
