"""The motion of a scene: which tool moves how fast in each step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene import Scene
from softseam_protocol.scene_motion import ClosePhase, GripPhase, HoldPhase, MovePhase, ReleasePhase, TurnPhase
from softseam_services.tools.kernels import rotate, rotate_back
from softseam_services.tools.outline import extent_along
from softseam_services.tools.pose import quaternion_turning, turned
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
_ROUNDING = 1e-9
"""of a step or a length: what counts as reached"""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the motion stands: all that evolves."""

    phase: int = 0
    elapsed: float = 0.0
    """in this phase [s]"""


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

    def gap(self, position: Floats, orientation: Floats) -> float:
        """Clear way between the two at tool poses (t, 3) [m], (t, 4)."""
        return along_axis(self.axis_now(orientation), position[self.first], position[self.second]) - self.thickness


def along_axis(axis: Floats, first: Floats, second: Floats) -> float:
    """axis . (second - first), each (3,); in plain numbers, which for three of them is the quickest."""
    (ax, ay, az), (x, y, z), (u, v, w) = axis.tolist(), first.tolist(), second.tolist()
    return float(ax * (u - x) + ay * (v - y) + az * (w - z))


def standing(phase: HoldPhase | GripPhase | ReleasePhase) -> float:
    """How long a phase lets all tools stand still [s]."""
    if isinstance(phase, HoldPhase):
        return phase.hold
    return phase.grip if isinstance(phase, GripPhase) else phase.release


