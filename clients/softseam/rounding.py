"""What of a quantity is rounding: values too small for the scene that they are of, which are shown as 0.

A solid of Young's modulus E and extent L that strains by e moves by e L, bears stresses of e E, pulls with e E L^2 and
stores e^2 E L^3. No weight and no tool strains a body by less than 1e-9: what is smaller than that makes is rounding.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.scene import Scene

_STRAIN = 1e-9
"""its own weight strains the stiffest food, a few millimetres of it, by ten times as much"""
_BESIDE = 1e-9
"""of the largest value of a quantity: what is less is rounding beside it"""


class Rounding:
    """Knows, for one scene, from which size on a value says something."""

    def __init__(self, scene: Scene) -> None:
        self._floor: dict[str, float] = {}
        for body in scene.bodies.values():
            for unit, floor in _floors(body).items():
                self._floor[unit] = min(floor, self._floor.get(unit, floor))

    def least(self, unit: str, values: NDArray[np.float64]) -> float:
        """Size below which these values (n,) of one quantity, in this unit, are rounding."""
        return max(self._floor.get(unit, 0.0), _BESIDE * float(np.abs(values).max(initial=0.0)))


def _floors(body: AnyBody) -> Mapping[str, float]:
    """By unit, what a strain of `_STRAIN` makes of a body."""
    length = max(body.own_lengths, default=1.0)  # of a mesh, whose extent its file alone has, a metre
    stiffness = body.strain_force(length)
    return {
        "1": _STRAIN,
        "m": _STRAIN * length,
        "Pa": _STRAIN * stiffness / length**2,
        "N": _STRAIN * stiffness,
        "J": _STRAIN**2 * stiffness * length,
    }
