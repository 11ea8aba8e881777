"""Projected Gauss-Seidel on a dense system, of `softseam_coupling.loops.unilateral`."""

import numpy as np

from softseam_coupling.kept_kernels import njit

ALONG, FIRST_ACROSS, SECOND_ACROSS, HOLDS = 0, 1, 2, 3
"""kinds of unknowns; two across come after their own along, where it has friction"""


@njit(cache=True, error_model="numpy")
def _rest(matrix, right, y, i):
    """Of row i of right + matrix y."""
    rest = right[i]
    for j in range(len(y)):
        rest += matrix[i, j] * y[j]
    return rest


@njit(cache=True, error_model="numpy")
def sweep(matrix, right, kind, bound, y, most, settled):
    """Sweep y (m,) towards y >= 0 where it is along, right + matrix y >= 0 there, both not at once; a pair across no
    longer than its bound times what is along, right + matrix y = 0 there or, at the bound, against it; 0 elsewhere.

    At most so many sweeps; they end where one changes nothing by more than the share `settled` of the largest.
    """
    for _ in range(most):
        largest, changed = 0.0, 0.0
        for i in range(len(y)):
            if kind[i] == SECOND_ACROSS:  # came with the first
                continue
            if kind[i] == FIRST_ACROSS:
                scale = matrix[i, i] + matrix[i + 1, i + 1]  # no less than how firm the pair is
                one, other = (
                    y[i] - _rest(matrix, right, y, i) / scale,
                    y[i + 1] - _rest(matrix, right, y, i + 1) / scale,
                )
                size, most_across = np.sqrt(one * one + other * other), bound[i] * y[i - 1]
                if size > most_across:
                    one, other = one * most_across / size, other * most_across / size
                changed = max(changed, abs(one - y[i]), abs(other - y[i + 1]))
                y[i], y[i + 1] = one, other
                continue
            now = y[i] - _rest(matrix, right, y, i) / matrix[i, i]
            if kind[i] == ALONG and now < 0.0:
                now = 0.0
            changed, y[i] = max(changed, abs(now - y[i])), now
            largest = max(largest, abs(now))
        if changed <= settled * largest:
            return
