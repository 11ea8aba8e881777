"""Candidates for the next multiplier, from the last steps, and how well each has done so far.

A step is accepted with a small gap g_n left, so its multiplier lambda_n misses the one that would have closed it,
closing_n = lambda_n - q_n, by q_n = B g_n. The miss comes back: the gap is absolute, and on the inertia alone a force d
moves the gap by H d in its step and by H d more in each later one (u(n+1) - 2 u(n) + u(n-1) = dT^2 f/m), so

    closing_n = smooth_n - xi (2 q_(n-1) - q_(n-2))                                   (1)

with xi = 1 where inertia rules the seam and xi = 0 where the step is long for its stiffness, which forgets. Candidates
extrapolate smooth_n with weights w for each xi, and are scored on closing_n.

Rows of EXTRAPOLATION are exact for polynomials in time up to their degree. The damped ones also have
sum_j (-1)^j w_j = 0: a sawtooth of period two steps, which position continuity with a constant multiplier leaves in
lambda (rows 1 and 3 amplify it 3 and 7 times), does not pass. Three points: w = (2 + a, -1 - 2 a, a) has sawtooth gain
3 + 4 a, zero at a = -3/4; least squares would take a = -2/3.
"""

from __future__ import annotations

import numpy as np
from numba import njit

NAMES = ("constant", "linear", "damped linear", "quadratic", "damped quadratic")
EXTRAPOLATION = np.array(
    [
        [1.0, 0.0, 0.0, 0.0],
        [2.0, -1.0, 0.0, 0.0],
        [1.25, 0.5, -0.75, 0.0],
        [3.0, -3.0, 1.0, 0.0],
        [2.125, -0.375, -1.625, 0.875],
    ]
)
REACH = (1, 2, 3, 3, 4)
"""steps that each row of EXTRAPOLATION looks back"""
INERTIA = (0.0, 0.5, 1.0)
"""values of xi"""
N_CLOSING, N_MISS = 4, 6
FORGET = 0.3
"""weight of the newest step in each candidate's mean square error [1]"""


def _weights():
    """Weights of closing_n ... closing_(n-3), q_n ... q_(n-5) by eq. (1), row = len(INERTIA) * name + xi."""
    rows = []
    for w in EXTRAPOLATION:
        for xi in INERTIA:
            miss = np.zeros(N_MISS)
            miss[0] -= 2.0 * xi
            miss[1] += xi
            for j in range(N_CLOSING):
                miss[j + 1] += 2.0 * xi * w[j]
                miss[j + 2] -= xi * w[j]
            rows.append(np.concatenate((w, miss)))
    return np.array(rows)


WEIGHTS = _weights()
LENGTHS = np.repeat(np.array(REACH), len(INERTIA))


@njit(cache=True, error_model="numpy")
def _candidate(history, weights, i):
    value = 0.0
    for j in range(weights.shape[0]):
        if weights[j] != 0.0:
            value += weights[j] * history[j, i]
    return value


@njit(cache=True, error_model="numpy")
def extrapolate(history, n_history, weights, lengths, errors, first, last, out):
    """Write the prediction of the candidate with the least error; returns its row, or -1 (and zeros) without history.

    history      (10, n)  closing multipliers and misses, each newest first [N]
    errors       (k,)     mean square error of each candidate so far, infinite where never measured
    first, last           rows to choose from; constant extrapolation where the history is too short for all of them
    out          (n,)     [N]
    """
    chosen = 0 if n_history > 0 else -1
    if n_history >= lengths[first]:
        chosen = first
    for k in range(first, last):
        if lengths[k] <= n_history and errors[k] < errors[chosen]:
            chosen = k
    for i in range(out.shape[0]):
        out[i] = _candidate(history, weights[chosen], i) if chosen >= 0 else 0.0
    return chosen


@njit(cache=True, error_model="numpy")
def remember(history, n_history, weights, lengths, scale, lambda_, closing, errors):
    """Score every candidate against the closing multiplier, then push it and the miss; returns the new length.

    Error of a candidate: sum_i (scale_i (predicted_i - closing_i))^2; with scale the diagonal of the compliance that is
    about the gap [m^2] the prediction would have left.

    history, errors   updated in place
    scale             (n,)  [m/N]
    lambda_, closing  (n,)  committed multiplier and the one that would have closed the gap [N]
    """
    n = lambda_.shape[0]
    for k in range(lengths.shape[0]):
        if lengths[k] > n_history:
            continue
        total = 0.0
        for i in range(n):
            total += (scale[i] * (_candidate(history, weights[k], i) - closing[i])) ** 2
        errors[k] = (1.0 - FORGET) * errors[k] + FORGET * total if np.isfinite(errors[k]) else total
    for j in range(history.shape[0] - 1, 0, -1):
        if j != N_CLOSING:  # where the newest miss goes
            history[j] = history[j - 1]
    for i in range(n):
        history[0, i] = closing[i]
        history[N_CLOSING, i] = lambda_[i] - closing[i]
    return min(n_history + 1, N_CLOSING)
