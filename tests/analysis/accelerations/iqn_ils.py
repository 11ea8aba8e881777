"""Interface quasi-Newton with an inverse Jacobian from a least-squares problem (IQN-ILS).

With r = `wanted` and w = lambda + r, the columns V of changes of r between rounds and W of changes of w, newest first:

    c = argmin |V c + r|,   lambda <- w + W c                                                           (1)

(Degroote, Bathe and Vierendeels, Comput. Struct. 87, 2009, 793-801, doi:10.1016/j.compstruc.2008.11.013.) Columns of
the last `windows` steps are kept. The least squares are solved by orthogonalising the columns, newest first; one that
keeps less than `filter` of its length says little that newer ones do not, and is dropped for good: Haelterman et al.,
Comput. Struct. 171, 2016, 9-17, doi:10.1016/j.compstruc.2016.04.001. A column of zeros is dropped with them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.accelerations.memory import Floats, Memory

_COUNT, _TRIED, _AGES = 0, 1, 2
_ROWS = 4


@dataclass(frozen=True)
class IqnIls:
    """Eq. (1). `memory.vectors`: last r and w, best lambda and its r, then `columns` rows of V and as many of W."""

    first: float = 0.7
    """relaxation of a round without any column [1]"""
    columns: int = 60
    """most that are kept"""
    windows: int = 8
    """steps whose columns serve the next; 0: each step begins afresh"""
    filter: float = 1e-2
    """[1]"""
    worse: float = 2.0
    """a round that leaves so many times the least residual of its step is taken back: contacts that stick and slip make
    columns that mislead, so all are dropped, and the best try so far is relaxed [1]"""

    def init(self, n: int) -> Memory:
        return Memory(np.zeros((_ROWS + 2 * self.columns, n)), np.zeros(_AGES + self.columns))

    def begin(self, memory: Memory) -> None:
        memory.numbers[_TRIED] = 0.0

    def next(self, memory: Memory, lambda_: Floats, wanted: Floats) -> Floats:
        v, w, age = self._parts(memory)
        target = lambda_ + wanted
        if memory.numbers[_TRIED] == 1.0 and self.columns:
            count = min(int(memory.numbers[_COUNT]), self.columns - 1)
            for rows in (v, w, age):
                rows[1 : count + 1] = rows[:count].copy()
            v[0], w[0], age[0] = wanted - memory.vectors[0], target - memory.vectors[1], 0.0
            memory.numbers[_COUNT] = count + 1
        best, least = memory.vectors[2], memory.vectors[3]
        if memory.numbers[_TRIED] == 0.0 or wanted @ wanted <= least @ least:
            best[:], least[:] = lambda_, wanted
        memory.vectors[0], memory.vectors[1], memory.numbers[_TRIED] = wanted, target, 1.0
        if wanted @ wanted > self.worse**2 * (least @ least):
            memory.numbers[_COUNT] = memory.numbers[_TRIED] = 0.0  # nor is there to be a pair with this round
            return np.asarray(best + self.first * least)
        directions, images = self._filtered(memory)
        if not len(directions):
            return lambda_ + self.first * wanted
        return np.asarray(target - (directions @ wanted) @ images)

    def end(self, memory: Memory) -> None:
        """A step more since the columns were made; the oldest are forgotten."""
        _, _, age = self._parts(memory)
        count = int(memory.numbers[_COUNT])
        age[:count] += 1.0
        memory.numbers[_COUNT] = np.count_nonzero(age[:count] <= self.windows)

    def _parts(self, memory: Memory) -> tuple[Floats, Floats, Floats]:
        """V and W (columns, n), newest first, and how many steps ago each was made (columns,): views."""
        return (
            memory.vectors[_ROWS : _ROWS + self.columns],
            memory.vectors[_ROWS + self.columns :],
            memory.numbers[_AGES:],
        )

    def _filtered(self, memory: Memory) -> tuple[Floats, Floats]:
        """Orthonormal combinations of the columns of V (k, n), and the same ones of W; poor columns are dropped."""
        v, w, age = self._parts(memory)
        count = int(memory.numbers[_COUNT])
        directions: list[Floats] = []
        images: list[Floats] = []
        kept = []
        for i in range(count):
            q, z = v[i].copy(), w[i].copy()
            length = float(np.sqrt(q @ q))
            for direction, image in zip(directions, images, strict=True):
                along = float(direction @ q)
                q -= along * direction
                z -= along * image
            size = float(np.sqrt(q @ q))
            if len(directions) < len(q) and size > self.filter * length:
                directions.append(q / size)
                images.append(z / size)
                kept.append(i)
        for rows in (v, w, age):
            rows[: len(kept)] = rows[kept].copy()
        memory.numbers[_COUNT] = len(kept)
        n = memory.vectors.shape[1]
        return np.array(directions).reshape(-1, n), np.array(images).reshape(-1, n)
