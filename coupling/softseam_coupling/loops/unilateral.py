"""Rows that press: multipliers that push bodies apart, and never pull, with friction or without, beside rows that hold.

With r = q + W lambda what is left of the gaps (c, 3), a row that presses along n has lambda = p n + t and

    p >= 0,   s = n . r >= 0,   p s = 0,                                                                        (1)
    |t| <= mu p,   r_t = 0 where |t| < mu p, else t = -a r_t with a >= 0                                        (2)

where r_t is r across n; a row that holds has r = 0. Rows are taken to press where p - s/d > 0, d the diagonal, the
others to be open; what presses sticks where |t - r_t/d| <= mu p, else it slides. What that makes of (1) and (2) is
solved, and again, until nothing changes: a semi-smooth Newton method (Hintermueller, Ito and Kunisch, SIAM J. Optim.
13, 2003, 865-888; with friction Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991, 353-375). Where it
cycles, rows are swept one after the other (projected Gauss-Seidel).
"""

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.sweep import ALONG, FIRST_ACROSS, HOLDS, SECOND_ACROSS, sweep

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

__all__ = ["Unilateral"]

MOST = 50
"""solves before rows are swept"""
_SWEEPS = 2000
_SETTLED = 1e-12
"""change of a sweep, or of a solve with friction, relative to the largest multiplier, at which they end [1]"""
_STUCK = 1e-9
"""of the bound of friction: by less than that a multiplier is at it [1]"""


