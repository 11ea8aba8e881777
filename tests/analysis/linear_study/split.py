"""A linear system split in two, near and far, that a coupling scheme puts together again.

One macro step is `step`: near takes one step of its own (or `substeps_near`), far takes `substeps` of them. Every array
may carry a trailing axis of independent copies, which is how the amplification matrix of a scheme is formed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.linear_study.integrators import LinearSide, Propagator, propagate, start

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Split:
    """Two sides, their integrators, the macro step [s] and the substeps of each."""

    near: LinearSide
    far: LinearSide
    step: float
    near_integrator: str = "implicit_euler"
    far_integrator: str = "implicit_euler"
    substeps: int = 1
    """of the far side"""
    substeps_near: int = 1
    near_propagator: Propagator = field(init=False, repr=False)
    far_propagator: Propagator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        near = propagate(self.near, self.near_integrator, self.step / self.substeps_near)
        far = propagate(self.far, self.far_integrator, self.step / self.substeps)
        object.__setattr__(self, "near_propagator", near)
        object.__setattr__(self, "far_propagator", far)

    @property
    def n_seam(self) -> int:
        return len(self.near.link)

    def init(self, u_near: Floats, v_near: Floats, u_far: Floats, v_far: Floats, lambda_: Floats) -> SplitState:
        near = start(self.near, self.near_integrator, self.step / self.substeps_near, u_near, v_near, lambda_)
        far = start(self.far, self.far_integrator, self.step / self.substeps, u_far, v_far, lambda_)
        return SplitState(near, far, np.array(lambda_, dtype=np.float64), 0.0)

    def gap(self, state: SplitState) -> Floats:
        """Position gap L_near u_near + L_far u_far (s,) [m]."""
        return self.near.link @ state.near[: self.near.n] + self.far.link @ state.far[: self.far.n]

    def energy(self, state: SplitState) -> float:
        return self.near.energy(state.near) + self.far.energy(state.far)


@dataclass(frozen=True)
class SplitState:
    """Both sides and the multiplier at the end of a macro step."""

    near: Floats
    """(4 n_near,)"""
    far: Floats
    """(4 n_far,)"""
    lambda_: Floats
    """(s,) [N], force on the near side"""
    work: float | Floats
    """work of the seam on both sides since the start [J]"""


class Scheme(Protocol):
    """A way to couple two sides over a macro step."""

    def step(self, split: Split, state: SplitState) -> SplitState: ...


def force_of(side: LinearSide, propagator: Propagator, like: Floats) -> Floats:
    """The load's share of a step, shaped for the copies that `like` carries (4n,) or (4n, k)."""
    share = propagator.force @ side.force()
    return share if like.ndim == 1 else share[:, None]


def solve(compliance: Floats, gap: Floats) -> Floats:
    """Multiplier that closes a gap: compliance lambda = -gap, as in `seam.py`; (s,) or (s, k)."""
    return np.linalg.solve(compliance, -gap).astype(np.float64, copy=False)


def run(scheme: Scheme, split: Split, state: SplitState, n_steps: int) -> list[SplitState]:
    """States after 0, 1, ..., n_steps macro steps."""
    states = [state]
    for _ in range(n_steps):
        states.append(scheme.step(split, states[-1]))
    return states


def amplification(scheme: Scheme, split: Split) -> Floats:
    """Matrix that takes (near, far, lambda) over one macro step without loads."""
    sizes = (4 * split.near.n, 4 * split.far.n, split.n_seam)
    eye = np.eye(sum(sizes))
    near, far, lambda_ = np.split(eye, np.cumsum(sizes)[:-1])
    after = scheme.step(split, SplitState(near, far, lambda_, np.zeros(len(eye))))
    return np.vstack([after.near, after.far, after.lambda_])


def spectral_radius(scheme: Scheme, split: Split) -> float:
    return float(np.abs(np.linalg.eigvals(amplification(scheme, split))).max())
