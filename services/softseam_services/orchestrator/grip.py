"""Tools that close on a body: along which ways, and how much narrower the body is between them than when all touched.

Each of n tools closes along its own unit vector d_i; e_i = d_i - mean(d). Their *spread* at positions x_i is
  s = -2 mean(e_i . x_i),                                                                                         (1)
of two tools the distance of their positions along the line between them, of more the mean diameter. It is the same
wherever they are moved together, and falls by 2 (1 - |mean(d)|^2) c where each closes by c.

They touch the body at the spread at which each meets its surface at rest on its way; between them the body is as wide
as the places p_i where they do are spread. So compression is
  (s_touch - s)/width,  width = -2 mean(e_i . p_i),                                                              (2)
which knows no cells and no contact: plates wider than a block have 1 - gap/width, a waist counts as a waist, and
what a tool of any kind or pose does before it reaches the body does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import ALIKE
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import bounding_points, rest_points
from softseam_services.shapes.branches import PLANE
from softseam_services.tools.approach import way_to_touch
from softseam_services.tools.kernels import rotate, rotate_back
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Placement:
    """The rigid motion from a body's place at rest that is nearest to how it is now: x = turn x_rest + shift."""

    turn: Floats = field(default_factory=lambda: np.eye(3))
    """(3, 3)"""
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    """[m]"""

    @classmethod
    def fitted(cls, rest: Floats, now: Floats) -> Placement:
        """Of points (n, 3) [m], by least squares (Kabsch, Acta Cryst. A 32 (1976) 922)."""
        middle, here = rest.mean(axis=0), now.mean(axis=0)
        u, _, vt = np.linalg.svd((rest - middle).T @ (now - here))
        mirrored = np.sign(np.linalg.det(vt.T @ u.T))
        turn = vt.T @ np.diag([1.0, 1.0, mirrored]) @ u.T
        return cls(turn, here - turn @ middle)

    def of(self, points: Floats) -> Floats:
        """Points at rest (..., 3) [m] as they are now."""
        return np.asarray(points @ self.turn.T + self.shift)


AT_REST = Placement()


@dataclass(frozen=True, slots=True)
class Grip:
    """n tools that close on a body, as they begin to."""

    tools: tuple[int, ...]
    inward: Floats
    """unit vectors d_i along which they close (n, 3)"""
    upright: list[float]
    """the first tool's orientation then, with which these turn"""
    begun: Floats
    """where they were then (n, 3) [m]"""
    touch: float
    """spread at which all touch the body, minus infinity where one passes it [m]"""
    width: float
    """of the body between them, eq. (2); where one passes it, of all of the body [m]"""
    thickness: float
    """spread at which nothing is left between them [m]"""
    body: AnyBody
    felt: bool = False
    """whether all have felt the body since"""
    uneven: Floats = field(init=False)
    """e_i of eq. (1) (n, 3)"""
    index: NDArray[np.int64] = field(init=False)
    """`tools`, by which arrays are read (n,)"""
    rate: float = field(init=False)
    """how fast the spread falls where each closes at a speed of 1 [1]"""

    def __post_init__(self) -> None:
        middle = self.inward.mean(axis=0)
        object.__setattr__(self, "uneven", self.inward - middle)
        object.__setattr__(self, "rate", 2.0 * (1.0 - float((middle**2).sum())))
        object.__setattr__(self, "index", np.array(self.tools, dtype=np.int64))

    @classmethod
    def build(
        cls,
        tools: ToolSet,
        which: Sequence[int],
        body: AnyBody,
        placement: Placement,
        position: Floats,
        orientation: Floats,
        about: Sequence[float] | None = None,
    ) -> Grip:
        """Of tools with poses (t, 3) [m], (t, 4) that close on a body that stands there, about their middle or a point
        (3,) [m]."""
        index = list(which)
        inward = _inward(tools, index, position, orientation, about)
        uneven = inward - inward.mean(axis=0)
        points = placement.of(bounding_points(body))
        corners, radius = placement.of(_corners(body)), body.radius
        reaches = [extent_along(tools, i, d, orientation[i]) for i, d in zip(index, inward, strict=True)]
        found = [
            way_to_touch(tools, i, position[i], orientation[i], d, corners) for i, d in zip(index, inward, strict=True)
        ]
        met = [each for each in found if each is not None]
        touch, width = -np.inf, 2.0 * float((points @ -uneven.T).max(axis=0).mean())
        if len(met) == len(found):
            ways = np.array([way for way, _ in met]) - radius
            touch = _spread(uneven, position[index] + ways[:, None] * inward)
            width = _spread(uneven, np.array([place for _, place in met]))
        thickness = 2.0 * float(np.mean(reaches))
        return cls(tuple(which), inward, orientation[index[0]].tolist(), position[index], touch, width, thickness, body)

    def inward_now(self, orientation: Floats) -> Floats:
        """The ways (n, 3), which turn with the first tool, at orientations (t, 4)."""
        turn = orientation[self.tools[0]]
        if turn.tolist() == self.upright:
            return self.inward
        own = [rotate_back(np.array(self.upright), *way) for way in self.inward]
        return np.array([rotate(turn, *way) for way in own])

    def force(self, wrench: Floats, orientation: Floats) -> float:
        """Mean force of the body on the tools against their ways [N], of wrenches (t, 6) and orientations (t, 4)."""
        along = float(np.vdot(self.inward_now(orientation), wrench[:, :3].take(self.index, axis=0)))
        return 0.0 - along / len(self.tools)  # of nothing it is 0, not -0

    def compression(self, position: Floats, orientation: Floats) -> float:
        """Eq. (2) at tool poses (t, 3) [m], (t, 4): at most 0 before all touch; 0 of a sheet, which has no width."""
        if not (np.isfinite(self.touch) and self.width > 0.0):
            return 0.0
        return (self.touch - self.spread(position, orientation)) / self.width

    def spread(self, position: Floats, orientation: Floats) -> float:
        """Eq. (1) at tool poses (t, 3) [m], (t, 4)."""
        inward = self.inward_now(orientation)
        uneven = self.uneven if inward is self.inward else inward - inward.mean(axis=0)
        return _spread(uneven, position.take(self.index, axis=0))

    def aside(self, position: Floats) -> bool:
        """Whether tools at (t, 3) [m] were moved otherwise than along their ways since they began to close."""
        way = position[self.index] - self.begun
        across = way - (way * self.inward).sum(axis=1, keepdims=True) * self.inward
        return float(np.abs(across).max()) > ALIKE * self.width

    @property
    def spread_begun(self) -> float:
        """Eq. (1) as they began to close."""
        return _spread(self.uneven, self.begun)

    def gap(self, position: Floats, orientation: Floats) -> float:
        """Clear way between them at tool poses (t, 3) [m], (t, 4)."""
        return self.spread(position, orientation) - self.thickness


