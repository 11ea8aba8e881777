"""What a kind of rung brings: when a body is on it, what the body is there, and what carries over."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Standing:
    """A body as a step begins."""

    time: float
    """[s]"""
    kinetic: float
    """[J]"""
    strain: float
    """[J]"""


@dataclass(frozen=True)
class Discretised:
    """A body on a rung: N nodes."""

    x_rest: Floats
    """(N, 3) [m]"""
    mass: Floats
    """(N,) [kg]"""
    x: Floats
    """(N, 3) [m]"""
    v: Floats
    """(N, 3) [m/s]"""


class Rung(Protocol):
    """One rung of a body's ladder."""

    def holds(self, body: Standing) -> bool:
        """Whether the body is to be on it in the step that begins; of those that hold, the last counts."""

    def body(self, spec: Any) -> Any:
        """The specification of the body on it, of that which the scene has."""

    def carry(self, old: Discretised, new: Discretised) -> tuple[Floats, Floats]:
        """Positions [m] and velocities [m/s] (N, 3) with which the body goes on, on this rung; `new` is at rest."""
