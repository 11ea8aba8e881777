"""Fit polynomials to curves of quantities over squeezes, and find by how much they are off."""

import math
from collections.abc import Sequence

import numpy as np

from softseam.errors import BadInput
from softseam_studies.surrogate.surrogate import COVERED, terms
from softseam_studies.surrogate.varied import Floats

Curve = tuple[Floats, Floats]
"""squeezes of a run as its steps end (s,), rising, and the logarithms of its quantities (k, s)"""
SQUEEZES = 16
"""squeezes at which it is given, evenly in their logarithm"""
_LEAST = 0.05
"""the least of them, of the largest [1]: less is hardly a touch"""
_DEGREES = (1, 2, 3)


def common_squeezes(curves: Sequence[Curve]) -> Floats:
    """Squeezes that all runs reach (g,). Raises BadInput where there are none."""
    last = min(float(squeezes[-1]) for squeezes, _ in curves)
    first = max(_LEAST * last, *(float(squeezes[0]) for squeezes, _ in curves))
    if not first < last:
        raise BadInput(
            f"one run ends squeezed by {last:.3g}, another one's first step squeezes by {first:.3g}: vary less, or "
            "shorten `step`"
        )
    return np.geomspace(first, last, SQUEEZES)


def fitted(within: Floats, curves: Sequence[Curve], grid: Floats) -> tuple[int, Floats, Floats]:
    """The degree that claims least, coefficients (k, m, g) and claims (k, g), for runs at points (n, d)."""
    n = len(within)
    given_rows = np.stack([[np.interp(np.log(grid), np.log(at), row) for row in rows] for at, rows in curves], axis=1)
    rank = min(n, math.ceil(COVERED * (n + 1))) - 1
    best: tuple[float, int, Floats, Floats] | None = None
    for degree in _DEGREES:
        design = terms(within, degree)
        if 2 * design.shape[1] > n and degree > 1:
            break
        inverse = np.linalg.pinv(design)
        coefficients = inverse @ given_rows
        own = np.einsum("nm,mn->n", design, inverse)  # what a run has of its own fit: left out, it errs by so much more
        others = given_rows - (given_rows - design @ coefficients) / (1.0 - own)[:, None]
        errors = np.stack([_errors(curve, others[:, i], grid) for i, curve in enumerate(curves)], axis=1)
        claims = np.sort(errors, axis=1)[:, rank]
        worth = float(claims.mean())
        if best is None or worth < best[0]:
            best = worth, degree, coefficients, claims
    assert best is not None
    return best[1:]


def _errors(curve: Curve, given_rows: Floats, grid: Floats) -> Floats:
    """Largest error of what is given (k, g) of a run, at its steps around each squeeze of the grid (k, g)."""
    squeezes, values = np.log(curve[0]), curve[1]
    at = np.log(grid)
    error = np.stack(
        [np.abs(np.interp(squeezes, at, line) - row) for line, row in zip(given_rows, values, strict=True)]
    )
    reach = at[1] - at[0]
    found = np.empty_like(given_rows)
    for place, middle in enumerate(at):
        near = np.flatnonzero((np.abs(squeezes - middle) <= reach) & (squeezes >= at[0]) & (squeezes <= at[-1]))
        if not len(near):
            near = np.array([int(np.argmin(np.abs(squeezes - middle)))])
        found[:, place] = error[:, near].max(axis=1)
    return found
