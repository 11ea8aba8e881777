"""A seam of Prakash and Hjelmstad: velocities agree at the end of a step, the multiplier is linear over it.

With lambda_0 known from the step before, both sides advance under lambda_0 + (t/dT) (lambda_1 - lambda_0): the far
side's substep j feels it at t = j dT/m, the near side where its integrator takes forces (at the end; midpoint in the
middle). The unknown is lambda_1, and what it is to close is the gap that the step would open,

    dT (v_near - P v_far) + r = 0,   H = dT (dv_near/dlambda + P dv_far/dlambda P^T)                            (1)

with r what the steps before left of it, within the tolerance, so that this does not add up

(A. Prakash, K. D. Hjelmstad, Int. J. Numer. Meth. Engng 61, 2004, 2183-2204, doi:10.1002/nme.1136). Stable with every
implicit integrator of FEM, see `softseam_coupling.schemes.prakash_hjelmstad`; positions drift by what the sides do
within a step, and the gap that is reported is that of positions.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerated import AcceleratedSeam
from softseam_coupling.loops.one_way import Correct
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome, SeamSolver
from softseam_coupling.seam_state import SeamState
from softseam_protocol.messages.participant import Advanced, Capabilities
from softseam_services.orchestrator.pace import Pace
from softseam_services.orchestrator.seam_answers import (
    Ask,
    SeamDiverged,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
    largest,
)
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]


class RampedSeam:
    """Ties two sides for one epoch; a `SeamScheme`.

    mobility  1/mass of the seam's nodes on both sides (3s,) [1/kg]: a guess where no compliance is to be asked for
    first     multiplier that belongs to the sides' state (s, 3) [N], zero if absent: that of a body at rest in shape
    most      exchanges a step
    """

    def __init__(self, solver: SeamSolver, tie: SeamTie, mobility: Floats, first: Floats | None, most: int):
        self._solver, self._tie, self._mobility, self._most = solver, tie, mobility, most
        self.state: SeamState = solver.init(len(mobility) // 3, first)
        self._fresh, self._dt = True, 0.0
        self._left = np.zeros_like(tie.c)  # r of eq. (1) [m]
        self.pace = Pace()

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """Steps of such a seam are not corrected."""

    def multiplier(self) -> Floats:
        """The last committed one, at the end of its step (s, 3) [N]."""
        return self.state.multiplier

    def solve(self, ask: Ask, correct: Correct, dt: float, may_cut: bool = False) -> SeamSolution:
        """Exchange until the step opens no more than the solver's tolerance. Raises SeamDiverged, SeamUnsettled."""
        if dt != self._dt:
            self._dt = dt
            if isinstance(self._solver, AcceleratedSeam):
                self._solver.guess(self.state, dt * dt * self._mobility)
                self._fresh = False
            else:
                self._fresh = True
        start, lambda_ = self.state.multiplier, self._solver.predict(self.state)
        start_far = self._tie.far_force(start)
        replies: dict[str, Advanced] = {}
        for exchange in range(1, self._most + 1):
            compliance = self._fresh
            replies = ask(
                {
                    NEAR: SideRequest(lambda_, compliance, start=start),
                    FAR: SideRequest(self._tie.far_force(lambda_), compliance, start=start_far),
                }
            )
            near, far = replies[NEAR], replies[FAR]
            if compliance:
                self._rebuild(near.compliance, far.compliance)
            left = dt * self._tie.rate(near.seam_v, far.seam_v) + self._left
            answer = self._solver.update(self.state, lambda_, left)
            if answer.outcome is Outcome.NOT_FINITE:
                raise SeamDiverged(answer.outcome.value)
            if answer.outcome is Outcome.ACCEPT:
                return self._agree(replies, lambda_, left, exchange, "")
            if exchange < self._most:
                self._fresh = answer.outcome is Outcome.REBUILD and not compliance
                lambda_ = answer.lambda_
        if may_cut:
            raise SeamUnsettled(self._most)
        return self._agree(replies, lambda_, left, self._most, "the sides' exchanges did not converge")

    def _rebuild(self, near: Floats, far: Floats) -> None:
        if near.size == 0 or near.size != far.size or not np.isfinite(near + far).all():
            return  # a solve that failed has no compliance; ask again
        self._solver.reset(self.state, self._dt * self._tie.compliance(near, far))  # eq. (1)
        self._fresh = False

    def _agree(
        self, replies: dict[str, Advanced], lambda_: Floats, left: Floats, exchanges: int, note: str
    ) -> SeamSolution:
        self._solver.commit(self.state, lambda_)
        self._left = left
        gap = largest(self._tie.gap(replies[NEAR].seam_x, replies[FAR].seam_x))
        return SeamSolution(replies, lambda_, gap, exchanges, note)

    def forget_told(self) -> None:
        """Nothing that the sides keep is counted on."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        flags = np.array([self._fresh, self._dt, *self.pace.to_list()], dtype=np.float64)
        return {**self.state.to_arrays(), "left": self._left.copy(), "flags": flags}

    def take(self, arrays: dict[str, Floats]) -> None:
        """Continue from `to_arrays`."""
        self.state = SeamState.from_arrays(arrays)
        self._left = np.array(arrays["left"])
        fresh, dt, *pace = arrays["flags"].tolist()
        self._fresh, self._dt = bool(fresh), dt
        self.pace.take(pace)
