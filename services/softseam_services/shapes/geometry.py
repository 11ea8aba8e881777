"""What is known of one shape beside its signed distance: how far it reaches, where its surface is, what it looks like.

All is in the shape's own frame, about the tool's position.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from softseam_protocol.messages.recording import ToolSurface
from softseam_services.body.body import Floats, Ints
from softseam_services.body.surface_points import refine

FINENESS = 16
"""points of an outline along the longest edge of a surface's bounding box"""
ROUNDEST = 0.45
"""of a solid's walls: the largest radius that its edges are rounded by"""
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Sameness:
    """Which turns and reflections leave a shape as it is: those that keep `pole`, and mix only axes of the same length.

    A box keeps each of its axes, a cylinder along z may turn about it, a cone keeps the way it points, too.
    """

    lengths: tuple[float, float, float] = (1.0, 2.0, 3.0)
    """of the three axes; only which are the same counts"""
    pole: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """a direction that has two ends unlike each other; zeros for none"""

    @property
    def row(self) -> Floats:
        """As kernels take it (6,)."""
        return np.array([*self.lengths, *self.pole])


@dataclass(frozen=True)
class Geometry:
    """One shape as its specification has it."""

    numbers: Floats
    """what the kernel of its distance takes (w,)"""
    outline: Floats
    """points of the surface, and the middle, as many as show whether it pokes into a body; none of a half-space
    (n, 3) [m]"""
    reach: float
    """radius of a ball about the position that holds all of it; infinite for a half-space [m]"""
    orientation: Floats = field(default_factory=UPRIGHT.copy)
    """unit quaternion w, x, y, z at time 0 (4,)"""
    placed_by: Floats = field(default_factory=lambda: np.zeros(3))
    """point that the specification's position is of (3,) [m]"""
    extent: Callable[[Floats], float] | None = None
    """how far it reaches along a unit direction (3,) [m]; None: as far as the outline"""
    surface: ToolSurface | None = None
    """triangles for recordings and viewers; None only of kinds that viewers draw by themselves"""
    sameness: Sameness | None = None
    """None: not known, so that the tool has no image in a plane of symmetry"""
    core: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    """balls in the shape, centre and radius (b, 4) [m]: a step that takes one farther than its radius is reported, for
    what was before the tool comes out behind it; none: not looked at"""
    slack: float = 0.0
    """depth at which the distance does not distinguish touching from overlapping [m]"""
    rounded: Callable[[float], Floats] | None = None
    """numbers of the same shape, with edges of a radius of at most ROUNDEST of its walls [m]; None: it has no sharp
    edges, or keeps them"""
    wall: float = np.inf
    """how thick its walls are in the mean: twice its volume over its surface [m]"""
    bends: float = 1.0
    """share of its surface that is curved [1]"""
    notes: tuple[str, ...] = ()
    """what was repaired of the file that it is from, for `softseam check`"""

    @classmethod
    def of_surface(cls, numbers: Floats, vertices: Floats, triangles: Ints, **others: Any) -> Geometry:
        """With the outline of a closed surface, and a reach that holds its bounding box; `others` are fields.

        vertices (n, 3) [m]; triangles counter-clockwise from outside (T, 3)
        """
        triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        size = float(np.ptp(vertices, axis=0).max())
        found: dict[str, Any] = {
            "outline": refine(vertices, triangles, size / FINENESS)[0],
            "reach": float(np.linalg.norm(np.abs(vertices).max(axis=0))),
            "surface": ToolSurface(vertices, triangles),
        }
        return cls(numbers=numbers, **{**found, **others})

    @cached_property
    def half_width(self) -> float:
        """Half of the middle one of its extents along its own axes, a rod's radius; infinite for a half-space [m]"""
        if not np.isfinite(self.reach):
            return np.inf
        ways = [self.reach_along(axis) for axis in (*np.eye(3), *-np.eye(3))]
        return float(np.sort(np.reshape(ways, (2, 3)).sum(axis=0))[1] / 2.0)

    def reach_along(self, direction: Floats) -> float:
        """How far it reaches along a unit direction (3,) [m]; 0 for a half-space."""
        if self.extent is not None:
            return self.extent(direction)
        return float((self.outline @ direction).max(initial=0.0))


_AROUND = 16


def around(radius: float, half: float, end: float) -> Floats:
    """Rings around the side, from -half to half along z, the two ends, and the middle (n, 3) [m]."""
    turn = 2.0 * np.pi / _AROUND * np.arange(_AROUND)
    ring = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    levels = [ring + z * up for z in half * np.linspace(-1.0, 1.0, 5)]
    return np.concatenate([*levels, end * up[None], -end * up[None], 0.0 * up[None]])


def ends(radius: float, half: float) -> Floats:
    """Balls about both ends of the axis (2, 4) [m]."""
    return np.array([[0.0, 0.0, -half, radius], [0.0, 0.0, half, radius]])
