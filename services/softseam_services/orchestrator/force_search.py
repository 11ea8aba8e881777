"""The end of a closing phase by a force, which is known after a step only, and by then may be past what is wanted.

Tools that touch close no farther than the line through the last two forces says. Once there, or past it, they stand for
a step, for a force is a mean over the step and lags where they move, and go to where the line has what is wanted
(secant method); and so on, until it is near enough.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace

NEAR_ENOUGH = 0.02
"""of the force that was asked for: the phase ends within it [1]"""
MOST = 10
"""times that the tools go elsewhere, after which the phase ends as it is: points that stick or slip let a force jump"""
_STEEPER = 3.0
"""a slope that changes by more than this factor was measured where something else happened"""
_ROUNDING = 1e-12
"""[m]"""


@dataclass(frozen=True, slots=True)
class ForceSearch:
    """What is known of the force between two tools as they close."""

    gap: float = 0.0
    """between them [m]"""
    force: float = 0.0
    """there [N]"""
    slope: float = 0.0
    """what the force grows by as the gap shrinks [N/m]"""
    goal: float = 0.0
    """gap to go to, once the force was passed [m]"""
    passed: bool = False
    stands: bool = False
    """whether the tools stand in the coming step, so that the force after it is that of the gap"""
    tries: int = 0
    """how often they were sent elsewhere"""

    def to(self, wanted: float) -> float:
        """The gap that the tools may go to in the coming step [m]; minus infinity where no force is known."""
        if self.passed:
            return self.goal
        known = self.slope > 0.0 and self.force > NEAR_ENOUGH * wanted
        return self.gap - (wanted - self.force) / self.slope if known else -math.inf

    def after(self, gap: float, force: float, wanted: float) -> ForceSearch:
        """With what a step came to."""
        if not self.passed:
            slope = (force - self.force) / max(self.gap - gap, _ROUNDING)
            if force < (1.0 - NEAR_ENOUGH) * wanted:
                return ForceSearch(gap, force, slope)
            return ForceSearch(gap, force, slope, goal=gap, passed=True, stands=True)
        if not self.stands:
            return replace(self, stands=abs(gap - self.goal) <= _ROUNDING)
        if force < NEAR_ENOUGH * wanted:  # they let go of the body, which says nothing of the slope: half of the way
            return replace(self, goal=0.5 * (gap + self.gap), stands=False, tries=self.tries + 1)
        slope = self.slope
        if self.tries and abs(gap - self.gap) > _ROUNDING:
            found = (force - self.force) / (self.gap - gap)
            slope = min(max(found, slope / _STEEPER), slope * _STEEPER)
        goal = gap + (force - wanted) / slope
        return ForceSearch(gap, force, slope, goal, passed=True, tries=self.tries + 1)

    def ended(self, force: float, wanted: float) -> bool:
        """Whether the force after a step is near enough to what is wanted, or was looked for long enough."""
        return self.stands and (is_near(force, wanted) or self.tries >= MOST)

    def to_list(self) -> list[float]:
        """For a snapshot."""
        return [float(value) for value in astuple(self)]

    @classmethod
    def from_list(cls, values: list[float]) -> ForceSearch:
        """From `to_list`; without values nothing was looked for."""
        gap, force, slope, goal, passed, stands, tries = values or cls().to_list()
        return cls(gap, force, slope, goal, bool(passed), bool(stands), int(tries))


def is_near(force: float, wanted: float) -> bool:
    """Whether a force is near enough to what is wanted [N]."""
    return abs(force - wanted) <= NEAR_ENOUGH * wanted
