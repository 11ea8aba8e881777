"""Rows that press: multipliers that push bodies apart, and never pull, beside rows that hold.

With r = q + W lambda what is left of the gaps (c, 3), a row that presses along n has lambda = p n and

    p >= 0,   s = n . r >= 0,   p s = 0,                                                                        (1)

and a row that holds has r = 0. Rows are taken to press where p - s/d > 0, d the diagonal, the others to be open; what
presses is closed by a linear solve, and again, until none changes (a primal and dual active set method: Hintermueller,
Ito and Kunisch, SIAM J. Optim. 13, 2003, 865-888, a semi-smooth Newton method). Where that cycles, rows are swept one
after the other (projected Gauss-Seidel).
"""

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.sweep import sweep

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

__all__ = ["Unilateral"]

_MOST = 50
"""solves before rows are swept"""
_SWEEPS = 2000
_SETTLED = 1e-12
"""change of a sweep, relative to the largest multiplier, at which sweeps end [1]"""


class Unilateral:
    """Of rows of which some press. normal (c, 3), zero of those that hold."""

    def __init__(self, normal: Floats) -> None:
        self._normal, n_rows = normal, len(normal)
        self._presses: Mask = np.asarray(normal.any(axis=1))
        taken = np.ones((n_rows, 3), dtype=np.bool_)
        taken[self._presses, 1:] = False  # one unknown of a row that presses, three of one that holds
        directions = np.tile(np.eye(3), (n_rows, 1, 1))
        directions[self._presses, 0] = normal[self._presses]
        row, place = np.nonzero(taken)
        self._unknowns = np.zeros((3 * n_rows, len(row)))
        """rows of the unknowns (3c, m) [1]"""
        for axis in range(3):
            self._unknowns[3 * row + axis, np.arange(len(row))] = directions[row, place, axis]
        self._one_sided: Mask = np.asarray(self._presses[row])

    def allowed(self, multipliers: Floats) -> Floats:
        """Without what pulls, or goes across (c, 3) [N]."""
        along = np.maximum(np.einsum("ck,ck->c", self._normal, multipliers), 0.0)
        return np.where(self._presses[:, None], along[:, None] * self._normal, multipliers)

    def left(self, gap: Floats, multipliers: Floats) -> Floats:
        """What is left of the gaps (c, 3) [m]: of a row that presses along its normal, of an open one what overlaps."""
        along = np.einsum("ck,ck->c", self._normal, gap)
        pressed = np.einsum("ck,ck->c", self._normal, multipliers) > 0.0
        counts = np.where(pressed, along, np.minimum(along, 0.0))
        return np.where(self._presses[:, None], counts[:, None] * self._normal, gap)

    def solve(self, w: Floats, q: Floats) -> Floats:
        """Multipliers (c, 3) [N] with (1), of W (3c, 3c) [m/N] and q (c, 3) [m]."""
        t = self._unknowns
        matrix, right = t.T @ w @ t, t.T @ q.reshape(-1)
        scale, y = matrix.diagonal(), np.zeros(len(right))
        held = ~self._one_sided
        for _ in range(_MOST):
            active = held | (scale * y - (right + matrix @ y) > 0.0)
            found = np.zeros(len(right))
            if active.any():
                found[active] = np.linalg.solve(matrix[np.ix_(active, active)], -right[active])
            y = found
            if np.array_equal(active, held | (scale * y - (right + matrix @ y) > 0.0)):
                break
        else:
            y = np.where(held, y, np.maximum(y, 0.0))
            sweep(matrix, right, self._one_sided, y, _SWEEPS, _SETTLED)
        return np.asarray((t @ y).reshape(-1, 3))
