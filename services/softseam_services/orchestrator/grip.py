"""Two tools that close on the body: their axis, and how far they are apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase
from softseam_protocol.scene.scene import Scene
from softseam_services.body.bounding_points import bounding_points
from softseam_services.body.build import AnyBody
from softseam_services.tools.extent import extent_along
from softseam_services.tools.kernels import rotate, rotate_back
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Grip:
    """Two tools that close on the body; what of them never changes."""

    first: int
    second: int
    axis: Floats
    """unit vector from the first to the second as they start (3,)"""
    upright: list[float]
    """the first tool's orientation then"""
    thickness: float
    """half extents of both along the axis [m]"""
    width: float
    """of the body at rest along the axis [m]"""
    body: AnyBody
    """between the two"""

    @classmethod
    def build(cls, tools: ToolSet, first: int, second: int, body: AnyBody) -> Grip:
        way = tools.position[second] - tools.position[first]
        axis = np.asarray(way / np.linalg.norm(way))
        along = bounding_points(body) @ axis
        turns = tools.orientation
        thickness = extent_along(tools, first, axis, turns[first]) + extent_along(tools, second, -axis, turns[second])
        upright = turns[first].tolist()
        return cls(first, second, axis, upright, thickness, float(along.max() - along.min()), body)

    def axis_now(self, orientation: Floats) -> Floats:
        """The axis (3,), which turns with the first tool, at orientations (t, 4)."""
        turn = orientation[self.first]
        if turn.tolist() == self.upright:
            return self.axis
        return np.array(rotate(turn, *rotate_back(np.array(self.upright), *self.axis)))

    def force(self, wrench: Floats, orientation: Floats) -> float:
        """Mean force of the body on the two along their axis [N], of wrenches (t, 6) and orientations (t, 4)."""
        return 0.5 * along_axis(self.axis_now(orientation), wrench[self.first, :3], wrench[self.second, :3])

    def compression(self, position: Floats, orientation: Floats) -> float:
        """1 - gap/width at tool poses (t, 3) [m], (t, 4); 0 of a sheet across the axis, which has no width."""
        return 1.0 - self.gap(position, orientation) / self.width if self.width > 0.0 else 0.0

    def gap(self, position: Floats, orientation: Floats) -> float:
        """Clear way between the two at tool poses (t, 3) [m], (t, 4)."""
        return along_axis(self.axis_now(orientation), position[self.first], position[self.second]) - self.thickness


def grips_by_phase(scene: Scene, tools: ToolSet, bodies: Sequence[AnyBody]) -> dict[int, Grip]:
    """The grip of every phase that closes two tools, on the body between them."""
    index = {name: i for i, name in enumerate(tools.names)}
    grips = {}
    for number, phase in enumerate(scene.motion):
        if isinstance(phase, ClosePhase):
            first, second = (index[name] for name in phase.tools)
            body = nearest_body(bodies, 0.5 * (tools.position[first] + tools.position[second]))
            grips[number] = Grip.build(tools, first, second, body)
    return grips


def nearest_body(bodies: Sequence[AnyBody], point: Floats) -> AnyBody:
    """The body whose box at rest is nearest to a point (3,) [m]; of those around it, that with the nearest middle."""
    if len(bodies) == 1:
        return bodies[0]

    def far(body: AnyBody) -> tuple[float, float]:
        points = bounding_points(body)
        low, high = points.min(axis=0), points.max(axis=0)
        outside = np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high)))
        return float(outside), float(np.linalg.norm(0.5 * (low + high) - point))

    return min(bodies, key=far)


def along_axis(axis: Floats, first: Floats, second: Floats) -> float:
    """axis . (second - first), each (3,); in plain numbers, which for three of them is the quickest."""
    (ax, ay, az), (x, y, z), (u, v, w) = axis.tolist(), first.tolist(), second.tolist()
    return float(ax * (u - x) + ay * (v - y) + az * (w - z))
