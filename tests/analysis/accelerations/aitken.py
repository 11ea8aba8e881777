"""Aitken's dynamic relaxation: one omega for all unknowns, by the secant of the last two rounds.

    omega_k = -omega_(k-1) r_(k-1) . (r_k - r_(k-1))/|r_k - r_(k-1)|^2,   lambda <- lambda + omega_k r_k          (1)

with r = `wanted` (Irons and Tuck, Int. J. Numer. Meth. Engng 1, 1969, 275; for vectors: Kuettler and Wall, Comput.
Mech. 43, 2008, 61-72, doi:10.1007/s00466-008-0255-5, eq. 44). A step begins with the omega of the last one, cut to
`first`: what closed the last gap may be far too much for the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.accelerations.memory import Floats, Memory

_OMEGA, _TRIED = 0, 1


@dataclass(frozen=True)
class Aitken:
    """Eq. (1)."""

    first: float = 0.7
    """omega of the first step, and most of any step's first round [1]"""

    def init(self, n: int) -> Memory:
        return Memory(np.zeros((1, n)), np.array([self.first, 0.0]))

    def begin(self, memory: Memory) -> None:
        memory.numbers[_TRIED] = 0.0

    def next(self, memory: Memory, lambda_: Floats, wanted: Floats) -> Floats:
        omega = float(memory.numbers[_OMEGA])
        if memory.numbers[_TRIED] == 0.0:
            omega = float(np.copysign(min(abs(omega), self.first), omega))
        else:
            last = memory.vectors[0]
            change = wanted - last
            square = float(change @ change)
            if square > 0.0:
                omega = -omega * float(last @ change) / square
        memory.vectors[0] = wanted
        memory.numbers[_OMEGA], memory.numbers[_TRIED] = omega, 1.0
        return lambda_ + omega * wanted

    def end(self, memory: Memory) -> None:
        """The omega found stays."""
