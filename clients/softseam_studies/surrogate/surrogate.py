"""A surrogate: polynomials in place of runs, with what they are off by.

At each of some squeezes s_j the logarithm of a quantity is a polynomial of the varied numbers; between squeezes it goes
straight in log s. The claim is that of conformal prediction by leaving each run out in turn: of n errors that the
others would have made of it, the ceil(0.95 (n + 1))-th, which covers a run that is drawn as these were with 95 % (Vovk,
Gammerman and Shafer, Algorithmic Learning in a Random World, 2005). A run's error at s_j is its largest up to the
squeezes beside s_j, at its own steps, so that what is lost by going straight between them counts.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput
from softseam.report import write_json

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


COVERED = 0.95
"""of fresh runs a claim is to cover [1]"""
_FORMAT = 1


class Told(NamedTuple):
    """What a surrogate says of a quantity."""

    value: float
    claim: float
    """by which that may be off, in the same unit"""


@dataclass(frozen=True)
class Surrogate:
    """Of one scene: k quantities at g squeezes, by m terms."""

    scene: str
    """its name"""
    varied: tuple[Varied, ...]
    quantities: tuple[str, ...]
    squeezes: Floats
    """at which they are given (g,), rising [1]"""
    degree: int
    coefficients: Floats
    """(k, m, g)"""
    claims: Floats
    """in the logarithm (k, g)"""
    runs: int
    seconds: float
    """that these took"""

    def at(self, values: Mapping[str, float], squeeze: float) -> dict[str, Told]:
        """Quantities of the scene with these values of what is varied, squeezed by a share of its width.

        Raises BadInput for other keys than those varied, and outside the bounds of what was run.
        """
        missing = [one.key for one in self.varied if one.key not in values]
        others = [key for key in values if key not in {one.key for one in self.varied}]
        if missing or others:
            keys = ", ".join(one.key for one in self.varied)
            raise BadInput(f"{', '.join(missing or others)}: values are wanted of {keys}, and of no other keys")
        for one in self.varied:
            if not one.low <= values[one.key] <= one.high:
                raise BadInput(f"{one.key}={values[one.key]!r}: runs were made from {one.low:g} to {one.high:g}")
        first, last = float(self.squeezes[0]), float(self.squeezes[-1])
        if not first <= squeeze <= last:
            raise BadInput(f"squeeze={squeeze!r}: runs are of {first:.3g} to {last:.3g}")
        within = np.array([[one.within(values[one.key]) for one in self.varied]])
        after = min(max(1, int(np.searchsorted(self.squeezes, squeeze))), len(self.squeezes) - 1)
        before, then = self.squeezes[after - 1 : after + 1].tolist()
        share = math.log(squeeze / before) / math.log(then / before)
        weights, there = (1.0 - share, share), slice(after - 1, after + 1)
        logarithm = (terms(within, self.degree)[0] @ self.coefficients[:, :, there] @ weights).tolist()
        claims = self.claims[:, there].max(axis=1).tolist()
        return {
            name: Told(math.exp(at), math.exp(at) * math.expm1(claim))
            for name, at, claim in zip(self.quantities, logarithm, claims, strict=True)
        }

    def write(self, path: Path) -> None:
        """Raises OSError."""
        document = asdict(self) | {name: getattr(self, name).tolist() for name in _ARRAYS}
        write_json({"softseam_surrogate": _FORMAT, **document}, path)

    @classmethod
    def read(cls, path: Path) -> Surrogate:
        """Raises BadInput where there is none, or it is of another version."""
        try:
            document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            known = document.pop("softseam_surrogate") == _FORMAT
            document |= {name: np.array(document[name], dtype=np.float64) for name in _ARRAYS}
            document["varied"] = varied = tuple(Varied(**one) for one in document["varied"])
            document["quantities"] = tuple(document["quantities"])
            found = cls(**document)
            n_terms = terms(np.zeros((1, len(varied))), found.degree).shape[1]
            shape = (len(found.quantities), n_terms, len(found.squeezes))
            known = known and found.coefficients.shape == shape and found.claims.shape == (shape[0], shape[2])
        except OSError as error:
            raise BadInput(f"cannot read {path}: {error.strerror}") from None
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise BadInput(f"{path} is no surrogate ({type(error).__name__}): make one by softseam surrogate") from None
        if not known:
            raise BadInput(f"{path} is of another version of softseam: make it anew by softseam surrogate")
        return found


_ARRAYS = ("squeezes", "coefficients", "claims")


@lru_cache
def _powers(dimensions: int, degree: int) -> NDArray[np.int64]:
    """Of each number in each term (m, d)."""
    return np.array([p for p in itertools.product(range(degree + 1), repeat=dimensions) if sum(p) <= degree])


def terms(within: Floats, degree: int) -> Floats:
    """All products of powers of the numbers (n, d), of this degree in all at most (n, m)."""
    return np.asarray((within[:, None, :] ** _powers(within.shape[1], degree)).prod(axis=2))
