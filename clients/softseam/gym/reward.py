"""What a task is rewarded with: terms, each the change of a potential, times a weight that may grow with training.

A term goes with every task whose body stands in a way that has what the term looks at: `StressConcentration` with all
that measure a stress. The rewards of an episode then add up to the potentials at its end, less those at its start,
whatever the way there (Ng, Harada and Russell, Int. Conf. Machine Learning 1999, 278). Potentials are of order 1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Generic, TypeVar

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
class Push:
    """How a body stands that a finger pushes, at the end of an action."""

    distance: float
    """from its marker to the target [m]"""
    aside: float
    """of it, across the way ahead [m]"""
    air: float
    """between finger and body, along the push; 0 when they touch [m]"""
    force: float
    """that the finger pushes with [N]"""
    stress: float
    """largest von Mises stress of any octant so far [Pa]"""
    energy: float
    """strain energy [J]"""


@dataclass(frozen=True)
class Fold:
    """How a cloth lies that is folded, at the end of an action."""

    corners: float
    """mean distance of the corners that are held from where they belong, in parts of the cloth's edge"""
    area: float
    """part of the free half that lies on its place on the other half"""
    stretch: float
    """largest relative change of a spring's length so far"""


@dataclass(frozen=True)
class Ramp:
    """A number that is `start` until so many steps of all environments were taken, and `end` from a later one on."""

    first: float
    last: float
    end: float
    start: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.first < self.last:
            raise BadInput(f"a number that changes from step {self.first!r} to {self.last!r}: the first comes first")

    @classmethod
    def of(cls, number: float | Ramp) -> Ramp:
        """A number that stays as it is, or one that is a ramp already."""
        return number if isinstance(number, Ramp) else cls(0.0, 1.0, number, number)

    def at(self, steps: float) -> float:
        """After so many steps."""
        part = min(max((steps - self.first) / (self.last - self.first), 0.0), 1.0)
        return self.start + part * (self.end - self.start)


Standing = TypeVar("Standing", contravariant=True)


@dataclass(frozen=True)
class Term(ABC, Generic[Standing]):
    """One row of a reward. A subclass says its potential of how a body stands: `Grip`, `Push`, `Fold`."""

    weight: float | Ramp

    @abstractmethod
    def potential(self, standing: Standing) -> Any:
        """Of order 1; more is better."""

    def of(self, before: Standing, after: Standing, steps: float) -> Any:
        """What a step is rewarded with, after so many steps of training."""
        weight = Ramp.of(self.weight).at(steps)
        return weight * (self.potential(after) - self.potential(before)) if weight else 0.0


class Share(Term[Any]):
    """A number of how a body stands, in parts of `part`: where that is negative, less is better."""

    number: ClassVar[str]
    """an attribute of `Grip`, `Push` or `Fold`"""
    part: ClassVar[float]

    def potential(self, standing: Any) -> Any:
        return getattr(standing, self.number) / self.part


@dataclass(frozen=True)
class Lift(Term[Grip]):
    """Part of a height that the body was lifted by."""

    weight: float | Ramp = 2.0
    height: float = 0.03
    """[m]"""

    def potential(self, standing: Grip) -> Any:
        return np.minimum(standing.lift / self.height, 1.0)


@dataclass(frozen=True)
class Way(Share):
    """That tools come closer to the body, in parts of 20 mm: a hint where to go."""

    weight: float | Ramp = 0.3
    number, part = "air", -0.02


@dataclass(frozen=True)
class Touch(Term[Any]):
    """That all tools press, however little: F/(F + 0.3 N) of the weaker one."""

    weight: float | Ramp = 0.3

    def potential(self, standing: Any) -> Any:
        return standing.force / (standing.force + 0.3)


@dataclass(frozen=True)
class StressConcentration(Share):
    """That the largest stress grows no further, in parts of 3 kPa. Its growths add up to the peak of an episode."""

    weight: float | Ramp = Ramp(30e3, 150e3, 1.0)
    number, part = "stress", -3e3


@dataclass(frozen=True)
class Deformation(Share):
    """That the body is squeezed no further, in parts of 10 %."""

    weight: float | Ramp = 0.1
    number, part = "compression", -0.1


@dataclass(frozen=True)
class GraspStability(Share):
    """That nothing slips, in parts of 5 mm."""

    weight: float | Ramp = 0.1
    number, part = "slip", -5e-3


@dataclass(frozen=True)
class Energy(Share):
    """That little energy is stored in the body, in mJ."""

    weight: float | Ramp = 0.01
    number, part = "energy", -1e-3


@dataclass(frozen=True)
class Nearness(Share):
    """That the body comes closer to its target, in parts of 50 mm."""

    weight: float | Ramp = 2.0
    number, part = "distance", -0.05


@dataclass(frozen=True)
class Heading(Share):
    """That the target lies straight ahead, in parts of 10 mm: far away, what is aside hardly changes its distance."""

    weight: float | Ramp = 0.5
    number, part = "aside", -0.01


@dataclass(frozen=True)
class Corners(Share):
    """That the corners that are held come closer to where they belong, in parts of the cloth's edge."""

    weight: float | Ramp = 2.0
    number, part = "corners", -1.0


@dataclass(frozen=True)
class FoldedArea(Share):
    """That the free half lies on the other one, in parts of it."""

    weight: float | Ramp = 1.0
    number, part = "area", 1.0


@dataclass(frozen=True)
class Stretch(Share):
    """That nothing is stretched further, in parts of 10 %."""

    weight: float | Ramp = 0.05
    number, part = "stretch", -0.1


GENTLE: tuple[Term[Grip], ...] = (Lift(), Way(), Touch(), StressConcentration())
"""first lift, then gently (docs/decisions/40)"""
GENTLE_PUSH: tuple[Term[Push], ...] = (Nearness(), Heading(), Way(), Touch(), StressConcentration())
"""first push, then gently"""
FOLD: tuple[Term[Fold], ...] = (Corners(), FoldedArea(), Stretch())


def fitting(terms: Sequence[Term[Standing]], kind: type[Standing]) -> tuple[Term[Standing], ...]:
    """Terms of a task whose body stands so, a dataclass of numbers. Raises BadInput for one that looks elsewhere."""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    still = kind(*(0.0 for _ in names))
    for term in terms:
        try:
            term.potential(still)
        except AttributeError as error:
            raise BadInput(
                f"reward: {type(term).__name__} looks at {error.name!r}, and this task has {', '.join(names)}: leave "
                "it out, or take another term of softseam.gym.reward"
            ) from None
    return tuple(terms)
