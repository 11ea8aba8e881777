"""A seam between sides that tell no compliance: the step is redone under multipliers that an acceleration finds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerated import AcceleratedSeam
from softseam_coupling.loops.one_way import Correct
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome
from softseam_coupling.seam_state import SeamState
from softseam_protocol.messages.participant import Capabilities
from softseam_services.orchestrator.pace import Pace
from softseam_services.orchestrator.seam_answers import (
    Ask,
    SeamDiverged,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
)
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]


class AccelerationLoop:
    """Ties two sides for one epoch; a `SeamScheme`. Arguments as of `RampedSeam`."""

    def __init__(
        self, solver: AcceleratedSeam, tie: SeamTie, mobility: Floats, first: Floats | None, most: int
    ) -> None:
        self._solver, self._tie, self._mobility, self._most = solver, tie, mobility, most
        self.state: SeamState = solver.init(len(mobility) // 3, first)
        self._dt = 0.0
        self.pace = Pace()

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """Nothing is asked for but steps."""

    def multiplier(self) -> Floats:
        """The last committed one (s, 3) [N]."""
        return self.state.multiplier

    def solve(self, ask: Ask, correct: Correct, dt: float, may_cut: bool = False) -> SeamSolution:
        """Exchange until the gap is within the solver's tolerance. Raises SeamDiverged, SeamUnsettled."""
        if dt != self._dt:
            self._solver.guess(self.state, dt * dt * self._mobility)
            self._dt = dt
        lambda_ = self._solver.predict(self.state)
        for exchange in range(1, self._most + 1):
            replies = ask({NEAR: SideRequest(lambda_), FAR: SideRequest(self._tie.far_force(lambda_))})
            answer = self._solver.update(self.state, lambda_, self._tie.gap(replies[NEAR].seam_x, replies[FAR].seam_x))
            if answer.outcome is Outcome.NOT_FINITE:
                raise SeamDiverged(answer.outcome.value)
            if answer.outcome is Outcome.ACCEPT:
                self._solver.commit(self.state, lambda_)
                return SeamSolution(replies, lambda_, answer.gap, exchange, "")
            if exchange < self._most:
                lambda_ = answer.lambda_
        if may_cut:
            raise SeamUnsettled(self._most)
        self._solver.commit(self.state, lambda_)
        return SeamSolution(replies, lambda_, answer.gap, self._most, "the sides' exchanges did not converge")

    def forget_told(self) -> None:
        """Nothing that the sides keep is counted on."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        flags = np.array([self._dt, *self.pace.to_list()], dtype=np.float64)
        return {**self.state.to_arrays(), "flags": flags}

    def take(self, arrays: dict[str, Floats]) -> None:
        """Continue from `to_arrays`."""
        self.state = SeamState.from_arrays(arrays)
        dt, *pace = arrays["flags"].tolist()
        self._dt = float(dt)
        self.pace.take(pace)
