"""A loop of parts that report no compliance: the step is redone under multipliers that an acceleration finds."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.accelerations.memory import Acceleration
from analysis.loops.fixed_point import FixedPoint
from softseam_coupling.loops.coupled_part import gap_of, parts_of
from softseam_coupling.loops.loop import (
    NOT_CONVERGED,
    Ask,
    Correct,
    LoopSetup,
    Outcome,
    PartRequest,
    StepDiverged,
    StepRefused,
    largest,
)
from softseam_protocol.messages.participant import Capabilities

Floats = NDArray[np.float64]


class Accelerated:
    """A `Loop` of any parts and interfaces."""

    def __init__(self, setup: LoopSetup, acceleration: Acceleration) -> None:
        self._setup = setup
        self._parts, self._offset = parts_of(setup.interfaces, {name: len(m) for name, m in setup.mobility.items()})
        self._found = FixedPoint(self._parts, setup.mobility, setup.first, acceleration)

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """Nothing is asked for but steps."""

    def multipliers(self) -> Floats:
        """The last committed ones (c, 3) [N]."""
        return self._found.last

    def solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool = False) -> Outcome:
        """Redo the step until the gap is within the tolerance."""
        most = self._setup.exchanges
        multipliers = self._found.begin(dt)
        for exchange in range(1, most + 1):
            replies = ask({name: PartRequest(part.force(multipliers)) for name, part in self._parts.items()})
            left = gap_of(self._parts, {name: reply.coupling.x for name, reply in replies.items()}, self._offset)
            gap = largest(left)
            if not math.isfinite(gap):
                raise StepDiverged("a part's answer is not finite")
            proposed = self._found.next(multipliers, left)
            if gap <= self._setup.tolerance:
                self._found.commit(multipliers)
                return Outcome(replies, multipliers, gap, exchange)
            if exchange < most:
                multipliers = proposed
        if may_refuse:
            raise StepRefused(most)
        self._found.commit(multipliers)
        return Outcome(replies, multipliers, gap, most, NOT_CONVERGED)

    def forget_sent(self) -> None:
        """Nothing that the parts keep is counted on."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        return self._found.to_arrays()

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._found.take(arrays)
