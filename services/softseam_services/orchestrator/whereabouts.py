"""Where bodies are: whether one left all that is in the scene, or came out behind a plane or plate that was to hold it.

What the participants say of a step, the bounds of a body's nodes, is enough for that, and is looked at now and then: no
body comes back from there. Draped over a tool a body may have its middle behind it; so only plates that are wider than
the body count, and for sheets and ropes only planes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advanced
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import bounding_points
from softseam_services.shapes.branches import BOX, PLANE
from softseam_services.tools.kernels import rotate
from softseam_services.tools.kernels.beside import find_sides
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Say = Callable[[int, str, str], None]
"""receives an event: the place of its body among all, its kind, its text"""

LOOK_EVERY = 10
"""steps between looks"""
FAR = 10.0
"""extents of the body by which it is away from everything else when it is gone"""


class Seen(NamedTuple):
    """b bodies after a step."""

    bounds: Floats
    """lower and upper, of the nodes of each (b, 2, 3) [m]"""
    momentum: Floats
    """(b, 3) [kg m/s]"""
    angular_momentum: Floats
    """about the world's origin (b, 3) [kg m^2/s]"""
    touches: Mask
    """whether tools touch each (b,)"""

    @classmethod
    def of(cls, parts: Sequence[Advanced]) -> Seen:
        """One body, of all of its parts."""
        if len(parts) == 1:
            (part,) = parts
            touches = np.array([part.figure(Figure.CONTACTS) > 0.0])
            return cls(part.bounds[None], part.momentum[None], part.angular_momentum[None], touches)
        bounds = np.array([part.bounds for part in parts])
        return cls(
            np.array([[bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)]]),
            np.sum([part.momentum for part in parts], axis=0)[None],
            np.sum([part.angular_momentum for part in parts], axis=0)[None],
            np.array([any(part.figure(Figure.CONTACTS) for part in parts)]),
        )


class Whereabouts:
    """Watches b bodies; tells of each once that it is gone, and once a tool that it is behind it."""

    def __init__(self, bodies: Sequence[AnyBody], tools: ToolSet, say: Say) -> None:
        self._tools, self._say = tools, say
        points = [bounding_points(body) for body in bodies]
        self._begun = np.array([[each.min(axis=0), each.max(axis=0)] for each in points])
        self._size = np.ptp(self._begun, axis=1).max(axis=1)
        self._gravity = np.array([body.gravity for body in bodies])
        solid = np.array([body.has_cells or body.kind == "tet_mesh" for body in bodies])
        across = np.sort(2.0 * tools.shape[:, :3], axis=1)[:, 1]
        plates = solid[:, None] & (tools.kind == BOX) & (across > self._size[:, None])
        self._holding: Mask = plates | (tools.kind == PLANE)  # planes, and plates wider than the body (b, t)
        self._holds = bool(self._holding.any())
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._side = np.full(self._holding.shape, np.nan)  # where a body's middle was last beside a tool [m]
        self._behind = np.zeros(self._holding.shape, dtype=np.bool_)
        self._gone = np.zeros(len(self._size), dtype=np.bool_)
        self._middle = np.full((len(self._size), 3), np.nan)

    def start(self) -> None:
        """The bodies are at rest, where the scene starts."""
        self.forget()
        self._middle = self._begun.mean(axis=1)
        across = self._across(self._middle, self._tools.position, self._tools.orientation)
        self._side = np.where(across == 0.0, np.nan, across)

    def look(self, step: int, bounds: Floats, touches: Mask, position: Floats, orientation: Floats) -> None:
        """A step was taken, after which bodies have these bounds (b, 2, 3) [m], and tools, that touch each or do not
        (b,), these poses (t, 3) [m], (t, 4)."""
        middle = 0.5 * (bounds[:, 0] + bounds[:, 1])
        known: Mask = np.asarray(np.isfinite(middle).all(axis=1))
        if self._holds:
            self._look_behind(step, middle, known, position, orientation)
        if len(position) and (may := known & ~self._gone & ~touches).any():
            self._look_away(step, bounds, middle, may, position, orientation)
        np.copyto(self._middle, middle, where=known[:, None])

    def _look_behind(self, step: int, middle: Floats, known: Mask, position: Floats, orientation: Floats) -> None:
        """Tell where a body's middle has come from one side of a tool to the other."""
        across, looked = self._across(middle, position, orientation), known[:, None] & ~self._behind
        came = looked & (across * self._side < 0.0)
        np.copyto(self._side, across, where=looked & (across != 0.0))
        if not came.any():
            return
        self._behind |= came
        self._gone |= came.any(axis=1)  # said with that
        for place, tool in np.argwhere(came).tolist():
            name, deep = self._tools.names[tool], abs(float(across[place, tool]))
            self._say(
                place,
                "gone",
                f"step {step}: the body came through {name}, its middle is {deep:.3g} m behind it: shorten the step, "
                f"meet {name} more slowly, make it thicker, or give the body to fem by regions.default",
            )

    def _across(self, middle: Floats, position: Floats, orientation: Floats) -> Floats:
        """How far the bodies' middles (b, 3) [m] are on one side of each tool that is to hold them, negative on the
        other; 0 inside a plate, NaN beside one, and of other tools (b, t) [m]."""
        found, tools = np.empty(self._holding.shape), self._tools
        find_sides(middle, tools.kind, tools.shape, self._holding, position, orientation, found)
        return found

    def _look_away(
        self, step: int, bounds: Floats, middle: Floats, may: Mask, position: Floats, orientation: Floats
    ) -> None:
        """Tell of bodies that may be gone (b,) where they are far from everything, move farther away, and neither
        gravity nor a plane stops them."""
        least, most = self._begun[:, 0], self._begun[:, 1]
        for tool in np.flatnonzero(np.isfinite(self._tools.reach)).tolist():
            least = np.minimum(least, position[tool] - self._tools.reach[tool])
            most = np.maximum(most, position[tool] + self._tools.reach[tool])
        away = np.maximum(bounds[:, 0] - most, 0.0) - np.maximum(least - bounds[:, 1], 0.0)
        far = np.linalg.norm(away, axis=1)
        leaves = ((middle - self._middle) * away).sum(axis=1) > 0.0
        falls = (self._gravity * away).sum(axis=1) >= 0.0
        gone = may & (far >= FAR * self._size) & leaves & falls & ~self._is_caught(orientation)
        self._gone |= gone
        for place in np.flatnonzero(gone).tolist():
            self._say(
                place,
                "gone",
                f"step {step}: the body is {far[place]:.3g} m away from the tools and from where it began, and nothing "
                "stops it: hold it better, put a plane under it, or give the run a shorter duration",
            )

    def _is_caught(self, orientation: Floats) -> Mask:
        """Whether each body falls onto a plane, on the right side of which it still is (b,)."""
        caught = np.zeros(len(self._size), dtype=np.bool_)
        for tool in np.flatnonzero(self._tools.kind == PLANE).tolist():
            normal = np.array(rotate(orientation[tool], *self._tools.shape[tool, :3]))
            caught |= (self._gravity @ normal < 0.0) & ~self._behind[:, tool]
        return caught
