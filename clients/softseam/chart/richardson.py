"""The limit of a sequence of ever finer computations, and how far it is known.

With J(h) = J* + C h^p the differences of three levels h1 > h2 > h3 give the order p,

    |J1 - J2| / |J2 - J3| = (h1^p - h2^p) / (h2^p - h3^p)                                  (1)

and the finest two the limit (Richardson 1911; Roache, J. Fluids Eng. 116 (1994) 405):

    J* = J3 + (J3 - J2) h3^p / (h2^p - h3^p)                                               (2)

J may be a curve over time; |.| is then the norm that is handed in, p one number for the whole curve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SLOWEST = 1.0
"""orders found below this are taken for this one: forces and displacements at an edge singularity r^(l-1), l >= 1/2,
approach their limit like h^(2l) (Strang and Fix, An Analysis of the Finite Element Method, ch. 8)"""
FASTEST = 4.0
"""orders above this are luck: they would promise more than the elements hold"""


@dataclass(frozen=True)
class Limit:
    """The limit of a sequence."""

    value: Floats
    """same shape as the levels"""
    uncertainty: float
    """norm of what the limit may be off by, in the units of the norm; infinite with a single level"""
    order: float
    """the order that was used; NaN where there are too few levels, or no limit"""
    converges: bool
    """false where the levels approach nothing (their differences fall more slowly than those of log h, as the stress
    at a sharp edge does): then `value` is the finest level"""


def limit(h: Sequence[float], levels: Sequence[Floats], norm: Callable[[Floats], float]) -> Limit:
    """The limit for h -> 0 of levels computed at falling h.

    Its uncertainty is half the way from the finest level, or what the finest level changed in it, whichever is more;
    with two levels, all of the way.
    """
    if len(h) != len(levels) or not levels or any(b >= a for a, b in pairwise(h)):
        raise ValueError("give one level for each h, and h that falls")
    finest = levels[-1]
    if len(levels) == 1:
        return Limit(finest, float("inf"), float("nan"), True)
    last = norm(levels[-2] - finest)
    if last == 0.0:
        return Limit(finest, 0.0, float("nan"), True)
    if len(levels) == 2:
        value = _extrapolated(h[-2], h[-1], levels[-2], finest, SLOWEST)
        return Limit(value, norm(value - finest), float("nan"), True)
    before = norm(levels[-3] - levels[-2])
    order = observed_order((h[-3], h[-2], h[-1]), before, last)
    if order <= 0.0:
        return Limit(finest, max(before, last), float("nan"), False)
    order = min(max(order, SLOWEST), FASTEST)
    value = _extrapolated(h[-2], h[-1], levels[-2], finest, order)
    coarser = _extrapolated(h[-3], h[-2], levels[-3], levels[-2], order)
    return Limit(value, max(0.5 * norm(value - finest), norm(value - coarser)), order, True)


def observed_order(h: tuple[float, float, float], before: float, last: float) -> float:
    """Solve eq. (1) for p by bisection; 0 where the differences do not fall, 16 where they fall faster than any order.

    before, last   |J1 - J2| and |J2 - J3|
    """
    low, high = 1e-3, 16.0
    if last <= 0.0 or before >= last * _ratio(h, high):
        return high
    if before <= last * _ratio(h, low):
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _ratio(h, middle) * last < before else (low, middle)
    return 0.5 * (low + high)


def _ratio(h: tuple[float, float, float], p: float) -> float:
    """Right-hand side of eq. (1), which grows with p."""
    coarse, middle, fine = h
    return float(((coarse / fine) ** p - (middle / fine) ** p) / ((middle / fine) ** p - 1.0))


def _extrapolated(coarse: float, fine: float, j_coarse: Floats, j_fine: Floats, p: float) -> Floats:
    """Eq. (2)."""
    return np.asarray(j_fine + (j_fine - j_coarse) / ((coarse / fine) ** p - 1.0))
