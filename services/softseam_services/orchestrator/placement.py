"""Where a body stands: the rigid motion from its place at rest that is nearest to how it is now."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Placement:
    """x = turn x_rest + shift."""

    turn: Floats = field(default_factory=lambda: np.eye(3))
    """(3, 3)"""
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    """[m]"""

    @classmethod
    def fitted(cls, rest: Floats, now: Floats) -> Placement:
        """Of points (n, 3) [m], by least squares (Kabsch, Acta Cryst. A 32 (1976) 922)."""
        middle, here = rest.mean(axis=0), now.mean(axis=0)
        u, _, vt = np.linalg.svd((rest - middle).T @ (now - here))
        mirrored = np.sign(np.linalg.det(vt.T @ u.T))
        turn = vt.T @ np.diag([1.0, 1.0, mirrored]) @ u.T
        return cls(turn, here - turn @ middle)

    def of(self, points: Floats) -> Floats:
        """Points at rest (..., 3) [m] as they are now."""
        return np.asarray(points @ self.turn.T + self.shift)


AT_REST = Placement()
