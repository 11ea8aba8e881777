"""The seam: one multiplier a macro step holds the shared nodes of two regions together.

Sign convention, fixed here and nowhere else. At the s shared nodes

    gap g = x_near - x_far                  (s, 3) [m], at the end of the step, absolute
    multiplier lambda                       (s, 3) [N], the force on the NEAR side; the far side feels -lambda

so a positive multiplier pushes the near side along the positive axis. In matrix form A u = f + B^T lambda, B u = g
with B = (+1 on near, -1 on far). With the compliances H = d(seam x)/d(seam force), both positive semidefinite, the dual
system of a round is

    (H_near + H_far) dlambda = -g                                             (1)

`SeamSolver` is the configuration and never changes; `SeamState` is everything that evolves; `SeamRound` is the answer
of one round. A step of the orchestrator:

    lambda_ = solver.predict(state)
    while True:
        gap = <advance near with +lambda_ and far with -lambda_>
        answer = solver.update(state, lambda_, gap)
        if answer.outcome is Outcome.ACCEPT: break
        if answer.outcome is Outcome.REBUILD: <ask for compliances with the next exchange>, solver.reset(state, H)
        lambda_ = answer.lambda_
    solver.commit(state, lambda_)
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.inverse import invert_definite
from softseam_coupling.kernels.extrapolate import (
    INERTIA,
    LENGTHS,
    N_FIT,
    NAMES,
    WEIGHTS,
    extrapolate,
    remember,
)
from softseam_coupling.kernels.quasi_newton import exchange_round
from softseam_coupling.seam_state import SeamState

Floats = NDArray[np.float64]

__all__ = ["Outcome", "SeamRound", "SeamSolver"]


_LINEAR = len(INERTIA) * NAMES.index("linear")
_UNSEEN = 0.005
"""gap, in tolerances, below which a change of the multiplier teaches its prediction nothing [1]"""


class Outcome(Enum):
    """What to do after a round; the text is fit for a person."""

    ACCEPT = "the two sides agree"
    AGAIN = "the gap shrinks: exchange once more"
    REBUILD = "the gap hardly shrinks: ask both sides for their compliance and reset the seam"
    NOT_FINITE = "a side answered with NaN or infinity: go back to the committed state and cut the step"


@dataclass(frozen=True, slots=True)
class SeamRound:
    """Answer of one round."""

    outcome: Outcome
    lambda_: Floats
    """multiplier to try next (s, 3) [N]; the last committed one where the gap was not finite"""
    gap: float
    """largest nodal gap of the multiplier just tried [m]"""
    kappa: float
    """norm of the residual over that of the round before [1]; infinite in the first round"""


@dataclass(frozen=True)
class SeamSolver:
    """Dual seam solver: exact compliance, then good-Broyden corrections kept across steps."""

    tolerance: float
    """largest nodal gap that is accepted [m]"""
    slack: float = 1.0
    """a round that cut the residual to kappa_accept may leave slack * tolerance: the gap does not accumulate [1]"""
    kappa_accept: float = 0.1
    kappa_rebuild: float = 0.5
    """a round that leaves more than this fraction asks for a new compliance [1]"""
    predictor: str = "auto"
    """'auto' (the one that would have left the smallest gap lately) or a name of `extrapolate.NAMES`"""
    regularisation: float = 0.0
    """compliance of an implicit spring in the seam, in mean diagonals of H; damps a sawtooth in lambda [1]"""
    spring_gap: float = 0.0
    """most gap that the spring may open [m]: its compliance is cut to spring_gap / max |lambda|"""
    truncation: float = 1e-8
    """eigenvalues of H below truncation * largest are redundant constraints and dropped [1]"""
    noise: float = 0.0
    """a pair of rounds whose gaps differ by less at every node is not learned from [m]"""

    def __post_init__(self) -> None:
        if not self.tolerance > 0.0:
            raise ValueError(f"the seam's tolerance must be positive, not {self.tolerance}")
        if self.predictor not in ("auto", *NAMES):
            raise ValueError(f"unknown predictor {self.predictor!r}: use 'auto' or one of {', '.join(NAMES)}")
        if not 0.0 <= self.regularisation <= 1.0:
            raise ValueError(f"regularisation must lie in [0, 1] mean diagonals of H, not {self.regularisation}")

    def init(self, n_nodes: int, lambda_: Floats | None = None) -> SeamState:
        """A state without compliance; call `reset` before the first `update`.

        lambda_  (s, 3) [N]  first prediction (zero if absent)
        """
        n = 3 * n_nodes
        state = SeamState(
            inverse=np.zeros((n, n)),
            history=np.zeros((WEIGHTS.shape[1], n)),
            tried=np.zeros((4, n)),
            closing=np.zeros(n),
            scale=np.ones(n),
            errors=np.full(len(LENGTHS), np.inf),
            weights=WEIGHTS.copy(),
            moments=np.zeros((N_FIT, N_FIT + 1)),
            _work=np.zeros((4, n)),
        )
        if lambda_ is not None:
            state.history[0] = lambda_.reshape(n)
            state.n_history = 1
        return state

    def reset(self, state: SeamState, compliance: Floats) -> int:
        """Take a new compliance H_near + H_far and forget all corrections; history of multipliers stays.

        compliance  (3s, 3s) [m/N]; its symmetric part is used
        Returns the rank: fewer than 3 s where constraints are redundant (two regions clamp the same node, cross points)
        or where neither side yields. Raises ValueError for a compliance that is not finite or nowhere positive.
        """
        n = 3 * state.n_nodes
        if compliance.shape != (n, n):
            raise ValueError(f"compliance has shape {compliance.shape}, the seam wants {(n, n)}")
        h = 0.5 * (compliance + compliance.T)
        if not np.isfinite(h).all():
            raise ValueError("the seam compliance holds NaN or infinity: rebuild the regions from the last checkpoint")
        state.n_tried = 0
        if n == 0:
            return 0
        diagonal = np.diagonal(h).copy()
        mean = float(diagonal.mean())
        if not mean > 0.0:
            raise ValueError("neither side of the seam yields to a force: are all seam nodes clamped?")
        state.scale[:] = diagonal
        if self.regularisation > 0.0:
            h[np.diag_indices(n)] += self.regularisation * mean
        state.rank = _invert(h, self.truncation, state.inverse)
        return state.rank

    def predict(self, state: SeamState) -> Floats:
        """Multiplier for the first exchange of a step (s, 3) [N]; a new array."""
        out = np.empty(3 * state.n_nodes)
        first, last = 0, len(LENGTHS)
        if self.predictor != "auto":
            first = len(INERTIA) * NAMES.index(self.predictor)
            last = first + len(INERTIA)
        state.predictor = extrapolate(
            state.history, state.n_history, state.weights, LENGTHS, state.errors, first, last, out
        )
        state.n_tried = 0
        state.spring = 0.0
        if self.regularisation > 0.0 and out.size:
            largest = float(np.abs(out).max())
            nominal = self.regularisation * float(state.scale.mean())
            state.spring = min(nominal, self.spring_gap / largest) if largest > 0.0 else nominal
        return out.reshape(-1, 3)

    def update(self, state: SeamState, lambda_: Floats, gap: Floats) -> SeamRound:
        """Take the gap (s, 3) [m] that lambda_ (s, 3) [N] left and say what to do next."""
        out = np.empty(3 * state.n_nodes)
        largest, residual, kappa, _ = exchange_round(
            state.inverse,
            state.tried,
            state._work,
            np.ascontiguousarray(lambda_).reshape(-1),
            np.ascontiguousarray(gap).reshape(-1),
            state.spring,
            state.n_tried,
            self.noise,
            out,
        )
        if np.isnan(largest):
            return SeamRound(Outcome.NOT_FINITE, state.multiplier, float("nan"), float("inf"))
        state.closing[:] = out
        first = state.n_tried == 0
        state.n_tried += 1
        if residual <= self.tolerance or (kappa <= self.kappa_accept and residual <= self.slack * self.tolerance):
            outcome = Outcome.ACCEPT
        elif first or kappa <= self.kappa_rebuild:
            outcome = Outcome.AGAIN
        else:
            outcome = Outcome.REBUILD
        return SeamRound(outcome, out.reshape(-1, 3), largest, kappa)

    def commit(self, state: SeamState, lambda_: Floats) -> None:
        """Accept the multiplier of the step: it enters the history, and every way to predict is scored on it."""
        flat = np.ascontiguousarray(lambda_).reshape(-1)
        tried = state.n_tried > 0 and np.array_equal(flat, state.tried[0])
        closing = state.closing if tried else flat  # a multiplier found in another way is taken at its word
        state.n_history = remember(
            state.history, state.n_history, state.weights, LENGTHS, state.scale, flat, closing, state.errors,
            state.moments, _UNSEEN * self.tolerance,
        )  # fmt: skip
        state.n_tried = 0

    def go_on(self, state: SeamState, way: Floats) -> None:
        """Know of the only step committed so far what moves on by `way` (s, 3) a step: it is predicted to do so again.

        Nothing was scored yet, and of what moves none but the constant way to predict could be.
        """
        state.history[1] = state.history[0] - way.reshape(-1)
        state.n_history, state.errors[_LINEAR] = 2, 0.0


def _invert(h: Floats, truncation: float, out: Floats) -> int:
    """Inverse of a symmetric (n, n) matrix into `out`, without the eigenvectors below truncation * largest; the rank.

    Cholesky where LAPACK's condition estimate allows it; else the eigenvectors, about twenty times dearer.
    """
    inverse = invert_definite(h, truncation)
    if inverse is not None:
        out[:] = inverse
        return len(h)
    values, vectors = np.linalg.eigh(h)
    kept = values > truncation * values[-1]
    out[:] = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    return int(np.count_nonzero(kept))
