"""What a look at the scene's goal finds; see `goal`, whose equations these are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


class NoAdjoint(ArithmeticError):
    """There is a goal, but the body's stiffness as it stands has no factor that would tell what a force does to it."""


@dataclass(frozen=True, slots=True)
class GoalError:
    """The errors of a goal J [N] or [Pa], each by how much J ought to be larger, in its unit."""

    value: float
    """J > 0"""
    mesh: float
    """eq. (2), of FEM's cells; 0 of a probe"""
    model: float
    """eq. (1), of PBD's"""
    cells: NDArray[np.float64]
    """eq. (3) over J (C,) [1]; empty where nobody asked"""

    @property
    def relative(self) -> float:
        """Both over J [1]."""
        return (self.mesh + self.model) / self.value