class Unilateral:
    """Of rows of which some press. normal (c, 3), zero of those that hold; friction (c,): mu [1]; empty: none."""

    def __init__(self, normal: Floats, friction: Floats | None = None) -> None:
        self._normal, n_rows = normal, len(normal)
        self._friction = friction if friction is not None and len(friction) else np.zeros(n_rows)
        self._presses: Mask = np.asarray(normal.any(axis=1))
        rubs = self._presses & (self._friction > 0.0)
        taken = np.ones((n_rows, 3), dtype=np.bool_)
        taken[self._presses & ~rubs, 1:] = False  # one unknown of a row that only presses, three of any other
        directions = np.tile(np.eye(3), (n_rows, 1, 1))
        directions[self._presses, 0] = normal[self._presses]
        directions[rubs, 1], directions[rubs, 2] = _across(normal[rubs])
        row, place = np.nonzero(taken)
        self._directions, self._taken = directions, taken.ravel()
        """of up to three unknowns of each row (c, 3, 3), and which of these there are (3c,)"""
        self._kind = np.where(self._presses[row], place, HOLDS).astype(np.int8)
        """of each unknown: `HOLDS`, or along or across a normal (m,)"""
        self._bound = self._friction[row]
        self._rubs = bool(rubs.any())

    def allowed(self, multipliers: Floats) -> Floats:
        """Without what pulls, or goes across by more than friction holds (c, 3) [N]."""
        along = np.maximum(np.einsum("ck,ck->c", self._normal, multipliers), 0.0)
        pressing = along[:, None] * self._normal
        if self._rubs:
            across = multipliers - np.einsum("ck,ck->c", self._normal, multipliers)[:, None] * self._normal
            size = np.linalg.norm(across, axis=1)
            share = np.divide(self._friction * along, size, out=np.zeros_like(size), where=size > 0.0)
            pressing = pressing + np.minimum(share, 1.0)[:, None] * across
        return np.where(self._presses[:, None], pressing, multipliers)

    def left(self, gap: Floats, multipliers: Floats) -> Floats:
        """What is left of the gaps (c, 3) [m]: of a row that presses along its normal, and across it where it sticks;
        of an open one what overlaps."""
        along = np.einsum("ck,ck->c", self._normal, gap)
        force = np.einsum("ck,ck->c", self._normal, multipliers)
        counts = np.where(force > 0.0, along, np.minimum(along, 0.0))[:, None] * self._normal
        if self._rubs:
            across = np.linalg.norm(multipliers - force[:, None] * self._normal, axis=1)
            sticks = (force > 0.0) & (across < (1.0 - _STUCK) * self._friction * force)
            counts = np.where(sticks[:, None], gap, counts)
        return np.where(self._presses[:, None], counts, gap)

    def solve(self, w: Floats, q: Floats, first: Floats | None = None) -> Floats:
        """Multipliers (c, 3) [N] with (1) and (2), of W (3c, 3c) [m/N] and q (c, 3) [m]; with friction found from
        `first` (c, 3) [N]."""
        matrix, right = self._matrix(w), self._to_unknowns(q)
        if self._rubs:
            y, found = self._rub(matrix, right, np.zeros(len(right)) if first is None else self._to_unknowns(first))
        else:
            y, found = self._press(matrix, right)
        if not found:
            y = np.where(self._kind == ALONG, np.maximum(y, 0.0), y)
            sweep(matrix, right, self._kind, self._bound, y, _SWEEPS, _SETTLED)
        every = np.zeros(len(self._taken))
        every[self._taken] = y
        return np.asarray(np.einsum("cuk,cu->ck", self._directions, every.reshape(-1, 3)))

    def _to_unknowns(self, vectors: Floats) -> Floats:
        """Of vectors (c, 3) what is along the unknowns (m,)."""
        return np.asarray(np.einsum("cuk,ck->cu", self._directions, vectors).ravel()[self._taken])

    def _matrix(self, w: Floats) -> Floats:
        """W (3c, 3c) between unknowns (m, m): the directions of a row are its own three."""
        n = len(self._taken)
        half = np.matmul(self._directions, w.reshape(n // 3, 3, n)).reshape(n, n)
        whole = np.matmul(self._directions, half.T.reshape(n // 3, 3, n)).reshape(n, n)
        return np.asarray(whole if self._taken.all() else whole[np.ix_(self._taken, self._taken)])

    def _press(self, matrix: Floats, right: Floats) -> tuple[Floats, bool]:
        """The unknowns without friction (m,), and whether the active sets settled."""
        scale, y, held = matrix.diagonal(), np.zeros(len(right)), self._kind != ALONG
        for _ in range(MOST):
            active = held | (scale * y - (right + matrix @ y) > 0.0)
            found = np.zeros(len(right))
            if active.any():
                found[active] = np.linalg.solve(matrix[np.ix_(active, active)], -right[active])
            y = found
            if np.array_equal(active, held | (scale * y - (right + matrix @ y) > 0.0)):
                return y, True
        return y, False

    def _rub(self, matrix: Floats, right: Floats, y: Floats) -> tuple[Floats, bool]:
        """As `_press`, with friction, from y (m,): Newton's method on the projections of (1) and (2)."""
        kind, one, scale = self._kind, np.eye(len(right)), matrix.diagonal()
        n = np.flatnonzero(kind == ALONG)
        rubs = n[self._bound[n] > 0.0]
        pairs = np.stack([rubs + FIRST_ACROSS, rubs + SECOND_ACROSS], axis=1)
        across = 0.5 * (scale[pairs[:, 0]] + scale[pairs[:, 1]])
        for _ in range(MOST):
            left = right + matrix @ y
            residual, slope = left.copy(), matrix.copy()
            trial = y - left / scale
            shut = trial[rubs] > 0.0
            tried = y[pairs] - left[pairs] / across[:, None]
            size, bound = np.linalg.norm(tried, axis=1), self._bound[rubs] * np.maximum(trial[rubs], 0.0)
            slides = np.flatnonzero(shut & (size > bound))
            rest = np.ones(len(right), dtype=np.bool_)
            rest[n[trial[n] <= 0.0]] = rest[pairs[~shut]] = False  # what is open has no force
            if len(slides):
                way, place = tried[slides] / size[slides, None], pairs[slides]
                share, mu, along = bound[slides] / size[slides], self._bound[rubs[slides]], rubs[slides]
                by_along = one[along] - matrix[along] / scale[along, None]
                by_across = one[place] - matrix[place] / across[slides, None, None]
                turned = by_across - way[:, :, None] * np.einsum("sk,skm->sm", way, by_across)[:, None]
                bent = (mu[:, None] * way)[:, :, None] * by_along[:, None] + share[:, None, None] * turned
                residual[place] = y[place] - bound[slides, None] * way
                slope[place] = one[place] - bent
            step = -y
            step[rest] = np.linalg.solve(
                slope[np.ix_(rest, rest)], slope[np.ix_(rest, ~rest)] @ y[~rest] - residual[rest]
            )
            y = y + step
            if np.abs(step).max() <= _SETTLED * np.abs(y).max():
                return y, True
        return np.where(np.isfinite(y), y, 0.0), False


def _across(normal: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors across each normal and each other (c, 3): the first across the axis that is least along it."""
    axis = np.eye(3)[np.abs(normal).argmin(axis=1)] if len(normal) else normal
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)
