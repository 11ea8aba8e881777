"""Bodies that creep along tools that stand still, which friction would hold, or let go of for good.

By Coulomb's law a body that slides under its weight gains or loses speed, but for a plane that is tilted by just the
angle of friction. One that keeps the same low speed, whole and without rolling, is held by a friction that gives way.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import bounding_points
from softseam_services.orchestrator.whereabouts import Say, Seen
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

_TIME, _LOOKS = 0.6, 6
"""for which, and looks at which it was so at least, a body moves steadily [s]"""
_STEADY = 0.25
"""by which ways between two looks differ from their mean, and those of its lower ends from those of its upper [1]"""
_TREND = 0.05
"""by which the later half of its way differs from the earlier: by more, it gains or loses speed [1]"""
_WAY = 1e-3
"""of the body's extent: less in all is no way"""
_ROLLS = 0.25
"""of mass, speed and half the extent: a ball that rolls has a spin of 0.4 of it, a cylinder of 0.5"""
_SLOW = 0.2
"""of the speed that friction would take or give in that time"""


class Creep:
    """Watches b bodies; tells of each once that it creeps.

    dt  time between two looks [s]
    """

    def __init__(self, bodies: Sequence[AnyBody], tools: ToolSet, dt: float, say: Say) -> None:
        self._say, self._dt = say, dt
        self._size = np.array([np.ptp(bounding_points(body), axis=0).max() for body in bodies])
        self._mass = np.array([body.total_mass for body in bodies])
        n_looks = max(_LOOKS, math.ceil(_TIME / dt)) + 1
        friction = float(tools.friction.min(initial=np.inf))
        weight = np.array([np.linalg.norm(body.gravity) for body in bodies])
        with np.errstate(invalid="ignore"):
            self._most = _SLOW * friction * weight * (n_looks - 1) * dt
        clamped = np.array([body.fixed.any() for body in bodies])
        self._may = (self._most > 0.0) & np.isfinite(self._most) & ~clamped
        self._seen: deque[Seen] = deque(maxlen=n_looks)
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._seen.clear()
        self._poses: tuple[Floats, Floats] | None = None
        self._told = np.zeros(len(self._size), dtype=np.bool_)

    def look(self, step: int, seen: Seen, position: Floats, orientation: Floats) -> None:
        """A step was taken, at whose end the tools have these poses (t, 3) [m], (t, 4)."""
        if not (self._may & ~self._told).any():
            return
        before, self._poses = self._poses, (position, orientation)
        if before is None or not all((then == now).all() for then, now in zip(before, self._poses, strict=True)):
            self._seen.clear()
            return
        self._seen.append(seen)
        if len(self._seen) < (self._seen.maxlen or 0):
            return
        moved = np.abs(self._seen[-1].bounds - self._seen[0].bounds).max(axis=(1, 2)) >= 0.5 * _WAY * self._size
        if not (moved & self._may & ~self._told).any():
            return  # nearly always
        speed = self._speed()
        creeps = (speed > 0.0) & self._may & ~self._told
        self._told |= creeps
        for place in np.flatnonzero(creeps).tolist():
            self._say(
                place,
                "creep",
                f"step {step}: the body creeps at {1e3 * speed[place]:.3g} mm/s along tools that stand still, where "
                "friction would hold it or let it go for good: give it to fem by regions.default, or clamp it with "
                "`fixed`",
            )

    def _speed(self) -> Floats:
        """Speed at which each creeps (b,) [m/s]; 0 where it does not."""
        bounds, momentum, angular, touches = (np.array(each) for each in zip(*self._seen, strict=True))
        ways = np.diff(bounds, axis=0)  # (n, b, 2, 3)
        n, mean = len(ways), ways.mean(axis=(0, 2))
        way = np.linalg.norm(mean, axis=1)
        speed, half = way / self._dt, n // 2
        goes = (way * n > _WAY * self._size) & (speed < self._most)
        steady = (np.linalg.norm(ways - mean[:, None], axis=3) < _STEADY * way[:, None]).all(axis=(0, 2))
        trend = np.linalg.norm(ways[-half:].mean(axis=(0, 2)) - ways[:half].mean(axis=(0, 2)), axis=1)
        spin = np.linalg.norm((angular - np.cross(bounds.mean(axis=2), momentum)).mean(axis=0), axis=1)
        rolls = spin > _ROLLS * self._mass * speed * 0.5 * self._size
        held = 2 * touches.sum(axis=0) >= len(touches)
        return np.where(goes & steady & (trend < _TREND * way) & held & ~rolls, speed, 0.0)