def _inward(
    tools: ToolSet, which: Sequence[int], position: Floats, orientation: Floats, about: Sequence[float] | None
) -> Floats:
    """Unit vectors (n, 3): of planes their normals, of one that closes on a plane the opposite, of others those to the
    point or their middle."""
    planes = tools.kind[which] == PLANE
    normals = np.array([rotate(orientation[i], *tools.shape[i, :3]) for i in which])
    if about is None and len(which) == 2 and planes.any():
        return np.where(planes[:, None], normals, -normals[::-1])
    middle = position[which][~planes].mean(axis=0) if about is None else np.array(about)
    ways = middle - position[which]
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    return np.where(planes[:, None], normals, ways / np.where(length > 0.0, length, 1.0))


def _corners(body: AnyBody) -> Floats:
    """Of the triangles of its surface at rest (m, 3, 3) [m]; each particle of one of particles, three times."""
    if body.has_cells:
        return np.asarray(rest_points(body)[body.surface.triangles])
    return np.repeat(body.x_rest[:, None], 3, axis=1)


def _spread(uneven: Floats, points: Floats) -> float:
    """Eq. (1)."""
    return -2.0 * float(np.vdot(uneven, points)) / len(points)


def nearest_body(bodies: Sequence[AnyBody], placements: Sequence[Placement], point: Floats) -> int:
    """The body whose box is nearest to a point (3,) [m]; of those around it, that with the nearest middle."""

    def far(number: int) -> tuple[float, float]:
        points = placements[number].of(bounding_points(bodies[number]))
        low, high = points.min(axis=0), points.max(axis=0)
        outside = np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high)))
        return float(outside), float(np.linalg.norm(0.5 * (low + high) - point))

    return min(range(len(bodies)), key=far) if len(bodies) > 1 else 0


def extent_along(tools: ToolSet, tool: int, direction: Floats, orientation: Floats) -> float:
    """How far a tool reaches from its position along a unit direction [m]; 0 for a plane.

    orientation (4,)  of the tool
    """
    return tools.geometry[tool].reach_along(np.array(rotate_back(orientation, *direction)))
