"""A staggered seam, Dirichlet on the near side, Neumann on the far one: the control that is to fail, in the real loop.

The far side takes the step with the last multiplier. The near side is then put where the far side's seam is,

    x_near(lambda) = P x_far + c,   by lambda -= H_near^-1 (x_near(lambda) - P x_far - c),                     (1)

a Newton iteration that asks the near side alone; what holds it there is the next multiplier. Positions agree, forces
lag by a step, so that an error of the multiplier becomes -H_near^-1 H_far times itself, in short steps minus the ratio
of the masses (`softseam_coupling.schemes.staggered`). Where that grows it is seen and told, and the run ends.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.one_way import Correct
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome, SeamSolver
from softseam_coupling.seam_state import SeamState
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import Capabilities
from softseam_services.orchestrator.pace import Pace
from softseam_services.orchestrator.seam_answers import Ask, SeamDiverged, SeamSolution, SideRequest, largest
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]

_GROWN, _STEPS = 1e3, 3
"""the multiplier's changes from step to step alternate and grow: so much in all, over at least so many steps, is no
oscillation of the body's [1]"""
_REMEDY = "added mass, which shorter steps do not cure; use seam: {scheme: position}"


class StaggeredSeam:
    """Ties two sides for one epoch; a `SeamScheme`. Arguments as of `RampedSeam`."""

    def __init__(self, solver: SeamSolver, tie: SeamTie, first: Floats | None, most: int):
        self._solver, self._tie, self._most = solver, tie, most
        self.state: SeamState = solver.init(len(tie.c), first)
        self._fresh, self._dt = True, 0.0
        self._change = np.zeros(tie.c.size)
        self._grown, self._n_grown = 1.0, 0
        self.pace = Pace()

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """Steps of such a seam are not corrected."""

    def multiplier(self) -> Floats:
        """The last committed one (s, 3) [N]."""
        return self.state.multiplier

    def solve(self, ask: Ask, correct: Correct, dt: float, may_cut: bool = False) -> SeamSolution:
        """The far side's step, then the near side's. Raises SeamDiverged; a cut would not help, none is asked for."""
        if dt != self._dt:
            self._fresh, self._dt = True, dt
        last, lambda_ = self.state.multiplier, self._solver.predict(self.state)
        far = ask({FAR: SideRequest(self._tie.far_force(last))})[FAR]
        image = self._tie.image(far.seam_x)
        for exchange in range(2, self._most + 1):
            compliance = self._fresh
            near = ask({NEAR: SideRequest(lambda_, compliance)})[NEAR]
            if compliance and near.compliance.size:
                self._solver.reset(self.state, near.compliance)
                self._fresh = False
            answer = self._solver.update(self.state, lambda_, near.seam_x - image)
            if answer.outcome is Outcome.ACCEPT and not self._fresh:
                self._watch((lambda_ - last).reshape(-1))
                self._solver.commit(self.state, lambda_)
                gap = largest(self._tie.gap(near.seam_x, far.seam_x))
                return SeamSolution({NEAR: near, FAR: far}, lambda_, gap, exchange, "")
            if answer.outcome is Outcome.NOT_FINITE or near.status is not Status.CONVERGED:
                break
            self._fresh = answer.outcome is Outcome.REBUILD and not compliance
            lambda_ = answer.lambda_
        raise SeamDiverged(f"staggered: the near side cannot be put where the far side went: {_REMEDY}")

    def _watch(self, change: Floats) -> None:
        """Follow how the multiplier's change of a step (3s,) [N] grows over the one before where they alternate."""
        before = float(np.linalg.norm(self._change))
        size = float(np.linalg.norm(change))
        if before > 0.0 and size > before and float(change @ self._change) < 0.0:
            self._grown, self._n_grown = self._grown * size / before, self._n_grown + 1
        else:
            self._grown, self._n_grown = 1.0, 0
        self._change = change
        if self._grown > _GROWN and self._n_grown >= _STEPS:
            raise SeamDiverged(
                f"staggered: the multiplier alternates and has grown {self._grown:.1e} times in {self._n_grown} steps: "
                f"{_REMEDY}"
            )

    def forget_told(self) -> None:
        """Nothing that the sides keep is counted on."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        numbers = [self._fresh, self._dt, self._grown, self._n_grown, *self.pace.to_list()]
        flags = np.array(numbers, dtype=np.float64)
        return {**self.state.to_arrays(), "change": self._change.copy(), "flags": flags}

    def take(self, arrays: dict[str, Floats]) -> None:
        """Continue from `to_arrays`."""
        self.state = SeamState.from_arrays(arrays)
        self._change = np.array(arrays["change"])
        fresh, dt, grown, n_grown, *pace = arrays["flags"].tolist()
        self._fresh, self._dt, self._grown, self._n_grown = bool(fresh), dt, grown, int(n_grown)
        self.pace.take(pace)
