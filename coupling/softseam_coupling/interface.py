"""Interfaces: where two parts meet, and what must hold there.

An interface makes rows. Each row is a vector condition on the coupling nodes of two parts, a and b,

    g = w_a x_a - w_b x_b - offset + C lambda = 0     (c, 3) [m]                                                (1)

and its multiplier (c, 3) [N] is the force on a; b feels what belongs to it, so that the interface does no work:

    f_a = +w_a^T lambda,   f_b = -w_b^T lambda                                                                  (2)

C is the row's own compliance; without one it is a constraint. One with a normal n is unilateral: it presses along it
only, and only where it would close,

    lambda = p n,   p >= 0,   n . g >= 0,   p n . g = 0                                                         (3)

and with friction mu also across n, by t with |t| <= mu p, which holds what sticks and goes against what slides.

The kinds of interface differ in the rows that they make, and in nothing else:
one file each in `interfaces/`.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

__all__ = ["Interface"]


@dataclass(frozen=True)
class Interface:
    """The rows of one interface in a step, c in every one, and the n_a and n_b coupling nodes that they act on."""

    name: str
    parts: tuple[str, str]
    """names of a and b"""
    nodes: tuple[Ints, Ints]
    """places of the nodes among each part's coupling nodes (n_a,), (n_b,)"""
    weights: tuple[Floats | None, Floats | None]
    """w_a (c, n_a) and w_b (c, n_b) [1]; None is the identity"""
    offset: Floats
    """(c, 3) [m]"""
    compliance: Floats = field(default_factory=lambda: np.zeros(0))
    """C of each row (c,) [m/N]; empty: none"""
    normal: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """unit vectors from b to a of rows that press (c, 3) [1], zero of those that hold; empty: all hold"""
    friction: Floats = field(default_factory=lambda: np.zeros(0))
    """mu of rows that press (c,) [1]; empty: none"""
    ids: NDArray[np.int64] | None = None
    """names of rows that come and go, each once (c,); None: rows are as many in every step"""

    @property
    def n_rows(self) -> int:
        """Vector conditions, c."""
        return len(self.offset)
