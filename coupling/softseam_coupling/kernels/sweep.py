"""Projected Gauss-Seidel on a dense system, of `softseam_coupling.loops.unilateral`."""

from softseam_coupling.kept_kernels import njit


@njit(cache=True, error_model="numpy")
def sweep(matrix, right, one_sided, y, most, settled):
    """Sweep y (m,) towards y >= 0 where one-sided, right + matrix y >= 0 there, both not at once, and 0 elsewhere.

    At most so many sweeps; they end where one changes nothing by more than the share `settled` of the largest.
    """
    for _ in range(most):
        largest, changed = 0.0, 0.0
        for i in range(len(y)):
            rest = right[i]
            for j in range(len(y)):
                rest += matrix[i, j] * y[j]
            now = y[i] - rest / matrix[i, i]
            if one_sided[i] and now < 0.0:
                now = 0.0
            changed, y[i] = max(changed, abs(now - y[i])), now
            largest = max(largest, abs(now))
        if changed <= settled * largest:
            return
