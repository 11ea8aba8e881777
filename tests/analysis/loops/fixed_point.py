"""Multipliers by a fixed-point iteration on what is left, for the loops that redo a step until it is right.

A try of the multipliers lambda leaves g (the gap, or what a loop closes in its place). By a guess of the compliance
it asks for

    wanted = -H_0^-1 g                                                        (1)

and an acceleration proposes the next try of it. H_0 is the compliance W of all rows where the parts report it, and what
it errs by is found out by IQN-ILS; else it is the diagonal that the parts' masses alone would have,
dt^2 diag(sum_p B_p M_p^-1 B_p^T).

A step is accepted with a small gap left: its multipliers miss those that would have closed it, as far as these are
known, by q. Predicted are the ones that would close it. The miss comes back in the next steps, as a force that acted
once moves a body on in all later ones, and how is fitted with c to all steps so far, older ones weighing less:

    closing_n = predicted_n + sum_j c_j q_(n-j)                               (2)
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.accelerations.iqn_ils import IqnIls
from analysis.accelerations.memory import Acceleration, Memory
from softseam_coupling.loops.coupled_part import HARDLY, CoupledPart
from softseam_coupling.prediction import Prediction

Floats = NDArray[np.float64]

_STALE = 0.5
"""share of what was left that a try may leave; else the compliance is found anew [1]"""
_BY_COMPLIANCE = IqnIls(first=1.0, windows=30)
"""finds what the compliance errs by, which lasts longer than what a guess errs by"""
_N_MISSES, _KEPT, _RIDGE = 2, 0.8, 1e-3
"""terms of eq. (2); share of its moments that is left a step later [1]; what they are regularised by, of their sum"""


class FixedPoint:
    """Of c rows; everything in it evolves.

    parts         whose rows they are
    mobility      1/mass of their coupling nodes (n,) [1/kg]
    first         multipliers that belong to the parts' state (c, 3) [N]; None: zero
    acceleration  None: the parts report their compliance
    """

    def __init__(
        self,
        parts: Mapping[str, CoupledPart],
        mobility: Mapping[str, Floats],
        first: Floats | None,
        acceleration: Acceleration | None,
    ) -> None:
        self._exact = acceleration is None
        self._acceleration = _BY_COMPLIANCE if acceleration is None else acceleration
        by_mass = np.sum([part.rows**2 @ mobility[name] for name, part in parts.items()], axis=0)
        self._by_mass = np.repeat(by_mass, 3)
        self._scale = by_mass[:, None] / by_mass.mean()  # in which rows have about the same compliance
        self._last = np.zeros((len(by_mass), 3)) if first is None else np.array(first)
        self._closing = self._last
        self._predicted = np.zeros_like(self._last)  # without the sum of eq. (2), times the scale
        self._prediction = Prediction(len(by_mass), self._last * self._scale)
        self._misses = np.zeros((_N_MISSES, self._by_mass.size))  # q of eq. (2), newest first, times the scale
        self._moments = np.zeros((_N_MISSES, _N_MISSES + 1))  # of them, and with what was predicted wrong
        self._memory = self._acceleration.init(self._by_mass.size)
        self._inverse = np.zeros((self._by_mass.size,) * (2 if self._exact else 1))  # of H_0 [N/m]
        self._dt = 0.0
        self._left = np.inf  # norm of what the try before left
        self.asks = False
        """whether the parts are to report their compliance with the next try"""

    @property
    def last(self) -> Floats:
        """The last committed multipliers, a copy (c, 3) [N]."""
        return self._last.copy()

    def begin(self, dt: float) -> Floats:
        """The first try of a step of dt [s] (c, 3) [N]."""
        if dt != self._dt:
            self._dt, self.asks = dt, self._exact
            if not self._exact:
                self._inverse = 1.0 / (dt * dt * self._by_mass)
        self._acceleration.begin(self._memory)
        self._left = np.inf
        self._predicted = self._prediction.predict(dt)
        return np.asarray((self._predicted + self._echo()) / self._scale)

    def _echo(self) -> Floats:
        """The sum of eq. (2), times the scale (c, 3) [N]."""
        square = self._moments[:, :_N_MISSES]
        whole = float(np.trace(square))
        if not whole > 0.0:
            return np.zeros_like(self._last)
        c = np.linalg.solve(square + _RIDGE * whole * np.eye(_N_MISSES), self._moments[:, _N_MISSES])
        return np.asarray((c @ self._misses).reshape(self._last.shape))

    def set_compliance(self, compliance: Floats) -> None:
        """Take W (3c, 3c) [m/N]; one that is not finite or nowhere positive is asked for again."""
        h = 0.5 * (compliance + compliance.T)
        mean = float(np.trace(h)) / max(len(h), 1)
        if not (np.isfinite(h).all() and mean > 0.0):
            return
        h.flat[:: len(h) + 1] += HARDLY * mean
        inverse = np.linalg.inv(h)
        self._inverse = np.asarray(0.5 * (inverse + inverse.T))
        self._memory = self._acceleration.init(len(h))
        self._left, self.asks = np.inf, False

    def next(self, multipliers: Floats, left: Floats) -> Floats:
        """The next try after one (c, 3) [N] that left so much (c, 3) [m]; a new array."""
        flat = left.reshape(-1)
        size = float(np.sqrt(flat @ flat))
        self.asks = self._exact and (self.asks or size > _STALE * self._left)
        self._left = size
        wanted = -(self._inverse @ flat) if self._exact else -self._inverse * flat
        tried = np.array(multipliers, dtype=np.float64).reshape(-1)
        self._closing = self._acceleration.next(self._memory, tried, wanted).reshape(multipliers.shape)
        return self._closing.copy()

    def commit(self, multipliers: Floats) -> None:
        """The step was taken under these, which were tried last (c, 3) [N]."""
        closing = self._closing * self._scale
        wrong = (closing - self._predicted).reshape(-1)
        self._moments *= _KEPT
        self._moments += self._misses @ np.column_stack((self._misses.T, wrong))
        self._misses[1:] = self._misses[:-1].copy()
        self._misses[0] = ((multipliers - self._closing) * self._scale).reshape(-1)
        self._prediction.commit(closing, self._dt)
        self._last = multipliers
        self._acceleration.end(self._memory)

    def to_arrays(self) -> dict[str, Floats]:
        """Everything, for a snapshot between two steps."""
        return {
            **{f"prediction_{key}": array for key, array in self._prediction.to_arrays().items()},
            "multipliers": self._last.copy(),
            "misses": self._misses.copy(),
            "moments": self._moments.copy(),
            "memory_vectors": self._memory.vectors.copy(),
            "memory_numbers": self._memory.numbers.copy(),
            "inverse": self._inverse.copy(),
            "fixed_point": np.array([self._dt, self.asks]),
        }

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._prediction.take({key: arrays[f"prediction_{key}"] for key in ("kept", "numbers")})
        self._last = np.array(arrays["multipliers"]).reshape(self._last.shape)
        self._misses[:], self._moments[:] = arrays["misses"], arrays["moments"]
        self._memory = Memory(np.array(arrays["memory_vectors"]), np.array(arrays["memory_numbers"]))
        self._inverse = np.array(arrays["inverse"]).reshape(self._inverse.shape)
        dt, asks = arrays["fixed_point"].tolist()
        self._dt, self.asks = dt, bool(asks)
