"""What a grip is rewarded with: terms, each the change of a potential, times a weight that may grow with training.

The rewards of an episode then add up to the potentials at its end, less those at its start, whatever the way there
(Ng, Harada and Russell, Int. Conf. Machine Learning 1999, 278). Potentials are of order 1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from softseam.errors import BadInput


@dataclass(frozen=True)
class Grip:
    """How a body stands between two pads, at the end of a step; of k bodies, each number is an array (k,)."""

    lift: Any
    """of its centre of mass [m]"""
    air: Any
    """between pads and body, both sides together; 0 when they touch [m]"""
    force: Any
    """that the weaker pad presses with [N]"""
    slip: Any
    """farthest that a touching point has slid along a pad, so far [m]"""
    compression: Any
    """largest so far [1]"""
    stress: Any
    """largest von Mises stress of any octant so far [Pa]"""
    energy: Any
    """strain energy [J]"""


@dataclass(frozen=True)
class Ramp:
    """A weight that is `start` until so many steps of all environments were taken, and `end` from a later one on."""

    first: float
    last: float
    end: float
    start: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.first < self.last:
            raise BadInput(f"a weight that grows from step {self.first!r} to {self.last!r}: the first comes first")

    def at(self, steps: float) -> float:
        """After so many steps."""
        part = min(max((steps - self.first) / (self.last - self.first), 0.0), 1.0)
        return self.start + part * (self.end - self.start)


@dataclass(frozen=True)
class Term(ABC):
    """One row of a reward. A subclass says its potential."""

    weight: float | Ramp

    @abstractmethod
    def potential(self, grip: Grip) -> Any:
        """Of order 1; more is better."""

    def of(self, before: Grip, after: Grip, steps: float) -> Any:
        """What a step is rewarded with, after so many steps of training."""
        weight = self.weight.at(steps) if isinstance(self.weight, Ramp) else self.weight
        return weight * (self.potential(after) - self.potential(before)) if weight else 0.0


@dataclass(frozen=True)
class Lift(Term):
    """Part of a height that the body was lifted by."""

    weight: float | Ramp = 2.0
    height: float = 0.03
    """[m]"""

    def potential(self, grip: Grip) -> Any:
        return np.minimum(grip.lift / self.height, 1.0)


@dataclass(frozen=True)
class Way(Term):
    """That pads come closer to the body, in parts of 20 mm: a hint where to go."""

    weight: float | Ramp = 0.3

    def potential(self, grip: Grip) -> Any:
        return -grip.air / 0.02


@dataclass(frozen=True)
class Touch(Term):
    """That both pads press, however little: F/(F + 0.3 N)."""

    weight: float | Ramp = 0.3

    def potential(self, grip: Grip) -> Any:
        return grip.force / (grip.force + 0.3)


@dataclass(frozen=True)
class StressConcentration(Term):
    """That the largest stress grows no further, in parts of 3 kPa. Its growths add up to the peak of an episode."""

    weight: float | Ramp = Ramp(30e3, 150e3, 1.0)

    def potential(self, grip: Grip) -> Any:
        return -grip.stress / 3e3


@dataclass(frozen=True)
class Deformation(Term):
    """That the body is squeezed no further, in parts of 10 %."""

    weight: float | Ramp = 0.1

    def potential(self, grip: Grip) -> Any:
        return -grip.compression / 0.1


@dataclass(frozen=True)
class GraspStability(Term):
    """That nothing slips, in parts of 5 mm."""

    weight: float | Ramp = 0.1

    def potential(self, grip: Grip) -> Any:
        return -grip.slip / 5e-3


@dataclass(frozen=True)
class Energy(Term):
    """That little energy is stored in the body, in mJ."""

    weight: float | Ramp = 0.01

    def potential(self, grip: Grip) -> Any:
        return -grip.energy / 1e-3


GENTLE: tuple[Term, ...] = (Lift(), Way(), Touch(), StressConcentration())
"""first lift, then gently (docs/decisions/40)"""
