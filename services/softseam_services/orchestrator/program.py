"""The motion of a scene: which tool moves how fast in each step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene import ClosePhase, HoldPhase, MovePhase, Scene
from softseam_services.tools.tool_set import BOX, SPHERE, ToolSet

Floats = NDArray[np.float64]
_ROUNDING = 1e-9
"""of a step or a length: what counts as reached"""


@dataclass(frozen=True)
class Progress:
    """Where the motion stands: all that evolves."""

    phase: int = 0
    elapsed: float = 0.0
    """in this phase [s]"""


def extent_along(tools: ToolSet, tool: int, direction: Floats) -> float:
    """Half extent of an upright tool along a unit direction [m]."""
    if tools.kind[tool] == BOX:
        return float(np.abs(direction) @ tools.shape[tool])
    if tools.kind[tool] == SPHERE:
        return float(tools.shape[tool, 0])
    return 0.0


class Program:
    """Turns the scene's motion into tool velocities, one step at a time.

    x_rest (N, 3) gives the body's width between closing tools, the base of its compression.
    """

    def __init__(self, scene: Scene, tools: ToolSet, x_rest: Floats) -> None:
        self._phases = scene.motion
        self._dt = scene.step
        self._tools = tools
        self._index = {name: i for i, name in enumerate(tools.names)}
        self._x_rest = x_rest
        close = next((p for p in self._phases if isinstance(p, ClosePhase)), None)
        self.grip = None if close is None else (self._index[close.tools[0]], self._index[close.tools[1]])
        """the two tools that grip, if any do"""

    def done(self, progress: Progress) -> bool:
        return progress.phase >= len(self._phases)

    def compression(self, position: Floats) -> float:
        """1 - (gap between the gripping tools)/(width of the body at rest), or 0 without a grip."""
        return 0.0 if self.grip is None else 1.0 - self._gap(position, *self.grip) / self._width(*self.grip)

    def grip_axis(self) -> Floats:
        """Unit vector from the first gripping tool to the second."""
        assert self.grip is not None
        return self._axis(*self.grip)

    def velocities(self, progress: Progress, position: Floats) -> Floats:
        """Tool velocities for the coming step (t, 3) [m/s]; a phase's last step is slowed to end on the mark."""
        velocity = np.zeros_like(position)
        if self.done(progress):
            return velocity
        phase = self._phases[progress.phase]
        if isinstance(phase, ClosePhase):
            a, b = (self._index[name] for name in phase.tools)
            speed = phase.close
            if phase.until.compression is not None:
                goal = (1.0 - phase.until.compression) * self._width(a, b)
                speed = min(speed, max(0.0, (self._gap(position, a, b) - goal) / (2.0 * self._dt)))
            if phase.until.time is not None:
                speed *= min(1.0, max(0.0, (phase.until.time - progress.elapsed) / self._dt))
            axis = self._axis(a, b)
            velocity[a] = speed * axis
            velocity[b] = -speed * axis
        elif isinstance(phase, MovePhase):
            way = np.asarray(phase.move)
            length = float(np.linalg.norm(way))
            left = length - phase.speed * progress.elapsed
            for name in phase.tools:
                velocity[self._index[name]] = way / length * min(phase.speed, max(0.0, left / self._dt))
        return velocity

    def after(self, progress: Progress, position: Floats, grip_force: float) -> Progress:
        """Progress after a step that ended with these tool positions and this mean grip force [N]."""
        if self.done(progress):
            return progress
        phase = self._phases[progress.phase]
        elapsed = progress.elapsed + self._dt
        tick = _ROUNDING * self._dt
        if isinstance(phase, HoldPhase):
            ended = elapsed >= phase.hold - 0.5 * self._dt
        elif isinstance(phase, MovePhase):
            ended = phase.speed * elapsed >= float(np.linalg.norm(phase.move)) - phase.speed * tick
        else:
            a, b = (self._index[name] for name in phase.tools)
            until = phase.until
            ended = (
                (
                    until.compression is not None
                    and 1.0 - self._gap(position, a, b) / self._width(a, b) >= until.compression - _ROUNDING
                )
                or (until.force is not None and grip_force >= until.force)
                or (until.time is not None and elapsed >= until.time - tick)
            )
        return Progress(progress.phase + 1, 0.0) if ended else replace(progress, elapsed=elapsed)

    def duration(self) -> float | None:
        """Length of the motion [s], or None where it depends on a force."""
        total = 0.0
        position = self._tools.position.copy()
        for phase in self._phases:
            if isinstance(phase, HoldPhase):
                total += phase.hold
            elif isinstance(phase, MovePhase):
                total += float(np.linalg.norm(phase.move)) / phase.speed
                for name in phase.tools:
                    position[self._index[name]] += phase.move
            else:
                a, b = (self._index[name] for name in phase.tools)
                bounds = []
                if phase.until.compression is not None:
                    way = self._gap(position, a, b) - (1.0 - phase.until.compression) * self._width(a, b)
                    bounds.append(max(0.0, way) / (2.0 * phase.close))
                if phase.until.time is not None:
                    bounds.append(phase.until.time)
                if not bounds:
                    return None
                total += min(bounds)
                way_each = min(bounds) * phase.close * self._axis(a, b)
                position[a] += way_each
                position[b] -= way_each
        return total

    def _axis(self, a: int, b: int) -> Floats:
        way = self._tools.position[b] - self._tools.position[a]
        return np.asarray(way / np.linalg.norm(way))

    def _gap(self, position: Floats, a: int, b: int) -> float:
        axis = self._axis(a, b)
        between = float((position[b] - position[a]) @ axis)
        return between - extent_along(self._tools, a, axis) - extent_along(self._tools, b, axis)

    def _width(self, a: int, b: int) -> float:
        along = self._x_rest @ self._axis(a, b)
        return float(along.max() - along.min())
