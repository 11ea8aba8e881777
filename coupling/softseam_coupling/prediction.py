"""What the step to come will ask for, from what the last steps came to: a polynomial in time of the order that fits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

N_KEPT = 3
"""steps that are remembered: the order is two at most"""
_EVENLY = np.array([[1.0, 0.0, 0.0], [2.0, -1.0, 0.0], [3.0, -3.0, 1.0]])
"""weights of steps that are equally long [1]"""
_MEMORY = 0.5
"""share of an order's mean square error that is left a step later [1]"""


class Prediction:
    """Of vectors (c, 3); everything in it evolves.

    first  what belongs to the state from which steps begin; None: nothing is known
    """

    def __init__(self, n_rows: int, first: Floats | None = None) -> None:
        self._kept = np.zeros((N_KEPT, n_rows, 3))
        self._times = np.zeros(N_KEPT)
        self._errors = np.zeros(N_KEPT)
        self._n = 0
        if first is not None:
            self._kept[0], self._n = first, 1

    @property
    def known(self) -> bool:
        """Whether there is anything to predict from."""
        return self._n > 0

    @property
    def last(self) -> Floats:
        """What the last step came to, a copy; zero before the first (c, 3)."""
        return np.array(self._kept[0])

    @property
    def order(self) -> int:
        """That whose predictions were best lately."""
        return int(np.argmin(self._errors[: max(self._n, 1)]))

    def predict(self, dt: float, order: int | None = None) -> Floats:
        """The next, a step of dt [s] later, by the polynomial through the last order + 1 (c, 3)."""
        weights = self._weights(dt)[min(self.order if order is None else order, max(self._n - 1, 0))]
        return np.asarray((weights @ self._kept.reshape(N_KEPT, -1)).reshape(self._kept.shape[1:]))

    def commit(self, vectors: Floats, dt: float) -> None:
        """A step of dt [s] came to these vectors (c, 3): every order is scored on them."""
        n, flat = self._n, self._kept.reshape(N_KEPT, -1)
        if n:
            miss = self._weights(dt)[:n] @ flat - vectors.reshape(-1)
            self._errors[:n] = _MEMORY * self._errors[:n] + (1.0 - _MEMORY) * np.einsum("oi,oi->o", miss, miss)
        self._kept[1:], self._times[1:] = self._kept[:-1].copy(), self._times[:-1].copy()
        self._kept[0], self._times[0] = vectors, self._times[1] + dt
        self._n = min(n + 1, N_KEPT)

    def _weights(self, dt: float) -> Floats:
        """Of the kept vectors in the prediction of each order (N_KEPT, N_KEPT) [1]."""
        before = self._times[0] - self._times
        if self._n == N_KEPT and abs(before[2] - 2.0 * dt) + abs(before[1] - dt) < 1e-9 * dt:
            return _EVENLY
        weights = np.zeros((N_KEPT, N_KEPT))
        for order in range(self._n):
            for i in range(order + 1):
                others = [j for j in range(order + 1) if j != i]
                weights[order, i] = np.prod([(dt + before[j]) / (before[j] - before[i]) for j in others])
        return weights

    def to_arrays(self) -> dict[str, Floats]:
        """Everything, for a snapshot."""
        numbers = np.concatenate([self._times, self._errors, [float(self._n)]])
        return {"kept": self._kept.copy(), "numbers": numbers}

    def take(self, arrays: dict[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._kept[:] = arrays["kept"]
        self._times[:], self._errors[:] = arrays["numbers"][:N_KEPT], arrays["numbers"][N_KEPT : 2 * N_KEPT]
        self._n = int(arrays["numbers"][-1])
