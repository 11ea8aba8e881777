"""The seam between participants that give no compliance: a fixed-point iteration on the gap, accelerated.

In place of the compliance there is a rough guess of its diagonal, `guess`, which makes a force of a gap; how the sides
really answer is for the acceleration to find out (`accelerations`). Everything else is `SeamSolver`'s: predictions,
history, the largest gap that is accepted.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softseam_coupling.accelerations.iqn_ils import IqnIls
from softseam_coupling.accelerations.memory import Acceleration, Floats
from softseam_coupling.kernels.quasi_newton import largest_node
from softseam_coupling.seam import Outcome, SeamRound, SeamSolver
from softseam_coupling.seam_state import SeamState

__all__ = ["AcceleratedSeam"]


@dataclass(frozen=True)
class AcceleratedSeam(SeamSolver):
    """`SeamSolver` without a compliance: never asks for one."""

    acceleration: Acceleration = field(default_factory=IqnIls)

    def init(self, n_nodes: int, lambda_: Floats | None = None) -> SeamState:
        """A state to `guess` for before the first `update`; arguments as in `SeamSolver.init`."""
        state = super().init(n_nodes, lambda_)
        state.memory = self.acceleration.init(3 * n_nodes)
        return state

    def guess(self, state: SeamState, diagonal: Floats) -> None:
        """Take (n,) > 0 [m/N] for the diagonal of the compliance."""
        if diagonal.shape != state.scale.shape or not (diagonal > 0.0).all() or not np.isfinite(diagonal).all():
            raise ValueError(f"the guess must be {state.scale.shape} finite compliances > 0 m/N: {diagonal.shape}")
        state.scale[:] = diagonal
        state.rank = len(diagonal)

    def predict(self, state: SeamState) -> Floats:
        self.acceleration.begin(state.memory)
        return super().predict(state)

    def update(self, state: SeamState, lambda_: Floats, gap: Floats) -> SeamRound:
        """Take the gap (s, 3) [m] that lambda_ (s, 3) [N] left; the outcome is never REBUILD."""
        tried = np.array(lambda_, dtype=np.float64).reshape(-1)
        left = np.array(gap, dtype=np.float64).reshape(-1)
        largest = float(largest_node(left))
        if not (np.isfinite(largest) and np.isfinite(tried).all()):
            return SeamRound(Outcome.NOT_FINITE, state.multiplier, float("nan"), float("inf"))
        before = float(np.linalg.norm(state.tried[1]))
        kappa = float(np.linalg.norm(left)) / before if state.n_tried > 0 and before > 0.0 else float("inf")
        after = self.acceleration.next(state.memory, tried, -left / state.scale)
        state.tried[0], state.tried[1], state.closing[:] = tried, left, after
        state.n_tried += 1
        outcome = Outcome.ACCEPT if largest <= self.tolerance else Outcome.AGAIN
        return SeamRound(outcome, after.reshape(-1, 3), largest, kappa)

    def commit(self, state: SeamState, lambda_: Floats) -> None:
        super().commit(state, lambda_)
        self.acceleration.end(state.memory)
