"""What an agent that lifts a piece sees: numbers of order 1, as a robot could measure them; of one piece or of many."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

CLOSING = 0.02
"""way of a pad that counts as 1 [m]"""
FORCE = 0.3
"""from which on a force is seen by its logarithm [N]"""
SLIPPED = 5e-3
"""slip of the marker that counts as 1 [m]"""
BOUND = 10.0
"""largest number seen"""

SEEN = (
    "closed",
    "risen",
    "force of the left pad",
    "force of the right pad",
    "pull",
    "pull over force",
    "height of the marker",
    "its speed upwards",
    "its way sideways",
    "slip of the marker",
    "left pad in contact",
    "right pad in contact",
    "change of force",
    "last closing",
    "last rising",
    "time",
)
"""what an agent sees, in this order, all of order 1"""


class Sight(NamedTuple):
    """Of one piece, numbers; of k pieces, arrays (k,)."""

    closed: Any
    """way of each pad since the start [m]"""
    risen: Any
    """[m]"""
    left: Any
    """force with which the left pad presses [N]"""
    right: Any
    pull: Any
    """of the body on both pads, downwards [N]"""
    height: Any
    """of the marker on the body's top, above where it was [m]"""
    sideways: Any
    """way of the marker along the grip [m]"""
    touching_left: Any
    """part of the left pad's points that touch"""
    touching_right: Any
    closing: Any
    """last action"""
    rising: Any
    time: Any
    """part of an episode's steps that are over"""

    @property
    def weaker(self) -> Any:
        """Force of the weaker pad [N]."""
        return np.minimum(self.left, self.right)

    def numbers(self, before: Sight | None, act: float, speed: float, height: float) -> NDArray[np.float32]:
        """`SEEN` (16,) or (k, 16).

        before  what was seen before the last action; None at the start
        act     time between two actions [s]; speed of a tool at an action of 1 [m/s]; height to lift by [m]
        """
        past = self if before is None else before
        seen = [
            self.closed / CLOSING,
            self.risen / height,
            logarithm(self.left),
            logarithm(self.right),
            logarithm(self.pull),
            self.pull / (self.left + self.right + FORCE),
            self.height / height,
            (self.height - past.height) / act / speed,
            self.sideways / SLIPPED,
            (self.risen - self.height) / SLIPPED,
            self.touching_left,
            self.touching_right,
            logarithm(self.weaker) - logarithm(past.weaker),
            self.closing,
            self.rising,
            self.time,
        ]
        return np.asarray(np.clip(np.stack(seen, axis=-1), -BOUND, BOUND), np.float32)


def logarithm(force: Any) -> Any:
    """Of a force [N], with its sign: linear below 0.3 N."""
    return np.sign(force) * np.log1p(np.abs(force) / FORCE)
