"""What becomes of the bodies of a pile: those of which there may be something to say are looked at one by one.

Nearly always there is nothing: no body went behind what holds it, is far from everything, has an idle tool in its box,
or creeps. That is found in arrays of b bodies and t tools, by the bounds that `whereabouts`, `pierced` and `creep` go
by; the words are theirs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.pile import Members
from softseam_services.orchestrator.creep import TREND
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.whereabouts import FAR
from softseam_services.shapes.branches import PLANE
from softseam_services.tools.kernels import rotate
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class PileWatch:
    """Watches b bodies between t tools."""

    def __init__(self, bodies: Sequence[SimulatedBody], tools: ToolSet) -> None:
        self._bodies, self._tools = bodies, tools
        self._planes = np.flatnonzero(tools.kind == PLANE)
        self._finite = np.isfinite(tools.reach)
        held = [set(body.whereabouts.holding) - set(self._planes.tolist()) for body in bodies]
        self._by_plates = np.array([bool(each) for each in held], dtype=np.bool_)  # which are looked at every time
        self._size = np.array([body.whereabouts.size for body in bodies])
        self._way = np.array([body.creep.least_way for body in bodies])
        self._longest = np.array([body.creep.longest_way for body in bodies])
        begun = np.array([body.whereabouts.begun for body in bodies])
        self._low, self._high = begun[:, 0], begun[:, 1]
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._middle: Floats | None = None
        self._across = np.zeros((len(self._bodies), len(self._planes)))
        self._steps: deque[Members] = deque(maxlen=self._bodies[0].creep.n_looks)
        self._poses: tuple[Floats, Floats] | None = None

    def look(self, step: Members, position: Floats, orientation: Floats, look_at: Callable[[int], None]) -> None:
        """A step was taken, at whose end the tools have these poses (t, 3) [m], (t, 4): look at the bodies of those
        places of which there may be something to say but that they creep."""
        middle = 0.5 * (step.low + step.high)
        odd = self._behind(middle, position, orientation) | self._by_plates | ~np.isfinite(middle).all(axis=1)
        odd |= self._idle_inside(step, position)
        if len(position):
            odd |= (step.n_contacts == 0) & (self._away(step, position) >= FAR * self._size)
        for place in np.flatnonzero(odd | (self._middle is None)).tolist():
            if self._middle is not None:
                self._bodies[place].whereabouts.middle = self._middle[place]
            look_at(place)
        self._middle = middle

    def look_for_creep(self, step_number: int, step: Members, position: Floats, orientation: Floats) -> None:
        """The same for creep: of what has moved by enough since as many looks ago as that takes."""
        before, self._poses = self._poses, (position, orientation)
        if before is None or not all((then == now).all() for then, now in zip(before, self._poses, strict=True)):
            self._steps.clear()
            return
        self._steps.append(step)
        if len(self._steps) < (self._steps.maxlen or 0):
            return
        for place in np.flatnonzero(self._may_creep()).tolist():
            looks = [
                (
                    np.stack((one.low[place], one.high[place])),
                    one.momentum[place],
                    one.angular_momentum[place],
                    one.n_contacts.item(place) > 0,
                )
                for one in self._steps
            ]
            self._bodies[place].creep.look_back(step_number, looks)

    def _may_creep(self) -> Mask:
        """Bodies that came far enough at the latest looks, not too fast, and as far in the later half as in the earlier
        (b,); see `Creep`, which has the last word."""
        places = np.array([(each.low + each.high) for each in self._steps]) / 2.0
        n, half = len(places) - 1, (len(places) - 1) // 2
        way = np.linalg.norm(places[-1] - places[0], axis=1)
        later, earlier = places[-1] - places[-1 - half], places[half] - places[0]
        trend = np.linalg.norm(later - earlier, axis=1) / max(1, half)
        return np.asarray((way > self._way) & (way < self._longest) & (trend < TREND * way / n))

    def _behind(self, middle: Floats, position: Floats, orientation: Floats) -> Mask:
        """Bodies whose middle has come from one side of a plane to the other, or is in it (b,)."""
        before, self._across = self._across, np.empty_like(self._across)
        for at, tool in enumerate(self._planes.tolist()):
            normal = rotate(orientation[tool], *self._tools.shape[tool, :3])
            self._across[:, at] = (middle - position[tool]) @ np.array(normal)
        return np.asarray((self._across * before <= 0.0).any(axis=1))

    def _away(self, step: Members, position: Floats) -> Floats:
        """How far bodies are from the tools and from where they began (b,) [m]."""
        least, most = self._low, self._high
        for tool in np.flatnonzero(self._finite).tolist():
            least = np.minimum(least, position[tool] - self._tools.reach[tool])
            most = np.maximum(most, position[tool] + self._tools.reach[tool])
        away = np.maximum(step.low - most, 0.0) - np.maximum(least - step.high, 0.0)
        return np.asarray(np.linalg.norm(away, axis=1))

    def _idle_inside(self, step: Members, position: Floats) -> Mask:
        """Bodies in whose box a tool is within its reach that they do not feel (b,)."""
        away = np.maximum(step.low[:, None] - position, position - step.high[:, None]).max(axis=2)
        idle = ~step.wrench.any(axis=2) & self._finite & (away <= self._tools.reach)
        return np.asarray(idle.any(axis=1))
