"""Gauss-Newton's method for few numbers and an expensive model, and what its answer is worth.

With residuals r(p) = model - measured and J = dr/dp, each iteration goes to p - (J^T J)^-1 J^T r, within bounds and by
no more than a factor, and half as far where that is no better. The covariance of p is s^2 (J^T J)^-1 with
s^2 = r . r/(m - n) of m measurements and n numbers that are found (Nocedal and Wright, Numerical Optimization,
chapter 10).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Model = Callable[[Floats], tuple[Floats, Floats]]
"""numbers (n,) to what is measured (m,) and its derivatives (m, n)"""

_FACTOR = 4.0
"""by which a number changes at most in an iteration"""
_DONE = 1e-4
"""relative change of all numbers that ends it"""
_IDLE = 0.05
"""of what noise as large as the residuals moves the model by: a change so small ends it, too"""
_SEEN = 1e-6
"""of the measured curve: a number that changes less of it, doubled, is not determined by it"""
_APART = 1e-3
"""least singular value of columns of length 1 that are distinguished"""


@dataclass(frozen=True)
class Answer:
    """Of n numbers."""

    values: Floats
    """(n,)"""
    errors: Floats
    """standard errors, NaN where a number is not determined (n,)"""
    untold: dict[int, str]
    """numbers that the measurements do not determine, and why; these are as they were at the start"""
    residual: float
    """root mean square of what is left, in units of what is measured"""
    runs: int
    """evaluations of the model"""
    settled: bool
    """whether it ended by itself, not by the most of runs"""
    at_bound: tuple[int, ...]
    """numbers that a bound holds"""


def fit(
    model: Model, measured: Floats, start: Floats, low: Floats, high: Floats, names: Sequence[str], most: int
) -> Answer:
    """Numbers from `start` (n,) on, each > 0 and between `low` and `high`; most: evaluations."""
    values, runs = start.copy(), 0
    found, jacobian = model(values)
    runs += 1
    untold = not_told(jacobian * values, measured, names)
    known = np.array([n not in untold for n in range(len(values))])
    settled = not known.any()
    while not settled:
        step = np.zeros_like(values)
        free = known.copy()
        for _ in values:  # a number that would leave its bounds stays there, and the others go on without it
            step[:] = 0.0
            scaled = jacobian[:, free] * values[free]
            step[free] = -np.linalg.lstsq(scaled, found - measured, rcond=None)[0] * values[free]
            beyond = free & (((values <= low) & (step < 0.0)) | ((values >= high) & (step > 0.0)))
            if not beyond.any():
                break
            free &= ~beyond
            step[~free] = 0.0
            if not free.any():
                break
        goal = np.clip(values + step, np.maximum(low, values / _FACTOR), np.minimum(high, values * _FACTOR))
        if np.all(np.abs(goal - values) <= _DONE * values) or _is_idle(jacobian @ step, found - measured, known):
            values, settled = goal, True
            break
        cost = float(np.sum((found - measured) ** 2))
        better = False
        while runs < most and not better:
            tried, slopes = model(goal)
            runs += 1
            better = float(np.sum((tried - measured) ** 2)) < cost
            if better:
                values, found, jacobian = goal, tried, slopes
            else:
                goal = 0.5 * (values + goal)
                if np.all(np.abs(goal - values) <= _DONE * values):
                    settled = True
                    break
        if runs >= most:
            break
    errors, residual = _errors(jacobian, found - measured, values, known)
    held = tuple(int(n) for n in np.flatnonzero(known & ((values <= low) | (values >= high))))
    return Answer(values, errors, untold, residual, runs, settled, held)


def _is_idle(change: Floats, residuals: Floats, known: NDArray[np.bool_]) -> bool:
    """Whether a step changes the model by less than noise does."""
    spare = max(1, len(residuals) - int(known.sum()))
    return bool(change @ change <= _IDLE**2 * float(residuals @ residuals) / spare)


def not_told(scaled: Floats, measured: Floats, names: Sequence[str]) -> dict[int, str]:
    """Numbers that no measurement determines, and why; scaled (m, n): their relative changes' effect on these (m,)."""
    size = np.linalg.norm(scaled, axis=0)
    untold = {
        int(n): "the curve does not change with it"
        for n in np.flatnonzero(size <= _SEEN * max(float(np.linalg.norm(measured)), 1e-300))
    }
    left = [n for n in range(scaled.shape[1]) if n not in untold]
    while len(left) > 1:
        _, values, directions = np.linalg.svd(scaled[:, left] / size[left], full_matrices=False)
        if values[-1] > _APART:
            break
        together = [left[n] for n in np.flatnonzero(np.abs(directions[-1]) > 0.1)]
        last = together[-1]
        others = " and ".join(names[n] for n in together if n != last)
        untold[last] = f"the curve changes with it as it does with {others}: find one at a time"
        left.remove(last)
    return untold


def _errors(jacobian: Floats, residuals: Floats, values: Floats, known: NDArray[np.bool_]) -> tuple[Floats, float]:
    """Standard errors (n,), and the root mean square of the residuals."""
    errors, count = np.full(len(values), np.nan), int(known.sum())
    square = float(residuals @ residuals)
    spare = len(residuals) - count
    if count and spare > 0:
        scaled = jacobian[:, known] * values[known]
        covariance = np.linalg.pinv(scaled.T @ scaled) * square / spare
        errors[known] = np.sqrt(np.diag(covariance)) * values[known]
    return errors, float(np.sqrt(square / max(1, len(residuals))))
