"""What a region comes to where it stands: reported of a step that failed, in which nothing moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def fastest(v: Floats) -> float:
    """Speed of the fastest node of velocities v (n, 3) [m/s]."""
    return float(np.sqrt(np.einsum("nc,nc->n", v, v).max(initial=0.0)))


@dataclass(frozen=True, slots=True)
class Totals:
    """Of nodes at places x (n, 3) [m] with velocities v (n, 3) [m/s] and masses (n,) [kg]."""

    kinetic: float
    """[J]"""
    momentum: Floats
    """(3,) [kg m/s]"""
    angular: Floats
    """about the origin (3,) [kg m^2/s]"""
    bounds: Floats
    """lowest and highest coordinates (2, 3) [m]"""

    @classmethod
    def of(cls, x: Floats, v: Floats, mass: Floats) -> Totals:
        kinetic = 0.5 * float(mass @ (v * v).sum(axis=1))
        return cls(kinetic, mass @ v, mass @ np.cross(x, v), np.stack([x.min(axis=0), x.max(axis=0)]))
