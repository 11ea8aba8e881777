"""Interfaces: where two parts meet, and what must hold there.

An interface makes rows. Each row is a vector condition on the coupling nodes of two parts, a and b,

    g = w_a x_a - w_b x_b - offset = 0                (c, 3) [m]                                                (1)

and its multiplier (c, 3) [N] is the force on a; b feels what belongs to it, so that the interface does no work:

    f_a = +w_a^T lambda,   f_b = -w_b^T lambda                                                                  (2)

The kinds of interface differ in the rows that they make, and in nothing else: one file each in `interfaces/`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

__all__ = ["Interface"]


@dataclass(frozen=True)
class Interface:
    """The rows of one interface, as they stay for an epoch: c rows, n_a and n_b coupling nodes that they act on."""

    name: str
    parts: tuple[str, str]
    """names of a and b"""
    nodes: tuple[Ints, Ints]
    """places of the nodes among each part's coupling nodes (n_a,), (n_b,)"""
    weights: tuple[Floats | None, Floats | None]
    """w_a (c, n_a) and w_b (c, n_b) [1]; None is the identity"""
    offset: Floats
    """(c, 3) [m]"""

    @property
    def n_rows(self) -> int:
        """Vector conditions, c."""
        return len(self.offset)
