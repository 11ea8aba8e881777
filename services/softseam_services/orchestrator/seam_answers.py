"""What a step of the seam asks the sides for, and what comes of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages import Advanced

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SideRequest:
    """What one side is asked for in one exchange."""

    force: Floats
    compliance: bool = False
    anchor: Floats | None = None
    stiffness: Floats | None = None


Ask = Callable[[dict[str, SideRequest]], dict[str, Advanced]]


@dataclass(frozen=True, slots=True)
class SeamSolution:
    """The step that both sides agreed on."""

    replies: dict[str, Advanced]
    lambda_: Floats
    """force on the near side (s, 3) [N]"""
    gap: float
    """[m]"""
    exchanges: int
    note: str
    """'' or what fell short"""
    parts: int = 1
    """that the step was taken in"""


class SeamDiverged(RuntimeError):
    """The sides' answers are not finite."""


class SeamUnsettled(RuntimeError):
    """The step would not converge; shorter ones may."""


def largest(vectors: Floats) -> float:
    """Greatest length of vectors (s, 3), 0 for none; NaN where one is."""
    return math.sqrt(np.einsum("si,si->s", vectors, vectors).max()) if len(vectors) else 0.0
