"""What an acceleration is, and what of it evolves.

An acceleration closes the gap between two sides that give no compliance. It sees the multiplier lambda that was tried
and the force `wanted` that its gap g asks for by a rough guess of the seam's compliance, a diagonal H_0,

    wanted = -H_0^-1 g                                                        (1)

and answers with the multiplier to try next: a fixed-point iteration lambda <- lambda + wanted, accelerated. The guess
scales every unknown alike, so that an acceleration has no units to know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

__all__ = ["Acceleration", "Memory"]


@dataclass(slots=True)
class Memory:
    """Everything of an acceleration that evolves; n unknowns."""

    vectors: Floats
    """(rows, n) [N]"""
    numbers: Floats
    """(k,)"""


class Acceleration(Protocol):
    """Configuration; never changes. A step is `begin`, then `next` after every exchange, then `end`."""

    def init(self, n: int) -> Memory:
        """What is known before the first step of n unknowns."""

    def begin(self, memory: Memory) -> None:
        """A step begins: pairs of exchanges are made of its own tries only."""

    def next(self, memory: Memory, lambda_: Floats, wanted: Floats) -> Floats:
        """The multiplier to try next (n,) [N], a new array, after lambda_ (n,) left what eq. (1) wants (n,)."""

    def end(self, memory: Memory) -> None:
        """The step was accepted."""
