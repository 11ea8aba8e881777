"""All grips of a scene's motion: each is found anew as a phase begins to close its tools, where they and the body are.

Tools that close on while they squeeze it keep what they found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase, OpenPhase
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.grip import AT_REST, Grip, Placement, nearest_body
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
Placed = Callable[[AnyBody], Placement]


def _at_rest(body: AnyBody) -> Placement:
    return AT_REST


class Grips:
    """The grips as they are now, by the tools that close.

    placed  where a body stands; asked as tools begin to close
    """

    def __init__(self, scene: Scene, tools: ToolSet, bodies: Sequence[AnyBody], placed: Placed | None = None) -> None:
        self._scene, self._tools, self._bodies = scene, tools, tuple(bodies)
        self._placed: Placed = placed or _at_rest
        index = {name: i for i, name in enumerate(tools.names)}
        self._of: dict[int, tuple[int, ...]] = {}
        self._at_start: dict[tuple[int, ...], Grip] = {}
        for number, phase in enumerate(scene.motion):
            if isinstance(phase, ClosePhase):
                which = tuple(index[name] for name in phase.tools)
                self._of[number] = which
                if which not in self._at_start:
                    grip = self._found(which, tools.position, tools.orientation, _at_rest, phase.about)
                    self._at_start[which] = grip
            elif isinstance(phase, OpenPhase):
                opened = {index[name] for name in phase.tools}
                self._of[number] = next(which for which in reversed(self._at_start) if {*which} == opened)
        self.reset()

    def reset(self) -> None:
        """Back to the start of the scene."""
        self._now = dict(self._at_start)

    @property
    def first(self) -> Grip | None:
        """Of the first tools that close, if any do."""
        return next(iter(self._now.values()), None)

    def of(self, phase: int) -> Grip | None:
        """Of the tools that close or open in a phase; None of others."""
        which = self._of.get(phase)
        return None if which is None else self._now[which]

    def begin(self, phase: int, position: Floats, orientation: Floats) -> None:
        """A phase begins with tools at these poses (t, 3) [m], (t, 4)."""
        closing = self._scene.motion[phase]
        if not isinstance(closing, ClosePhase):
            return
        which = self._of[phase]
        now = self._now[which]
        if not (now.felt and now.compression(position, orientation) > 0.0):
            self._now[which] = self._found(which, position, orientation, self._placed, closing.about)

    def step(self, wrench: Floats, position: Floats, orientation: Floats, by_hand: bool) -> None:
        """Take in what tools at these poses felt in a step (t, 6) [N, N m]; by_hand: in which nobody closed them by a
        phase, so that they may have come to the body from anywhere."""
        touched = {tool for tool, force in enumerate(wrench[:, :3].tolist()) if any(force)}
        for which, now in self._now.items():
            felt = touched.issuperset(which)
            if felt and not now.felt:
                if by_hand and now.aside(position):
                    now = self._found(which, position, orientation, self._placed)
                touch = now.touch if np.isfinite(now.touch) else now.spread(position, orientation)
                self._now[which] = replace(now, felt=True, touch=touch)
            elif now.felt and not felt and now.compression(position, orientation) <= 0.0:
                self._now[which] = replace(now, felt=False)

    def compression(self, position: Floats, orientation: Floats) -> float:
        """Of the first grip: 0 until all of its tools have felt the body."""
        now = self.first
        return max(0.0, now.compression(position, orientation)) if now is not None and now.felt else 0.0

    def as_it_stands(self, phase: int, position: Floats, orientation: Floats) -> float:
        """Compression of the body between the tools of a phase, undeformed, but moved and turned as it is now [1]."""
        found = self._found(self._of[phase], position, orientation, self._placed)
        return found.compression(position, orientation)

    def fresh(self) -> Grips:
        """The same at the start, with bodies that stay at rest."""
        found = copy(self)
        found._placed = _at_rest
        found.reset()
        return found

    def _found(
        self,
        which: tuple[int, ...],
        position: Floats,
        orientation: Floats,
        placed: Placed,
        about: tuple[float, ...] | None = None,
    ) -> Grip:
        placements = [placed(body) for body in self._bodies]
        start = self._at_start.get(which)
        if start is not None and about is None and all(each is AT_REST for each in placements):
            tools = self._tools
            if np.array_equal(position, tools.position) and np.array_equal(orientation, tools.orientation):
                return start
        number = nearest_body(self._bodies, placements, position[list(which)].mean(axis=0))
        body, stands = self._bodies[number], placements[number]
        return Grip.build(self._tools, which, body, stands, position, orientation, about)

    # ---- snapshots

    def save(self) -> Floats:
        """All that evolves, one grip after another (k,)."""
        rows = [
            [*now.inward.ravel(), *now.begun.ravel(), *now.upright, now.touch, now.width, now.thickness, of, now.felt]
            for now in self._now.values()
            for of, body in enumerate(self._bodies)
            if body is now.body
        ]
        return np.array([number for row in rows for number in row], dtype=np.float64)

    def load(self, saved: Floats) -> None:
        """Continue from `save`."""
        numbers = iter(saved.tolist())

        def take(count: int) -> list[float]:
            return [next(numbers) for _ in range(count)]

        for which in self._now:
            inward, begun = (np.array(take(3 * len(which))).reshape(-1, 3) for _ in range(2))
            upright, (touch, width, thickness, body, felt) = take(4), take(5)
            self._now[which] = Grip(
                *(which, inward, upright, begun, touch, width, thickness, self._bodies[int(body)], bool(felt))
            )
