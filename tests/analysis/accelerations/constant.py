"""Constant relaxation: lambda <- lambda + omega wanted.

Converges where 0 < omega h < 2 for every eigenvalue h of H_0^-1 H, by max |1 - omega h| a round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.accelerations.memory import Floats, Memory


@dataclass(frozen=True)
class Constant:
    """The same share of what the gap asks for, every round."""

    omega: float = 0.7
    """[1]"""

    def init(self, n: int) -> Memory:
        return Memory(np.zeros((0, n)), np.zeros(0))

    def begin(self, memory: Memory) -> None:
        """Nothing evolves."""

    def next(self, memory: Memory, lambda_: Floats, wanted: Floats) -> Floats:
        return lambda_ + self.omega * wanted

    def end(self, memory: Memory) -> None:
        """Nothing evolves."""
