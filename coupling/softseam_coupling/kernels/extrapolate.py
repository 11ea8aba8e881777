"""Candidates for the next multiplier, from the last steps, and how well each has done so far.

A step is accepted with a small gap g_n left, so its multiplier lambda_n misses the one that would have closed it,
closing_n = lambda_n - q_n, by q_n = B g_n. The miss comes back: the gap is absolute, and on the inertia alone a force d
moves the gap by H d in its step and by H d more in each later one (u(n+1) - 2 u(n) + u(n-1) = dT^2 f/m), so

    closing_n = smooth_n - xi (2 q_(n-1) - q_(n-2))                                   (1)

with xi = 1 where inertia rules the seam and xi = 0 where the step is long for its stiffness, which forgets. Candidates
extrapolate smooth_n with weights w for each xi, and are scored on closing_n.

The last candidate is fitted. Eq. (1) knows one inertia and no more; substeps, sweeps that lag, and the bodies' own
modes make the miss return otherwise (a cube held between two plates: -4.5, 7.7, -4.3 and 1.7 times in the next four
steps, where eq. (1) has -2 and 1). So w and c of

    closing_n - closing_(n-1) = sum_j w_j (closing_(n-j) - closing_(n-j-1)) + sum_j c_j q_(n-j)        (2)

with three w and four c are kept at the least squares of all past steps and components, older steps weighing less.

Rows of EXTRAPOLATION are exact for polynomials in time up to their degree. The damped ones also have
sum_j (-1)^j w_j = 0: a sawtooth of period two steps, which position continuity with a constant multiplier leaves in
lambda (rows 1 and 3 amplify it 3 and 7 times), does not pass. Three points: w = (2 + a, -1 - 2 a, a) has sawtooth gain
3 + 4 a, zero at a = -3/4; least squares would take a = -2/3.
"""

from __future__ import annotations

import numpy as np

from softseam_coupling.kept_kernels import njit

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
N_CHANGES, N_ECHOES = 3, 4
"""terms of eq. (2)"""
N_FIT = N_CHANGES + N_ECHOES
FIT_FORGET = 0.2
"""weight of the newest step in the fit of eq. (2) [1]"""


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


WEIGHTS = np.vstack((_weights(), np.eye(1, N_CLOSING + N_MISS)))
"""of all candidates; the last row, the fitted one, is each seam's own and begins as constant extrapolation"""
LENGTHS = np.append(np.repeat(np.array(REACH), len(INERTIA)), N_CLOSING)
FITTED = len(WEIGHTS) - 1


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
        out[i] = 0.0
    if chosen >= 0:
        for j in range(weights.shape[1]):
            for i in range(out.shape[0]):
                out[i] += weights[chosen, j] * history[j, i]
    return chosen


@njit(cache=True, error_model="numpy")
def _fit(moments, ridge, weights):
    """Weights (10,) of eq. (2) out of its normal equations: moments (7, 8), the last column the right-hand side."""
    factor = np.empty((N_FIT, N_FIT))
    w = np.empty(N_FIT)
    for i in range(N_FIT):
        w[i] = moments[i, N_FIT]
        for j in range(i + 1):
            value = moments[i, j] + (ridge if i == j else 0.0)
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = value / factor[j, j]
            elif value > 0.0:
                factor[i, i] = np.sqrt(value)
            else:
                return False
    for i in range(N_FIT):
        for k in range(i):
            w[i] -= factor[i, k] * w[k]
        w[i] /= factor[i, i]
    for i in range(N_FIT - 1, -1, -1):
        for k in range(i + 1, N_FIT):
            w[i] -= factor[k, i] * w[k]
        w[i] /= factor[i, i]
    weights[:] = 0.0
    weights[0] = 1.0
    for j in range(N_CHANGES):
        weights[j] += w[j]
        weights[j + 1] -= w[j]
    for j in range(N_ECHOES):
        weights[N_CLOSING + j] = w[N_CHANGES + j]
    return True


@njit(cache=True, error_model="numpy")
def remember(history, n_history, weights, lengths, scale, lambda_, closing, errors, moments, noise):
    """Score every candidate against the closing multiplier, fit the last one, push the step; returns the new length.

    Error of a candidate: sum_i (scale_i (predicted_i - closing_i))^2; with scale the diagonal of the compliance that is
    about the gap [m^2] the prediction would have left.

    history, errors   updated in place, as are the last row of weights and moments
    scale             (n,)  [m/N]
    lambda_, closing  (n,)  committed multiplier and the one that would have closed the gap [N]
    moments           (7, 8) of the fit so far [m^2]
    noise             gap that says nothing: what the fit takes changes of the multiplier to be worth at most [m]
    """
    n = lambda_.shape[0]
    n_ways, n_past = weights.shape
    missed = np.empty(n_ways)
    total = np.zeros(n_ways)
    terms = np.empty(N_FIT + 1)
    fits = n_history >= N_CLOSING
    if fits:
        for i in range(N_FIT):
            for j in range(N_FIT + 1):
                moments[i, j] *= 1.0 - FIT_FORGET
    by_way = weights.T.copy()
    for i in range(n):
        for k in range(n_ways):
            missed[k] = -closing[i]
        for j in range(n_past):
            value = history[j, i]
            for k in range(n_ways):
                missed[k] += by_way[j, k] * value
        weight = scale[i] * scale[i]
        for k in range(n_ways):
            total[k] += weight * missed[k] * missed[k]
        if fits:
            for j in range(N_CHANGES):
                terms[j] = history[j, i] - history[j + 1, i]
            for j in range(N_ECHOES):
                terms[N_CHANGES + j] = history[N_CLOSING + j, i]
            terms[N_FIT] = closing[i] - history[0, i]
            for row in range(N_FIT):
                for column in range(N_FIT + 1):
                    moments[row, column] += weight * terms[row] * terms[column]
    for k in range(n_ways):
        if lengths[k] <= n_history:
            errors[k] = (1.0 - FORGET) * errors[k] + FORGET * total[k] if np.isfinite(errors[k]) else total[k]
    if fits:
        _fit(moments, n * noise * noise, weights[n_ways - 1])
    for j in range(history.shape[0] - 1, 0, -1):
        if j != N_CLOSING:  # where the newest miss goes
            history[j] = history[j - 1]
    for i in range(n):
        history[0, i] = closing[i]
        history[N_CLOSING, i] = lambda_[i] - closing[i]
    return min(n_history + 1, N_CLOSING)
