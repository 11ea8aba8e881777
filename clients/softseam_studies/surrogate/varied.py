"""Keys of a scene that a surrogate may be asked for other values of, and where runs are made."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Varied:
    """A number of a scene, between two bounds."""

    key: str
    """as for `softseam run --set`; several that have the same value are joined by +"""
    low: float
    high: float

    @classmethod
    def read(cls, text: str) -> Varied:
        """Of KEY=LOW..HIGH. Raises BadInput."""
        key, given, bounds = text.partition("=")
        ends = bounds.split("..")
        try:
            low, high = (float(end) for end in ends)
        except ValueError:
            raise BadInput(f"--vary {text}: give KEY=LOW..HIGH, e.g. body.material.young=10e3..40e3") from None
        if not given or not key or not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise BadInput(f"--vary {text}: LOW and HIGH are finite numbers, LOW the less")
        return cls(key, low, high)

    def settings(self, value: float) -> list[str]:
        """What a scene is changed by so that it has a value."""
        return [f"{key}={value!r}" for key in self.key.split("+")]

    def within(self, value: float) -> float:
        """Where between the bounds a value is, from -1 to 1; evenly in its logarithm where the bounds are positive."""
        low, high, at = self.low, self.high, value
        if low > 0.0:
            low, high, at = math.log(low), math.log(high), math.log(value)
        return 2.0 * (at - low) / (high - low) - 1.0

    def value(self, within: float) -> float:
        """The other way round."""
        share = 0.5 * (1.0 + within)
        if self.low > 0.0:
            return float(math.exp(math.log(self.low) + share * math.log(self.high / self.low)))
        return self.low + share * (self.high - self.low)


def spread(n: int, dimensions: int, seed: int) -> Floats:
    """n points (n, dimensions) between -1 and 1, each alone in its n-th of every axis (a Latin hypercube)."""
    random = np.random.default_rng(seed)
    place = np.stack([random.permutation(n) for _ in range(dimensions)], axis=1)
    return np.asarray(2.0 * (place + random.random((n, dimensions))) / n - 1.0)
