"""What a step of the seam asks the sides for, and what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.quasi_newton import largest_node
from softseam_coupling.loops.one_way import Correct
from softseam_protocol.messages.participant import Advanced, Capabilities
from softseam_services.orchestrator.pace import Pace

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SideRequest:
    """What one side is asked for in one exchange."""

    force: Floats
    compliance: bool = False
    anchor: Floats | None = None
    stiffness: Floats | None = None
    start: Floats | None = None
    """force at the step's start, where it is linear in time"""
    fields: bool = True
    """whether its fields could be those of the step: not where it is to be corrected"""
    repeat: bool = False
    """tell again how it yields by the factor at hand"""


Ask = Callable[[dict[str, SideRequest]], dict[str, Advanced]]


@dataclass(frozen=True, slots=True)
class SeamSolution:
    """A step as it is to be committed."""

    replies: dict[str, Advanced]
    """as corrected, where it was"""
    lambda_: Floats
    """force on the near side (s, 3) [N]"""
    gap: float
    """between the sides [m]"""
    exchanges: int
    note: str
    """'' or what fell short"""
    parts: int = 1
    """that the step was taken in"""


class SeamDiverged(RuntimeError):
    """The sides' answers are not finite."""


class SeamUnsettled(RuntimeError):
    """The step would not converge in so many exchanges; shorter ones may."""

    def __init__(self, exchanges: int):
        super().__init__(f"not within {exchanges} exchanges")
        self.exchanges = exchanges


class SeamScheme(Protocol):
    """How two sides are tied for one epoch: `OneWaySeam` (the default), `AccelerationLoop`, `RampedSeam` and
    `StaggeredSeam`."""

    pace: Pace
    """how finely the steps are cut"""

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """The sides are configured, and can do so much."""

    def multiplier(self) -> Floats:
        """The last committed one (s, 3) [N]."""

    def solve(self, ask: Ask, correct: Correct, dt: float, may_cut: bool = False) -> SeamSolution:
        """Take a step of length dt [s]. Raises SeamDiverged, and where the step may be cut also SeamUnsettled."""

    def forget_told(self) -> None:
        """The sides were restored or took a snapshot."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""

    def take(self, arrays: dict[str, Floats]) -> None:
        """Continue from `to_arrays`."""


def largest(vectors: Floats) -> float:
    """Greatest length of vectors (s, 3), 0 for none; NaN where one is."""
    return float(largest_node(vectors.reshape(-1))) if len(vectors) else 0.0
