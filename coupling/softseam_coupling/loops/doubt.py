"""How far a part's linear answer is what the part would do: a share kappa of the move, seen when a step was redone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.loop import largest

Floats = NDArray[np.float64]

__all__ = [
    "EXACT",
    "FIRST_DOUBT",
    "FORCE_EXCHANGES",
    "STALE",
    "UNCORRECTED",
    "Linearity",
    "grown",
    "is_force_known",
    "is_linear_enough",
]

FIRST_DOUBT = 0.3
"""kappa of a part of which nothing is known [1]"""
_DOUBT = 1.1
"""growth of a kappa in a step that does not measure it [1]"""
STALE = 0.5
"""kappa, the share of a move that a linear answer is off by, from which on the compliance is found anew [1]"""
_SMALL = 0.02
"""largest move that is not doubted, in cells [1]"""
_DOUBTED_FORCE = 10.0
"""largest force that is doubted, as a share of all multipliers, over the tolerance as a share of a cell [1]"""
FORCE_EXCHANGES = 4
"""exchanges in which a step is redone for a force: after these the gap alone counts"""
EXACT = 1e-8
"""share of the tolerance to which the gaps are closed linearly; moves below it are rounding: they measure no kappa, and
stand for no force [1]"""
UNCORRECTED = 0.5
"""share of the tolerance within which parts agree that cannot be corrected: their gap stays, and does work [1]"""


_LEAST_AGE = 24
"""a part's compliance is found anew after a step that was redone, where it is `STALE` and so old"""


@dataclass(slots=True)
class Linearity:
    """How far a part's linear answer is what it would do; all of it evolves."""

    kappa: float = FIRST_DOUBT
    n_contacts: int = 0
    """at the end of the last step"""
    age: int = 0
    """steps since it reported its compliance"""
    renew: bool = True
    """whether its compliance is to be found anew"""
    repeat: bool = False
    """whether it is to report the compliance at hand again"""
    least_age: int = _LEAST_AGE
    """steps that its compliance serves at least; doubled where it is found anew for its age"""

    def save(self) -> tuple[float, int, int, bool, bool, int]:
        """All of it."""
        return self.kappa, self.n_contacts, self.age, self.renew, self.repeat, self.least_age

    def to_array(self) -> Floats:
        """All of it."""
        return np.array(self.save(), dtype=np.float64)

    @classmethod
    def of(cls, array: Floats) -> Linearity:
        """From `to_array`."""
        kappa, n_contacts, age, renew, repeat, least_age = array.tolist()
        return cls(kappa, int(n_contacts), int(age), bool(renew), bool(repeat), int(least_age))


def grown(kappa: float) -> float:
    """Of a part, after a step that did not measure it."""
    return min(1.0, _DOUBT * kappa)


def is_linear_enough(kappa: float, move: Floats, cell: float, tolerance: float) -> bool:
    """Whether a linear answer (n, 3) [m] is what the part would do, to the tolerance [m]; cell: an edge [m]."""
    length = largest(move)
    return length <= _SMALL * cell and kappa * length <= tolerance


def is_force_known(kappa: float, move: Floats, push: Floats, found: float, cell: float, tolerance: float) -> bool:
    """Whether the force behind a linear answer (n, 3) [N] is doubted by little beside what is found in all [N]."""
    if largest(move) <= EXACT * tolerance:
        return True
    return kappa * float(np.abs(push).sum()) <= _DOUBTED_FORCE * tolerance / cell * found
