"""The limit of a sequence of ever finer computations, and how far it is known.

With J(h) = J* + C h^p the differences of three levels h1 > h2 > h3 give the order p,

    |J1 - J2| / |J2 - J3| = (h1^p - h2^p) / (h2^p - h3^p)                                  (1)

and the finest two the limit (Richardson 1911; Roache, J. Fluids Eng. 116 (1994) 405):

    J* = J3 + (J3 - J2) h3^p / (h2^p - h3^p)                                               (2)

J may be a curve over time; |.| is then the norm that is handed in, p one number for the whole curve.

Not every sequence is such a power. Where a tool's edge falls on cells, J goes to and fro about its limit with no order
at all (Eca and Hoekstra, J. Comput. Phys. 262 (2014) 104: "scatter"), and stress at a sharp edge grows without one.
Changes distinguish them: what scatters turns back, d2 . d1 <= 0, and in a norm of a scalar product

    d2 . d1 <= 0   where   |d1 + d2| <= |d2 - d1|                                          (3)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Norm = Callable[[Floats], float]

SLOWEST = 1.0
"""orders found below this are taken for this one: forces and displacements at an edge singularity r^(l-1), l >= 1/2,
approach their limit like h^(2l) (Strang and Fix, An Analysis of the Finite Element Method, ch. 8)"""
FASTEST = 4.0
"""orders above this are luck: they would promise more than the elements hold"""
RECENT = 4
"""levels that have to go one way for an order to be believed: three values that mean nothing do so one time in three,
four one time in twelve"""


@dataclass(frozen=True)
class Limit:
    """The limit of a sequence."""

    value: Floats
    """same shape as the levels"""
    uncertainty: float
    """norm of what the limit may be off by, in the units of the norm; infinite with a single level"""
    order: float
    """the order that was used; NaN where there are too few levels, where these go to and fro, and without a limit"""
    converges: bool
    """false where the levels approach nothing: they go one way, and their differences fall more slowly than those of
    log h, as the stress at a sharp edge does; then `value` is the finest level, and what is known is how far the last
    four went in all"""


def limit(h: Sequence[float], levels: Sequence[Floats], norm: Norm) -> Limit:
    """The limit for h -> 0 of levels computed at falling h.

    Along one way it is known to its distance from the finest level, or to what that level changed in it, whichever is
    more. To and fro, to the whole way of the last four levels. With three levels luck may look like order: what either
    of their changes leaves at the slowest order counts, too. With two levels, all of that way.
    """
    demand_falling(h, levels)
    finest = levels[-1]
    if len(levels) == 1:
        return Limit(finest, float("inf"), float("nan"), True)
    changes = [fine - coarse for coarse, fine in pairwise(levels[-RECENT:])]
    last = norm(changes[-1])
    if not any(norm(change) for change in changes):
        return Limit(finest, 0.0, float("nan"), True)
    slowest = [_extrapolated(h[k - 1], h[k], levels[k - 1], levels[k], SLOWEST) for k in range(len(h) - 1, 0, -1)][:2]
    if len(levels) == 2:
        return Limit(slowest[0], norm(slowest[0] - finest), float("nan"), True)
    vague = max(norm(value - finest) for value in slowest) if len(levels) < RECENT else 0.0
    if any(turns_back(first, then, norm) for first, then in pairwise(changes)):
        return Limit(finest, max(vague, sum(norm(change) for change in changes)), float("nan"), True)
    before = norm(changes[-2])
    order = observed_order((h[-3], h[-2], h[-1]), before, last)
    if order <= 0.0:
        return Limit(finest, max(norm(a - b) for a, b in combinations(levels[-RECENT:], 2)), float("nan"), False)
    order = min(max(order, SLOWEST), FASTEST)
    value = _extrapolated(h[-2], h[-1], levels[-2], finest, order)
    coarser = _extrapolated(h[-3], h[-2], levels[-3], levels[-2], order)
    others = [finest, coarser, *(slowest if len(levels) < RECENT else ())]
    return Limit(value, max(norm(value - other) for other in others), order, True)


def demand_falling(h: Sequence[float], levels: Sequence[Floats]) -> None:
    """Raises ValueError unless there is a level for each h, and h falls."""
    if len(h) != len(levels) or not levels or any(b >= a for a, b in pairwise(h)):
        raise ValueError("give one level for each h, and h that falls")


def turns_back(first: Floats, then: Floats, norm: Norm) -> bool:
    """Whether a change goes against the one before it, eq. (3)."""
    return norm(first + then) <= norm(then - first)


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
