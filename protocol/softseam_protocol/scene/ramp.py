"""How far something has gone after a time that speeds up and slows down smoothly, within a speed and an acceleration.

The speed rises as half a wave of a cosine, whose steepest is the acceleration a, and falls alike:
  v(t) = v/2 (1 - cos(pi t/t_r)),   t_r = pi v/(2 a),                                                             (1)
so both ends take v t_r of the way. Where that is longer than all of it, the highest speed is what it allows.
"""

import math
from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Ramp:
    """A way [m], or an angle [rad], with its limits."""

    length: float
    speed: float
    """[m/s]"""
    acceleration: float | None
    """[m/s^2]; None: the speed is even"""

    @cached_property
    def _highest(self) -> float:
        """Speed [m/s]."""
        if self.acceleration is None:
            return self.speed
        return min(self.speed, math.sqrt(2.0 * self.acceleration * self.length / math.pi))

    @cached_property
    def _rise(self) -> float:
        """t_r of eq. (1) [s]."""
        return 0.0 if self.acceleration is None else 0.5 * math.pi * self._highest / self.acceleration

    @property
    def time(self) -> float:
        """For all of it [s]."""
        return self.length / self._highest + self._rise

    def gone(self, time: float) -> float:
        """How far after a time [m]."""
        if time >= self.time:
            return self.length
        if time > 0.5 * self.time:
            return self.length - self.gone(self.time - time)
        if time >= self._rise:
            return self._highest * (time - 0.5 * self._rise)
        return 0.5 * self._highest * (time - self._rise / math.pi * math.sin(math.pi * time / self._rise))  # eq. (1)