class Program:
    """Turns the scene's motion into tool velocities, one step at a time.

    x_rest (N, 3) gives the body's width between closing tools, the base of its compression.
    """

    def __init__(self, scene: Scene, tools: ToolSet, x_rest: Floats) -> None:
        self._phases = scene.motion
        self._dt = scene.step
        self._tools = tools
        self._index = {name: i for i, name in enumerate(tools.names)}
        self._grips = {
            number: Grip.build(tools, self._index[phase.tools[0]], self._index[phase.tools[1]], x_rest)
            for number, phase in enumerate(self._phases)
            if isinstance(phase, ClosePhase)
        }
        self.grip = next(iter(self._grips.values()), None)
        """the first two tools that close, if any do"""
        self._lengths = {
            number: float(np.linalg.norm(phase.move if isinstance(phase, MovePhase) else phase.turn))
            for number, phase in enumerate(self._phases)
            if isinstance(phase, MovePhase | TurnPhase)
        }
        """ways of moves [m] and angles of turns [rad], by phase"""

    def grip_of(self, phase: int) -> Grip:
        """The grip of a closing phase."""
        return self._grips[phase]

    def done(self, progress: Progress) -> bool:
        return progress.phase >= len(self._phases)

    def compression(self, position: Floats, orientation: Floats) -> float:
        """1 - (gap between the gripping tools)/(width of the body at rest), or 0 without a grip."""
        return 0.0 if self.grip is None else 1.0 - self.grip.gap(position, orientation) / self.grip.width

    def velocities(self, progress: Progress, position: Floats, orientation: Floats) -> Floats:
        """Velocities and angular velocities of the tools in the coming step (t, 6) [m/s, rad/s].

        A phase's last step is slowed to end on the mark.
        """
        velocity = np.zeros((len(position), 6))
        if self.done(progress):
            return velocity
        phase = self._phases[progress.phase]
        if isinstance(phase, ClosePhase):
            grip = self._grips[progress.phase]
            speed = phase.close
            if phase.until.compression is not None:
                goal = (1.0 - phase.until.compression) * grip.width
                speed = min(speed, max(0.0, (grip.gap(position, orientation) - goal) / (2.0 * self._dt)))
            if phase.until.time is not None:
                speed *= min(1.0, max(0.0, (phase.until.time - progress.elapsed) / self._dt))
            axis = grip.axis_now(orientation)
            velocity[grip.first, :3] = speed * axis
            velocity[grip.second, :3] = -speed * axis
        elif isinstance(phase, MovePhase):
            length = self._lengths[progress.phase]
            left = length - phase.speed * progress.elapsed
            share = min(phase.speed, max(0.0, left / self._dt)) / length
            for name in phase.tools:
                velocity[self._index[name], :3] = [share * way for way in phase.move]
        elif isinstance(phase, TurnPhase):
            length = self._lengths[progress.phase]
            left = length - phase.speed * progress.elapsed
            rate = np.array(phase.turn) * (min(phase.speed, max(0.0, left / self._dt)) / length)
            tools = [self._index[name] for name in phase.tools]
            centre = position[tools].mean(axis=0) if phase.about is None else np.array(phase.about)
            turn = quaternion_turning(self._dt * rate)
            for tool in tools:
                arm = position[tool] - centre
                velocity[tool, :3] = (np.array(rotate(turn, *arm)) - arm) / self._dt
                velocity[tool, 3:] = rate
        return velocity

    def gripping(self, progress: Progress, before: NDArray[np.int8]) -> NDArray[np.int8]:
        """1 for the tools that hold particles in the coming step (t,), after those that did before."""
        phase = None if self.done(progress) else self._phases[progress.phase]
        if not isinstance(phase, GripPhase | ReleasePhase):
            return before
        now = before.copy()
        now[[self._index[name] for name in phase.tools]] = isinstance(phase, GripPhase)
        return now

    def after(self, progress: Progress, position: Floats, orientation: Floats, grip_force: float) -> Progress:
        """Progress after a step that ended with these tool poses and this mean grip force [N]."""
        if self.done(progress):
            return progress
        phase = self._phases[progress.phase]
        elapsed = progress.elapsed + self._dt
        tick = _ROUNDING * self._dt
        if isinstance(phase, HoldPhase | GripPhase | ReleasePhase):
            ended = elapsed >= standing(phase) - 0.5 * self._dt
        elif isinstance(phase, MovePhase | TurnPhase):
            ended = phase.speed * elapsed >= self._lengths[progress.phase] - phase.speed * tick
        else:
            grip = self._grips[progress.phase]
            until = phase.until
            ended = (
                (
                    until.compression is not None
                    and 1.0 - grip.gap(position, orientation) / grip.width >= until.compression - _ROUNDING
                )
                or (until.force is not None and grip_force >= until.force)
                or (until.time is not None and elapsed >= until.time - tick)
            )
        return Progress(progress.phase + 1, 0.0) if ended else Progress(progress.phase, elapsed)

    def duration(self) -> float | None:
        """Length of the motion [s], or None where it depends on a force."""
        total = 0.0
        position, orientation = self._tools.position.copy(), self._tools.orientation.copy()
        for number, phase in enumerate(self._phases):
            if isinstance(phase, HoldPhase | GripPhase | ReleasePhase):
                total += standing(phase)
            elif isinstance(phase, MovePhase):
                total += self._lengths[number] / phase.speed
                for name in phase.tools:
                    position[self._index[name]] += phase.move
            elif isinstance(phase, TurnPhase):
                total += self._lengths[number] / phase.speed
                tools = [self._index[name] for name in phase.tools]
                centre = position[tools].mean(axis=0) if phase.about is None else np.array(phase.about)
                turn = quaternion_turning(np.array(phase.turn))
                for tool in tools:
                    position[tool] = centre + rotate(turn, *(position[tool] - centre))
                    orientation[tool] = turned(turn, orientation[tool])
            else:
                grip = self._grips[number]
                bounds = []
                if phase.until.compression is not None:
                    way = grip.gap(position, orientation) - (1.0 - phase.until.compression) * grip.width
                    bounds.append(max(0.0, way) / (2.0 * phase.close))
                if phase.until.time is not None:
                    bounds.append(phase.until.time)
                if not bounds:
                    return None
                total += min(bounds)
                way_each = min(bounds) * phase.close * grip.axis_now(orientation)
                position[grip.first] += way_each
                position[grip.second] -= way_each
        return total
