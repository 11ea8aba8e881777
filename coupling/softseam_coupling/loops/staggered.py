"""A staggered loop, Dirichlet on one part, Neumann on the other: the control that is to fail, in the real loop.

Part b of the interface takes the step with the last multiplier. Part a is then put where b's nodes went,

    w_a x_a(lambda) = w_b x_b + offset,   by lambda -= H_a^-1 (w_a x_a(lambda) - w_b x_b - offset),            (1)

an iteration that asks part a alone; what holds it there is the next multiplier. Positions agree, forces lag by a step,
so that an error of the multiplier becomes -H_a^-1 H_b times itself, in short steps minus the ratio of the masses. Where
that grows the run ends with an error.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.coupled_part import HARDLY, gap_of, parts_of
from softseam_coupling.loops.doubt import STALE
from softseam_coupling.loops.loop import (
    Ask,
    Correct,
    LoopSetup,
    Outcome,
    PartRequest,
    StepDiverged,
    Unsuited,
    ask_compliance_of,
    largest,
)
from softseam_coupling.prediction import Prediction
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import Capabilities

Floats = NDArray[np.float64]

_GROWN, _STEPS = 1e3, 3
"""the multiplier's changes from step to step alternate and grow: so much in all, over at least so many steps, is no
oscillation of the body's [1]"""
_REMEDY = "added mass, which shorter steps do not cure; use seam: {scheme: position}"


class Staggered:
    """A `Loop` of two parts at one interface, whose rows are nodes of its part a. Raises Unsuited for others."""

    def __init__(self, setup: LoopSetup) -> None:
        if len(setup.mobility) != 2 or len(setup.interfaces) != 1:
            parts, interfaces = len(setup.mobility), len(setup.interfaces)
            raise Unsuited(
                f"staggered couples two parts at one interface, not {parts} at {interfaces}: use "
                "seam: {scheme: position}"
            )
        self._setup = setup
        self._parts, self._offset = parts_of(setup.interfaces, {name: len(m) for name, m in setup.mobility.items()})
        self._put, self._free = setup.interfaces[0].parts
        if not self._parts[self._put].sign:
            raise Unsuited(
                f"staggered puts all coupling nodes of {self._put!r}, of which this interface has some only: use "
                "seam: {scheme: position}"
            )
        first = np.zeros_like(self._offset) if setup.first is None else setup.first
        self._multipliers = Prediction(len(first), first)
        self._stiffness = np.zeros((self._offset.size, self._offset.size))  # H_a^-1 of eq. (1) [N/m]
        self._dt, self._asks = 0.0, True  # of the last step [s]; whether part a is to report H_a
        self._change = np.zeros(self._offset.size)
        self._grown, self._n_grown = 1.0, 0

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """The parts are configured. Raises Unsuited where part a reports no compliance."""
        ask_compliance_of([self._put], capabilities)

    def multipliers(self) -> Floats:
        """The last committed ones (c, 3) [N]."""
        return self._multipliers.last

    def solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool = False) -> Outcome:
        """Part b's step, then part a's. A shorter step would not help, so that none is refused."""
        if dt != self._dt:
            self._dt, self._asks = dt, True
        last, multipliers, before = self._multipliers.last, self._multipliers.predict(dt), math.inf
        put, free = self._parts[self._put], self._parts[self._free]
        other = ask({self._free: PartRequest(free.force(last))})[self._free]
        for exchange in range(2, self._setup.exchanges + 1):
            reply = ask({self._put: PartRequest(put.force(multipliers), self._asks)})[self._put]
            reported = reply.coupling.compliance
            if self._asks and reported.size and np.isfinite(reported).all() and np.trace(reported) > 0.0:
                self._stiffness, self._asks, before = _inverse(reported), False, math.inf
            left = gap_of(self._parts, {self._put: reply.coupling.x, self._free: other.coupling.x}, self._offset)
            gap = largest(left)
            if not math.isfinite(gap):
                break
            if gap <= self._setup.tolerance:
                self._watch((multipliers - last).reshape(-1))
                self._multipliers.commit(multipliers, dt)
                return Outcome({self._put: reply, self._free: other}, multipliers, gap, exchange)
            if reply.status is not Status.CONVERGED:
                break
            self._asks, before = self._asks or gap > STALE * before, gap
            multipliers = multipliers - (self._stiffness @ left.reshape(-1)).reshape(-1, 3)  # eq. (1)
        raise StepDiverged(f"staggered: {self._put} cannot be put where {self._free} went: {_REMEDY}")

    def _watch(self, change: Floats) -> None:
        """Follow how the multiplier's change of a step (3c,) [N] grows over the one before where they alternate."""
        before = float(np.linalg.norm(self._change))
        size = float(np.linalg.norm(change))
        if before > 0.0 and size > before and float(change @ self._change) < 0.0:
            self._grown, self._n_grown = self._grown * size / before, self._n_grown + 1
        else:
            self._grown, self._n_grown = 1.0, 0
        self._change = change
        if self._grown > _GROWN and self._n_grown >= _STEPS:
            raise StepDiverged(
                f"staggered: the multiplier alternates and has grown {self._grown:.1e} times in {self._n_grown} steps: "
                f"{_REMEDY}"
            )

    def forget_sent(self) -> None:
        """Nothing that the parts keep is counted on."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        numbers = np.array([self._grown, self._n_grown], dtype=np.float64)
        return {
            **{f"multipliers_{key}": array for key, array in self._multipliers.to_arrays().items()},
            "stiffness": self._stiffness.copy(),
            "asks": np.array([self._dt, self._asks]),
            "change": self._change.copy(),
            "numbers": numbers,
        }

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._multipliers.take({key: arrays[f"multipliers_{key}"] for key in ("kept", "numbers")})
        self._stiffness[:], self._change[:] = arrays["stiffness"], arrays["change"]
        dt, asks = arrays["asks"].tolist()
        self._dt, self._asks = dt, bool(asks)
        grown, n_grown = arrays["numbers"].tolist()
        self._grown, self._n_grown = grown, int(n_grown)


def _inverse(compliance: Floats) -> Floats:
    """Of the symmetric part of a compliance (3n, 3n) [m/N], and a little more of its diagonal [N/m]."""
    h = 0.5 * (compliance + compliance.T)
    h.flat[:: len(h) + 1] += HARDLY * np.trace(h) / len(h)
    return np.asarray(np.linalg.inv(h))
