"""Candidates for the next multiplier, from the last four committed ones, and how well each has done so far.

Row k of WEIGHTS gives lambda(n+1) = sum_j WEIGHTS[k, j] lambda(n - j). Each row is exact for polynomials in time up to
its degree. The damped rows also have sum_j (-1)^j WEIGHTS[k, j] = 0: a sawtooth of period two steps, which position
continuity with a constant multiplier leaves in lambda (amplified 3 and 7 times by rows 1 and 3), does not pass.
Three-point linear: w = (2 + a, -1 - 2 a, a), sawtooth gain 3 + 4 a = 0 for a = -3/4; least squares would be a = -2/3.
"""

from __future__ import annotations

import numpy as np
from numba import njit

NAMES = ("constant", "linear", "damped linear", "quadratic", "damped quadratic")
WEIGHTS = np.array(
    [
        [1.0, 0.0, 0.0, 0.0],
        [2.0, -1.0, 0.0, 0.0],
        [1.25, 0.5, -0.75, 0.0],
        [3.0, -3.0, 1.0, 0.0],
        [2.125, -0.375, -1.625, 0.875],
    ]
)
LENGTHS = np.array([1, 2, 3, 3, 4])
MEMORY = 0.7
"""weight of the past in each candidate's mean square error [1]"""


@njit(cache=True, error_model="numpy")
def extrapolate(history, n_history, weights, lengths, errors, fixed, out):
    """Write the chosen candidate's prediction; returns its row, or -1 (and zeros) without history.

    history  (4, n)  committed multipliers, newest first [N]
    errors   (5,)    mean square error of each candidate so far, infinite where never measured
    fixed            a row to use wherever the history is long enough, or -1 for the one with the least error
    out      (n,)    [N]
    """
    chosen = -1
    for k in range(lengths.shape[0]):
        if lengths[k] <= n_history and (k == 0 or k == fixed or (fixed < 0 and errors[k] < errors[chosen])):
            chosen = k
    for i in range(out.shape[0]):
        out[i] = 0.0
        if chosen >= 0:
            for j in range(lengths[chosen]):
                out[i] += weights[chosen, j] * history[j, i]
    return chosen


@njit(cache=True, error_model="numpy")
def remember(history, n_history, weights, lengths, scale, lambda_, errors):
    """Score every candidate against the committed multiplier, then push it; returns the new length of the history.

    Error of a candidate: sum_i (scale_i (predicted_i - lambda_i))^2; with scale the diagonal of the compliance that is
    about the gap [m^2] the prediction would have caused.

    history, errors  updated in place
    scale            (n,)  [m/N]
    lambda_          (n,)  [N]
    """
    n = lambda_.shape[0]
    for k in range(lengths.shape[0]):
        if lengths[k] > n_history:
            continue
        total = 0.0
        for i in range(n):
            predicted = 0.0
            for j in range(lengths[k]):
                predicted += weights[k, j] * history[j, i]
            total += (scale[i] * (predicted - lambda_[i])) ** 2
        errors[k] = MEMORY * errors[k] + (1.0 - MEMORY) * total if np.isfinite(errors[k]) else total
    for j in range(3, 0, -1):
        history[j] = history[j - 1]
    history[0] = lambda_
    return min(n_history + 1, 4)
