"""What the step to come will ask for, from what the last steps came to: a polynomial in time that fits."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.predict import predict, score

Floats = NDArray[np.float64]

WAYS = ((0, 1), (1, 2), (2, 3), (1, 4), (2, 5))
"""order of a polynomial in time, and through how many of the last steps: more than the order asks for smooth noise;
those through fewer come first"""
N_KEPT = max(n for _, n in WAYS)
_N_READY = [sum(n <= known for _, n in WAYS) for known in range(N_KEPT + 1)]
"""ways for which enough steps are known, by how many are"""
_MEMORY = 0.5
"""share of a way's mean square error that is left a step later [1]"""


def _weights_of(order: int, times: Floats, at: float) -> Floats:
    """Weights of values at these times (n,) in what their polynomial of least squares is at another time (n,) [1]."""
    scale = max(float(np.abs(times - at).max()), 1e-300)
    powers = np.vander((times - at) / scale, order + 1, increasing=True)
    return np.asarray(np.linalg.pinv(powers)[0])


def _all_weights(times: Floats, at: float, n_known: int) -> Floats:
    """Of every way for which enough steps are known, in the order of the kept vectors (w, N_KEPT) [1]."""
    weights = np.zeros((len(WAYS), N_KEPT))
    for row, (order, n) in enumerate(WAYS):
        if n <= n_known:
            weights[row, :n] = _weights_of(order, times[:n], at)
    return weights


_EVENLY = _all_weights(-np.arange(float(N_KEPT)), 1.0, N_KEPT)
"""weights of steps that are equally long"""


class Prediction:
    """Of vectors (c, 3); everything in it evolves.

    first  what belongs to the state from which steps begin; None: nothing is known
    """

    def __init__(self, n_rows: int, first: Floats | None = None) -> None:
        self._kept = np.zeros((N_KEPT, n_rows, 3))
        self._times = np.zeros(N_KEPT)
        self._errors = np.full(len(WAYS), np.inf)  # of those that were never scored
        self._n = 0
        self._weighed: tuple[float, Floats] | None = None  # length of a step, and its `_weights`
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

    def predict(self, dt: float) -> Floats:
        """The next, a step of dt [s] later, in the way that was best lately (c, 3)."""
        row = int(self._errors.argmin())
        predicted = predict(self._weights(dt)[row], self._kept.reshape(N_KEPT, -1))
        return np.asarray(predicted.reshape(self._kept.shape[1:]))

    def commit(self, vectors: Floats, dt: float) -> None:
        """A step of dt [s] came to these vectors (c, 3): every way is scored on them."""
        weights, known = self._weights(dt), _N_READY[self._n]
        flat = np.ascontiguousarray(vectors).reshape(-1)
        score(weights, known, _MEMORY, self._kept.reshape(N_KEPT, -1), flat, self._errors)
        self._times[1:] = self._times[:-1].copy()
        self._times[0] = self._times[1] + dt
        self._n = min(self._n + 1, N_KEPT)
        if weights is not _EVENLY:  # which it stays in steps of one length
            self._weighed = None

    def _weights(self, dt: float) -> Floats:
        """Of the kept vectors, in every way (w, N_KEPT) [1]."""
        if self._weighed is None or self._weighed[0] != dt:
            before = self._times[0] - self._times
            even = self._n == N_KEPT and np.abs(before - dt * np.arange(N_KEPT)).max() < 1e-9 * dt
            self._weighed = dt, _EVENLY if even else _all_weights(-before, dt, self._n)
        return self._weighed[1]

    def follow(self, places: NDArray[np.int64]) -> None:
        """Vectors are others from now on: each is what was at its place (c,), or nothing where that is -1."""
        known = places >= 0
        kept = np.zeros((N_KEPT, len(places), 3))
        kept[:, known] = self._kept[:, places[known]]
        self._kept = kept

    def save(self) -> tuple[Floats, Floats, Floats, int]:
        """What of it evolves, for `restore`."""
        return self._kept.copy(), self._times.copy(), self._errors.copy(), self._n

    def restore(self, saved: tuple[Floats, Floats, Floats, int]) -> None:
        """Be as `save` found it."""
        self._kept, self._times, self._errors, self._n = saved
        self._weighed = None

    def to_arrays(self) -> dict[str, Floats]:
        """Everything, for a snapshot."""
        numbers = np.concatenate([self._times, self._errors, [float(self._n)]])
        return {"kept": self._kept.copy(), "numbers": numbers}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._kept[:] = arrays["kept"]
        numbers = arrays["numbers"]
        self._times[:], self._errors[:] = numbers[:N_KEPT], numbers[N_KEPT:-1]
        self._n = int(arrays["numbers"][-1])
        self._weighed = None
