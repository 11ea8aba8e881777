"""Tools that are inside the body while nothing touches them: they cut in, or passed between the points that feel tools.

A look at the body's surface costs about as much as a step. So it is taken only where a tool that feels nothing is
within the body's bounds, and of one that was found outside it, in a hole or a bend, half as often each time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import Detail
from softseam_services.body.body import Ints
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.tools.clear import any_inside
from softseam_services.tools.kernels import least_gaps, rotate
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]


class Pierced:
    """Watches one body; tells once of each tool that is inside it and feels nothing.

    tell  receives every event
    """

    def __init__(self, body: AnyBody, tools: ToolSet, tell: Tell) -> None:
        self._tools, self._tell = tools, tell
        self._triangles = _closed_surface(body)
        self._finite = np.isfinite(tools.reach) & (self._triangles is not None)
        self._middles = [_middles(tools, tool) if finite else _NONE for tool, finite in enumerate(self._finite)]
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._told = ~self._finite
        self._wait = np.zeros(len(self._tools.names), dtype=np.int64)
        self._left = self._wait.copy()

    def look(
        self,
        step: int,
        bounds: Floats,
        wrench: Floats,
        position: Floats,
        orientation: Floats,
        see: Callable[[], Floats],
    ) -> None:
        """A step was taken.

        bounds       of the body (2, 3) [m]
        wrench       of the body on the tools (t, 6) [N, N m]
        position     of the tools (t, 3) [m]; orientation (t, 4)
        see          returns the points of the body's surface (P, 3) [m]
        """
        idle = idle_inside(self._tools, bounds[None], wrench[None], position)[0] & ~self._told
        points: Floats | None = None
        for tool in np.flatnonzero(idle).tolist():
            turn = np.array([rotate(orientation[tool], *axis) for axis in np.eye(3)])
            places = position[tool] + self._middles[tool] @ turn
            places = places[((places > bounds[0]) & (places < bounds[1])).all(axis=1)]
            if not len(places):
                continue
            if self._left[tool] > 0:
                self._left[tool] -= 1
                continue
            points = see() if points is None else points
            assert self._triangles is not None  # else all were told of
            if any_inside(points, self._triangles, places):
                self._told[tool] = True
                self._tell("tools", f"step {step}: {self._tools.names[tool]} {_WORDS}", Detail.PIERCED)
            else:
                self._wait[tool] = self._left[tool] = 2 * self._wait[tool] + 1


def idle_inside(tools: ToolSet, bounds: Floats, wrench: Floats, position: Floats) -> NDArray[np.bool_]:
    """Tools (b, t) that do not feel bodies, by their wrenches (b, t, 6) [N, N m], and may reach into their bounds
    (b, 2, 3) [m] from where they are (t, 3) [m]."""
    away = np.maximum(bounds[:, None, 0] - position, position - bounds[:, None, 1]).max(axis=2)
    return np.asarray(~wrench.any(axis=2) & np.isfinite(tools.reach) & (away <= tools.reach))


_NONE = np.zeros((0, 3))
_MANY = 60
"""points of an outline that are looked at, or twice as many"""
_WELL = 0.3
"""of the deepest point's depth in the tool: points that are less deep tell nothing"""
_WORDS = (
    "is inside the body and nothing touches it, so its force is wrong: it cut in, or passed between the points that "
    "feel tools; shorten body.cell, shorten the step, or move it more slowly"
)


def _middles(tools: ToolSet, tool: int) -> Floats:
    """Its middle and points half as far out as its outline, in its frame, that are well inside it (m, 3) [m]."""
    outline = tools.geometry[tool].outline
    points = np.vstack([np.zeros((1, 3)), 0.5 * outline[:: max(1, len(outline) // _MANY)]])
    own, still, upright = slice(tool, tool + 1), np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    gap, depth = np.empty(1), np.empty(len(points))
    for number, point in enumerate(points):
        least_gaps(point[None], tools.kind[own], tools.shape[own], still, upright, gap)
        depth[number] = -gap[0]
    return np.asarray(points[depth > _WELL * depth.max()]) if depth.max() > 0.0 else _NONE


def _closed_surface(body: AnyBody) -> Ints | None:
    """Triangles of the surface that has an inside; None of sheets and ropes."""
    if body.has_cells:
        return body.surface.triangles
    return body.skin.triangles if body.solid is not None else None
