"""Two tools that close on the body: their axis, and how far they are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase
from softseam_protocol.scene.scene import Scene
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

    @classmethod
    def build(cls, tools: ToolSet, first: int, second: int, x_rest: Floats) -> Grip:
        way = tools.position[second] - tools.position[first]
        axis = np.asarray(way / np.linalg.norm(way))
        along = x_rest @ axis
        turns = tools.orientation
        thickness = extent_along(tools, first, axis, turns[first]) + extent_along(tools, second, -axis, turns[second])
        upright = turns[first].tolist()
        return cls(first, second, axis, upright, thickness, float(along.max() - along.min()))

    def axis_now(self, orientation: Floats) -> Floats:
        """The axis (3,), which turns with the first tool, at orientations (t, 4)."""
        turn = orientation[self.first]
        if turn.tolist() == self.upright:
            return self.axis
        return np.array(rotate(turn, *rotate_back(np.array(self.upright), *self.axis)))

    def force(self, wrench: Floats, orientation: Floats) -> float:
        """Mean force of the body on the two along their axis [N], of wrenches (t, 6) and orientations (t, 4)."""
        return 0.5 * along_axis(self.axis_now(orientation), wrench[self.first, :3], wrench[self.second, :3])

    def gap(self, position: Floats, orientation: Floats) -> float:
        """Clear way between the two at tool poses (t, 3) [m], (t, 4)."""
        return along_axis(self.axis_now(orientation), position[self.first], position[self.second]) - self.thickness


def grips_by_phase(scene: Scene, tools: ToolSet, x_rest: Floats) -> dict[int, Grip]:
    """The grip of every phase that closes two tools; x_rest (N, 3) gives the body's width between them."""
    index = {name: i for i, name in enumerate(tools.names)}
    return {
        number: Grip.build(tools, index[phase.tools[0]], index[phase.tools[1]], x_rest)
        for number, phase in enumerate(scene.motion)
        if isinstance(phase, ClosePhase)
    }


def along_axis(axis: Floats, first: Floats, second: Floats) -> float:
    """axis . (second - first), each (3,); in plain numbers, which for three of them is the quickest."""
    (ax, ay, az), (x, y, z), (u, v, w) = axis.tolist(), first.tolist(), second.tolist()
    return float(ax * (u - x) + ay * (v - y) + az * (w - z))
