"""A body that creeps along tools that stand still, which friction would hold, or let go of for good.

By Coulomb's law a body that slides under its weight gains or loses speed, but for a plane that is tilted by just the
angle of friction. One that keeps the same low speed, whole and without rolling, is held by a friction that gives way.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advanced
from softseam_services.body.bounding_points import bounding_points
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.whereabouts import box_of
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

_TIME, _LOOKS = 0.6, 6
"""for which, and looks at which it was so at least, a body moves steadily [s]"""
_STEADY = 0.25
"""by which ways between two looks differ from their mean, and those of its lower ends from those of its upper [1]"""
TREND = 0.05
"""by which the later half of its way differs from the earlier: by more, it gains or loses speed [1]"""
_WAY = 1e-3
"""of the body's extent: less in all is no way"""
_ROLLS = 0.25
"""of mass, speed and half the extent: a ball that rolls has a spin of 0.4 of it, a cylinder of 0.5"""
_SLOW = 0.2
"""of the speed that friction would take or give in that time"""


@dataclass(frozen=True, slots=True)
class _Seen:
    """The body at a look."""

    bounds: Floats
    """(2, 3) [m]"""
    momentum: Floats
    """(3,) [kg m/s]"""
    angular: Floats
    """angular momentum about the world's origin (3,) [kg m^2/s]"""
    touches: bool

    @property
    def spin(self) -> Floats:
        """Angular momentum about its middle (3,) [kg m^2/s]."""
        return np.asarray(self.angular - np.cross(self.bounds.mean(axis=0), self.momentum))


class Creep:
    """Watches one body; tells once that it creeps.

    dt    time between two looks [s]
    tell  receives the event
    """

    def __init__(self, body: AnyBody, tools: ToolSet, dt: float, tell: Tell) -> None:
        self._tell, self._dt = tell, dt
        self._size = float(np.ptp(bounding_points(body), axis=0).max())
        self._mass = float(body.total_mass)
        n_looks = max(_LOOKS, math.ceil(_TIME / dt)) + 1
        friction = float(tools.friction.min(initial=np.inf))
        self._most = _SLOW * friction * float(np.linalg.norm(body.gravity)) * (n_looks - 1) * dt
        self._may = 0.0 < self._most < math.inf and not body.fixed.any()
        self._seen: deque[_Seen] = deque(maxlen=n_looks)
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._seen.clear()
        self._poses: tuple[Floats, Floats] | None = None
        self._told = False

    def look(self, step: int, replies: Mapping[str, Advanced], position: Floats, orientation: Floats) -> None:
        """A step was taken, at whose end the tools have these poses (t, 3) [m], (t, 4)."""
        if self._told or not self._may:
            return
        before, self._poses = self._poses, (position, orientation)
        if before is None or not all((then == now).all() for then, now in zip(before, self._poses, strict=True)):
            self._seen.clear()
            return
        self._seen.append(self._see(replies))
        self._judge(step)

    @property
    def n_looks(self) -> int:
        """In a row, that it takes to know."""
        return self._seen.maxlen or 0

    @property
    def least_way(self) -> float:
        """That it goes at least in that time [m]."""
        return _WAY * self._size

    @property
    def longest_way(self) -> float:
        """That it goes in that time at most: what goes faster does not creep [m]."""
        return self._most * self._dt * (self.n_looks - 1)

    def look_back(self, step: int, looks: Iterable[tuple[Floats, Floats, Floats, bool]]) -> None:
        """As many looks as it takes, at tools that stood still: bounds (2, 3) [m], momentum (3,) [kg m/s], angular
        momentum (3,) [kg m^2/s], and whether the body touched anything."""
        if not self._told and self._may:
            self._seen.clear()
            self._seen.extend(_Seen(*one) for one in looks)
            self._judge(step)

    def _judge(self, step: int) -> None:
        """Tell where all looks say so."""
        if len(self._seen) == self._seen.maxlen and (speed := self._speed()):
            self._told = True
            self._tell(
                "creep",
                f"step {step}: the body creeps at {1e3 * speed:.3g} mm/s along tools that stand still, where friction "
                "would hold it or let it go for good: give it to fem by regions.default, or clamp it with `fixed`",
            )

    def _see(self, replies: Mapping[str, Advanced]) -> _Seen:
        told = list(replies.values())
        return _Seen(
            box_of(told),
            sum((reply.momentum for reply in told), np.zeros(3)),
            sum((reply.angular_momentum for reply in told), np.zeros(3)),
            any(reply.figure(Figure.CONTACTS) for reply in told),
        )

    def _speed(self) -> float:
        """Speed at which it creeps [m/s]; 0 where it does not."""
        seen = self._seen
        if np.abs(seen[-1].bounds - seen[0].bounds).max() < 0.5 * _WAY * self._size:
            return 0.0  # nearly always
        ways = np.diff([each.bounds for each in seen], axis=0)  # (n, 2, 3)
        mean = ways.mean(axis=(0, 1))
        way = float(np.linalg.norm(mean))
        speed = way / self._dt
        if not (way * len(ways) > _WAY * self._size and speed < self._most):
            return 0.0
        steady = bool((np.linalg.norm(ways - mean, axis=2) < _STEADY * way).all())
        half = len(ways) // 2
        trend = float(np.linalg.norm(ways[-half:].mean(axis=(0, 1)) - ways[:half].mean(axis=(0, 1))))
        spin = float(np.linalg.norm(np.mean([each.spin for each in seen], axis=0)))
        touches = 2 * sum(each.touches for each in seen) >= len(seen)
        rolls = spin > _ROLLS * self._mass * speed * 0.5 * self._size
        return speed if steady and trend < TREND * way and touches and not rolls else 0.0
