"""The limit of levels that scatter about their way to it: least squares over all of them (docs/decisions/36).

Where tools' edges fall on cells differs from level to level: J = J* + C h^p and a scatter that falls about as sqrt(h).
For an order p the values J* and C that fit the finest levels best, each weighed with 1/h, are

    J* = sum_k a_k J_k,   a_k = (S2 - S1 x_k) w_k/(S0 S2 - S1^2),   x = h^p,   S_m = sum_k w_k x_k^m                 (1)

and what J* may be off by follows from what the fit leaves, r_k = J_k - J* - C x_k:

    e_p^2 = s^2 sum_k a_k^2/w_k,   s^2 = sum_k w_k |r_k|^2/(n - 2)                                                  (2)

The order whose s is least is taken, and so is what others that fit nearly as well say of J*:

    U = 1.25 sqrt((2 e_p)^2 + max_q |J*_q - J*_p|^2),   at least |J* - J_n|                                         (3)

with the factor of safety of Eca and Hoekstra (J. Comput. Phys. 262 (2014) 104), who fit flows in the same way. Stress
at a sharp edge grows like log h or a negative power: there is no limit where one of these fits much better than orders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from softseam.study.richardson import FASTEST, RECENT, SLOWEST, Floats, Limit, Norm, demand_falling, limit

ORDERS = (SLOWEST, 1.5, 2.0, 3.0, FASTEST)
"""that are tried: between them no levels that scatter can tell"""
FITTED = 6
"""the finest levels are fitted, so many at least: coarser ones have errors of other kinds"""
ALIKE = 2.5
"""and all others whose cells are no more than this many times as large as the finest [1]"""
NEARLY = 10.0
"""orders whose s^2 is no more than so many times the least may be the true one [1]"""
SAFETY = 1.25
GROWING = -0.5
"""order of stress at the end of a crack, which no edge exceeds"""
BETTER = 4.0
"""s^2 of the orders over that of a growth that is believed [1]"""


class _Fit(NamedTuple):
    value: Floats
    """J* of eq. (1)"""
    off: float
    """e_p of eq. (2)"""
    scatter: float
    """s^2"""


def fitted(h: Sequence[float], levels: Sequence[Floats], norm: Norm) -> Limit:
    """The limit for h -> 0 of levels computed at falling h, which may scatter.

    Fewer than four levels say too little of scatter: what `limit` says of these holds.

    levels  at least one, of equal shape
    norm    of a difference of two of them, in the units of the uncertainty

    Raises ValueError unless there is a level for each h, and h falls.
    """
    demand_falling(h, levels)
    if len(levels) < RECENT:
        return limit(h, levels, norm)
    n = max(FITTED, sum(size <= ALIKE * h[-1] * (1.0 + 1e-9) for size in h))
    sizes, values = np.array(h[-n:]) / h[-1], np.array(levels[-n:])
    fits = [_fit(sizes**order, sizes, values, norm) for order in ORDERS]
    growing = [_fit(x, sizes, values, norm) for x in (np.log(sizes), sizes**GROWING)]
    order, best = min(zip(ORDERS, fits, strict=True), key=lambda each: each[1].scatter)
    if best.scatter > BETTER * min(fit.scatter for fit in growing):
        went = max(norm(a - b) for a, b in combinations(levels[-RECENT:], 2))
        return Limit(levels[-1], went, float("nan"), False)
    others = max(norm(fit.value - best.value) for fit in fits if fit.scatter <= NEARLY * best.scatter)
    uncertainty = SAFETY * float(np.hypot(2.0 * best.off, others))
    return Limit(best.value, max(uncertainty, norm(best.value - levels[-1])), order, True)


def settled(h: Sequence[float], levels: Sequence[Floats], norm: Norm) -> Limit:
    """The limit for h -> 0 of levels that have an order, as a rule: `limit`, and `fitted` where they go to and fro and
    are enough to be fitted, known to what the finest level changed at best.

    Steps leave an order where contact is smooth; where points open or slip a step sooner or later, they do not.
    """
    found = limit(h, levels, norm)
    if np.isfinite(found.order) or not found.converges or len(levels) < FITTED:
        return found
    fit = fitted(h, levels, norm)
    return replace(fit, uncertainty=max(fit.uncertainty, norm(levels[-1] - levels[-2]))) if fit.converges else found


def together(one: Limit, other: Limit, norm: Norm) -> Limit:
    """What two families of levels lead to: their mean, weighed with the squares of what each claims (Birge, Phys. Rev.
    40 (1932) 207),

        J* = V^2 (J_1/U_1^2 + J_2/U_2^2),  V^-2 = U_1^-2 + U_2^-2,  U = V max(1, |J_1 - J_2|/hypot(U_1, U_2))      (4)

    so the more uncertain the less they agree. The first where one of them has no limit; its order stays.
    """
    both = float(np.hypot(one.uncertainty, other.uncertainty))
    if not (one.converges and other.converges and 0.0 < both < np.inf):
        return one
    share = (other.uncertainty / both) ** 2
    value = share * one.value + (1.0 - share) * other.value
    apart = max(1.0, norm(one.value - other.value) / both)
    return Limit(value, one.uncertainty * other.uncertainty / both * apart, one.order, True)


def _fit(x: Floats, sizes: Floats, values: Floats, norm: Norm) -> _Fit:
    """Eqs. (1) and (2) of levels `values` (n, ...) at `sizes` (n,), along x (n,)."""
    w = 1.0 / sizes
    s0, s1, s2 = w.sum(), (w * x).sum(), (w * x * x).sum()
    det = s0 * s2 - s1 * s1
    to_limit, to_slope = (s2 - s1 * x) * w / det, (s0 * x - s1) * w / det
    value, slope = np.tensordot(to_limit, values, 1), np.tensordot(to_slope, values, 1)
    left = [norm(level - value - slope * each) for level, each in zip(values, x, strict=True)]
    scatter = float((w * np.square(left)).sum()) / (len(w) - 2)
    return _Fit(np.asarray(value), float(np.sqrt(scatter * (to_limit**2 / w).sum())), scatter)
