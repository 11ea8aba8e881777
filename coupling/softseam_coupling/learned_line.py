"""The far side as a line, x = c - H' lambda: its compliance as it was probed, and what rounds have taught of it since.

A probe tells H, the far side's compliance as it stood then. Where its points begin to slip on the ground, let go of it
or find it, the far side answers otherwise, in a few directions and for many steps. Rounds of one step show how: its
multiplier changed by d, its image moved by -y, and e = y - H d is what H misses. With the last pairs (d_i, e_i), newest
first, those left out that say nothing new,

    H' = H + E (D^T H D)^-1 (H D)^T                 E = (e_1 ...), D = (d_1 ...)                                 (1)

is exact for them and H for all that is orthogonal to them in the energy that a multiplier costs: a multi-secant update
of Broyden's kind (Fang and Saad 2009, doi:10.1002/nla.617), kept from step to step. S = H^-1, and with it the near
side's yield Y beside S, stay: both sides together yield by the inverse of G = S - S Y S, and with H' in place of H a
force that closes a gap is found by a system with as many unknowns as there are pairs (`kernels.link`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.learned_line import keep_new, multiply_symmetric, yield_to

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

__all__ = ["PAIRS", "LearnedLine"]

PAIRS = 6
"""rounds that are remembered"""


class LearnedLine:
    """H, S and the pairs of eq. (1); all of it evolves. n unknowns."""

    def __init__(self, n: int) -> None:
        self.h = np.zeros((n, n))
        """symmetric (n, n) [m/N]"""
        self.s = np.zeros((n, n))
        """its inverse [N/m]"""
        self.changes, self.defects, self.along, self.pushes, self.moves, self.answers = np.zeros((6, PAIRS, n))
        """d and e of each pair, newest first and scaled so that d . H d = 1; H d, S e, Y S e and G e (PAIRS, n)"""
        self._count = 0
        self._kept: Ints = np.zeros(PAIRS, dtype=np.int64)
        self._n_kept = 0
        self._near: tuple[Floats, bool] | None = None
        self._n_answered = 0  # pairs, the newest first, whose moves and answers are missing

    @property
    def kept(self) -> Ints:
        """Pairs that eq. (1) is made of (k,)."""
        return self._kept[: self._n_kept]

    def renew(self, h: Floats, s: Floats) -> None:
        """Take a new compliance (n, n) and its inverse; what rounds taught is kept: they moved as they did."""
        count = self._count
        moved = self.defects[:count] + self.along[:count]
        self.h, self.s = h, s
        multiply_symmetric(h, self.changes[:count], self.along[:count])
        self.defects[:count] = moved - self.along[:count]
        self._scale(count)

    def learn(self, change: Floats, moved: Floats) -> None:
        """In a step the multiplier was another by `change` (n,) [N], and the image had moved so (n,) [m]."""
        for array in (self.changes, self.defects, self.along, self.pushes, self.moves, self.answers):
            array[1:] = array[:-1].copy()
        self._count = min(self._count + 1, PAIRS)
        self.changes[0] = change
        multiply_symmetric(self.h, self.changes[:1], self.along[:1])
        self.defects[0] = -moved - self.along[0]
        self._scale(1)

    def forget(self) -> None:
        """What rounds taught."""
        self._count = self._n_kept = self._n_answered = 0

    def _scale(self, newest: int) -> None:
        """The newest pairs are scaled and multiplied; a pair that costs no energy ends what is remembered."""
        energy = np.einsum("pi,pi->p", self.changes[:newest], self.along[:newest])
        if not (energy > 0.0).all():
            self.forget()
            return
        for array in (self.changes, self.defects, self.along):
            array[:newest] /= np.sqrt(energy)[:, None]
        multiply_symmetric(self.s, self.defects[:newest], self.pushes[:newest])
        self._n_answered = min(self._n_answered + newest, self._count)
        self._choose()

    def _choose(self) -> None:
        self._n_kept = keep_new(self.changes, self.along, self._count, self._kept)

    def beside(self, y: Floats, rooted: bool) -> None:
        """The near side yields by y beside S: Y or, rooted, R with Y = R R^T (n, n)."""
        if self._near is None or self._near[0] is not y:
            self._near, self._n_answered = (y, rooted), self._count
        new = self._n_answered
        if new:
            yield_to(y, rooted, self.pushes[:new], self.moves[:new])
            multiply_symmetric(self.s, self.moves[:new], self.answers[:new])
            self.answers[:new] = self.pushes[:new] - self.answers[:new]
            self._n_answered = 0

    def to_array(self) -> Floats:
        """The pairs (3, p, n)."""
        return np.stack([array[: self._count] for array in (self.changes, self.defects, self.along)])

    def take(self, h: Floats, s: Floats, pairs: Floats) -> None:
        """Continue from `to_array` with a compliance and its inverse."""
        self.h, self.s, self._near = h, s, None
        self._count = self._n_answered = count = pairs.shape[1]
        self.changes[:count], self.defects[:count], self.along[:count] = pairs
        multiply_symmetric(s, self.defects[:count], self.pushes[:count])
        self._choose()
