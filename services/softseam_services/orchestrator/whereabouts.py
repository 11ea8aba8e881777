"""Where a body is: whether it left all that is in the scene, or came out behind a plane or plate that was to hold it.

What the participants tell of a step, the bounds of its nodes, is enough for that, and is looked at now and then: no
body comes back from there. Draped over a tool a body may have its middle behind it; so only plates that are wider than
the body count, and for sheets and ropes only planes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advanced
from softseam_services.body.bounding_points import bounding_points
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.shapes.branches import BOX, PLANE
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

LOOK_EVERY = 10
"""steps between looks"""
FAR = 10.0
"""extents of the body by which it is away from everything else when it is gone"""


def box_of(replies: Sequence[Advanced]) -> Floats:
    """Lower and upper bounds of all parts of a body (2, 3) [m]."""
    first, *others = (reply.bounds for reply in replies)
    for bounds in others:
        first = np.stack((np.minimum(first[0], bounds[0]), np.maximum(first[1], bounds[1])))
    return first


class Whereabouts:
    """Watches one body; tells once that it is gone, and of each tool once that it is behind it.

    tell  receives every event
    """

    def __init__(self, body: AnyBody, tools: ToolSet, tell: Tell) -> None:
        self._tools, self._tell = tools, tell
        points = bounding_points(body)
        self._low, self._high = points.min(axis=0), points.max(axis=0)
        self.size = float((self._high - self._low).max())
        """longest edge of the box around it, where the scene starts [m]"""
        self._gravity = np.asarray(body.gravity)
        solid = body.has_cells or body.kind == "tet_mesh"
        self.holding = [
            tool
            for tool, kind in enumerate(tools.kind)
            if kind == PLANE or (solid and kind == BOX and np.sort(2.0 * tools.shape[tool, :3])[1] > self.size)
        ]
        """planes, and plates wider than the body"""
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._side: dict[int, float] = {}
        self._behind: set[int] = set()
        self._gone = False
        self.middle: Floats | None = None
        """of its box at the last look (3,) [m]"""

    @property
    def begun(self) -> Floats:
        """Lower and upper bounds where the scene starts (2, 3) [m]."""
        return np.stack((self._low, self._high))

    def start(self) -> None:
        """The body is at rest, where the scene starts."""
        self.forget()
        self.middle = 0.5 * (self._low + self._high)
        for tool in self.holding:
            if across := self._across(tool, self.middle, self._tools.position, self._tools.orientation):
                self._side[tool] = across

    def look(self, step: int, replies: Mapping[str, Advanced], position: Floats, orientation: Floats) -> None:
        """A step was taken, at whose end the tools have these poses (t, 3) [m], (t, 4)."""
        low, high = box_of(list(replies.values()))
        middle = 0.5 * (low + high)
        if not all(map(math.isfinite, middle.tolist())):
            return
        for tool in self.holding:
            if tool not in self._behind:
                self._look_behind(step, tool, middle, position, orientation)
        touched = any(reply.figure(Figure.CONTACTS) for reply in replies.values())
        if not (self._gone or touched) and len(self._tools.names):
            self._look_away(step, low, high, middle, position, orientation)
        self.middle = middle

    def _look_behind(self, step: int, tool: int, middle: Floats, position: Floats, orientation: Floats) -> None:
        """Tell where the body's middle has come from one side of a tool to the other."""
        across = self._across(tool, middle, position, orientation)
        if across is None:
            self._side.pop(tool, None)
        elif across * self._side.get(tool, across) < 0.0:
            self._behind.add(tool)
            self._gone = True  # said with that
            name = self._tools.names[tool]
            self._tell(
                "gone",
                f"step {step}: the body came through {name}, its middle is {abs(across):.3g} m behind it: shorten the "
                f"step, meet {name} more slowly, make it thicker, or give the body to fem by regions.default",
            )
        elif across:
            self._side[tool] = across

    def _across(self, tool: int, middle: Floats, position: Floats, orientation: Floats) -> float | None:
        """How far the body's middle is on one side of a tool, negative on the other [m]; 0 inside a plate, and None
        where it is beside one."""
        (x, y, z), (px, py, pz) = middle.tolist(), position[tool].tolist()
        at = rotate_back(orientation[tool], x - px, y - py, z - pz)
        shape = self._tools.shape[tool, :3].tolist()
        if self._tools.kind[tool] == PLANE:
            return float(at[0] * shape[0] + at[1] * shape[1] + at[2] * shape[2])
        thin = shape.index(min(shape))
        if any(abs(at[axis]) > shape[axis] for axis in range(3) if axis != thin):
            return None
        return float(at[thin]) if abs(at[thin]) > shape[thin] else 0.0

    def _look_away(
        self, step: int, low: Floats, high: Floats, middle: Floats, position: Floats, orientation: Floats
    ) -> None:
        """Tell where the body is far from everything, moves farther away, and neither gravity nor a plane stops it."""
        least, most = self._low.copy(), self._high.copy()
        for tool, reach in enumerate(self._tools.reach):
            if math.isfinite(reach):
                least = np.minimum(least, position[tool] - reach)
                most = np.maximum(most, position[tool] + reach)
        away = np.maximum(low - most, 0.0) - np.maximum(least - high, 0.0)
        far = float(np.linalg.norm(away))
        if self.middle is None or far < FAR * self.size:
            return
        moved = middle - self.middle
        if float(moved @ away) <= 0.0 or float(self._gravity @ away) < 0.0 or self._is_caught(orientation):
            return
        self._gone = True
        self._tell(
            "gone",
            f"step {step}: the body is {far:.3g} m away from the tools and from where it began, and nothing stops it: "
            "hold it better, put a plane under it, or give the run a shorter duration",
        )

    def _is_caught(self, orientation: Floats) -> bool:
        """Whether the body falls onto a plane, on the right side of which it still is."""
        return any(
            self._tools.kind[tool] == PLANE
            and tool not in self._behind
            and float(np.array(rotate_back(orientation[tool], *self._gravity)) @ self._tools.shape[tool, :3]) < 0.0
            for tool in self.holding
        )
