"""The motion of a scene: how far which tool moves in each step.

A phase that knows its own end, because only time or the tools' way decides it, ends within a step and the next takes
up the rest of it: what a step moves is the sum of both ways, and the poses at the end of a step are those of the exact
motion however long the steps are. Where a force decides (an end by force, a force held, a limit), whole steps belong to
one phase: the force is known after the step.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene_motion import ClosePhase, GripPhase, HoldPhase, MovePhase, Phase, ReleasePhase, TurnPhase
from softseam_services.orchestrator.grip import Grip
from softseam_services.tools.kernels import rotate
from softseam_services.tools.pose import quaternion_turning, turned
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
_ROUNDING = 1e-9
"""of a step or a length: what counts as reached"""
_WAY, _HANDS = (MovePhase, TurnPhase), (GripPhase, ReleasePhase)
"""phases in which tools have a way to go, and in which they take or let go particles"""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the motion stands: all that evolves."""

    phase: int = 0
    elapsed: float = 0.0
    """in this phase [s]"""


class Program:
    """Turns the scene's motion into what tools do, one step at a time.

    phases  of the scene
    dt      step [s]
    grips   of the closing phases (see `grips_by_phase`)
    driven  phases in which a drive has its say (see `Drives.phases`)
    """

    def __init__(
        self,
        phases: tuple[Phase, ...],
        dt: float,
        tools: ToolSet,
        grips: Mapping[int, Grip],
        driven: Collection[int] = (),
    ) -> None:
        self._phases = phases
        self._dt = dt
        self._tools = tools
        self._grips = grips
        self.grip = next(iter(grips.values()), None)
        """the first two tools that close, if any do"""
        self._index = {name: i for i, name in enumerate(tools.names)}
        self._whole = set(driven) | {number for number, phase in enumerate(phases) if _ends_by_force(phase)}
        """phases that take whole steps"""
        self._lengths = {
            number: math.hypot(*(phase.move if isinstance(phase, MovePhase) else phase.turn))
            for number, phase in enumerate(phases)
            if isinstance(phase, _WAY)
        }
        """ways of moves [m] and angles of turns [rad], by phase"""
        self._moves = {
            number: self._all_of(phase) for number, phase in enumerate(phases) if isinstance(phase, MovePhase)
        }
        """what moves do to the tools altogether, by phase (t, 6) [m, rad]"""

    def done(self, progress: Progress) -> bool:
        return progress.phase >= len(self._phases)

    def phase_of(self, before: Progress, after: Progress) -> int:
        """The phase that a step's end belongs to (the earlier one at a border); -1 where the motion was over before."""
        if self.done(before):
            return -1
        return after.phase if after.elapsed > 0.0 else max(before.phase, after.phase - 1)

    def compression(self, position: Floats, orientation: Floats) -> float:
        """1 - (gap between the gripping tools)/(width of the body at rest), or 0 without a grip."""
        return 0.0 if self.grip is None else 1.0 - self.grip.gap(position, orientation) / self.grip.width

    def step(self, progress: Progress, position: Floats, orientation: Floats) -> tuple[Floats, Progress | None]:
        """What the tools do in the coming step, from poses (t, 3) [m], (t, 4).

        Returns their velocities and angular velocities (t, 6) [m/s, rad/s], and the progress after the step; None where
        a force decides that (see `after`).
        """
        if self.done(progress):
            return np.zeros((len(position), 6)), progress
        if progress.phase in self._whole:
            duration = min(self._dt, self._left(progress, position, orientation))
            return self._way(progress.phase, duration, position, orientation) / self._dt, None
        rest, tick = self._dt, _ROUNDING * self._dt
        if self._left(progress, position, orientation) > rest + tick:
            way = self._way(progress.phase, rest, position, orientation)
            return way / self._dt, Progress(progress.phase, progress.elapsed + rest)
        way = np.zeros((len(position), 6))
        while rest > tick and not self.done(progress):
            if rest < self._dt and self._waits(progress, way):
                break
            left = self._left(progress, position, orientation)
            duration = min(left, rest)
            part = self._way(progress.phase, duration, position, orientation)
            way += part
            rest -= duration
            if left > duration + tick:
                progress = Progress(progress.phase, progress.elapsed + duration)
                break
            progress = Progress(progress.phase + 1)
            position, orientation = _moved(part, position, orientation)
        return way / self._dt, progress

    def after(self, progress: Progress, position: Floats, orientation: Floats, grip_force: float) -> Progress:
        """Progress after a step that a force decided on; it ended with these tool poses and this mean force [N]."""
        elapsed = progress.elapsed + self._dt
        there = Progress(progress.phase, elapsed)
        phase = self._phases[progress.phase]
        ended = self._left(there, position, orientation) <= self._slack(progress.phase)
        if isinstance(phase, ClosePhase) and phase.until.force is not None:
            ended = ended or grip_force >= phase.until.force
        return Progress(progress.phase + 1) if ended else there

    def gripping(self, progress: Progress, before: NDArray[np.int8]) -> NDArray[np.int8]:
        """1 for the tools that hold particles in the coming step (t,), after those that did before."""
        phase = None if self.done(progress) else self._phases[progress.phase]
        if not isinstance(phase, _HANDS):
            return before
        now = before.copy()
        now[[self._index[name] for name in phase.tools]] = isinstance(phase, GripPhase)
        return now

    def duration(self) -> float | None:
        """Length of the motion [s], or None where it depends on a force."""
        total = 0.0
        position, orientation = self._tools.position, self._tools.orientation
        for number in range(len(self._phases)):
            length = self._left(Progress(number), position, orientation)
            if math.isinf(length):
                return None
            way = self._way(number, length, position, orientation)
            position, orientation = _moved(way, position, orientation)
            total += length
        return total

    # ---- one phase

    def _left(self, progress: Progress, position: Floats, orientation: Floats) -> float:
        """Time until the phase ends, if no force ends it before [s]; inf where only a force can."""
        phase = self._phases[progress.phase]
        if isinstance(phase, HoldPhase):
            return max(0.0, phase.hold - progress.elapsed)
        if isinstance(phase, _HANDS):
            return max(0.0, (phase.grip if isinstance(phase, GripPhase) else phase.release) - progress.elapsed)
        if isinstance(phase, _WAY):
            return max(0.0, self._lengths[progress.phase] / phase.speed - progress.elapsed)
        bounds = [math.inf]
        if phase.until.compression is not None:
            grip = self._grips[progress.phase]
            way = grip.gap(position, orientation) - (1.0 - phase.until.compression) * grip.width
            bounds.append(max(0.0, way) / (2.0 * phase.close))
        if phase.until.time is not None:
            bounds.append(max(0.0, phase.until.time - progress.elapsed))
        return min(bounds)

    def _slack(self, number: int) -> float:
        """How early a phase that takes whole steps may end [s]: one that only stands ends with the nearest step."""
        phase = self._phases[number]
        if isinstance(phase, ClosePhase):
            return _ROUNDING * max(self._dt, self._grips[number].width / (2.0 * phase.close))
        return (_ROUNDING if isinstance(phase, _WAY) else 0.5) * self._dt

    def _waits(self, progress: Progress, way: Floats) -> bool:
        """Whether a phase waits for the next step: a force decides on it, hands open or close, or tools turn twice."""
        phase = self._phases[progress.phase]
        if isinstance(phase, TurnPhase) and way[:, 3:].any():
            return True
        return progress.phase in self._whole or isinstance(phase, _HANDS)

    def _way(self, number: int, duration: float, position: Floats, orientation: Floats) -> Floats:
        """What a phase does to the tools in a time [s], from poses (t, 3) [m], (t, 4): (t, 6) [m, rad]."""
        phase = self._phases[number]
        if isinstance(phase, MovePhase):
            return phase.speed * duration / self._lengths[number] * self._moves[number]
        way = np.zeros((len(position), 6))
        if isinstance(phase, ClosePhase):
            grip = self._grips[number]
            each = phase.close * duration * grip.axis_now(orientation)
            way[grip.first, :3] = each
            way[grip.second, :3] = -each
        elif isinstance(phase, TurnPhase):
            rotation = phase.speed * duration / self._lengths[number] * np.array(phase.turn)
            turn = quaternion_turning(rotation)
            tools = [self._index[name] for name in phase.tools]
            centre = position[tools].mean(axis=0) if phase.about is None else np.array(phase.about)
            for tool in tools:
                arm = position[tool] - centre
                way[tool, :3] = np.array(rotate(turn, *arm)) - arm
                way[tool, 3:] = rotation
        return way

    def _all_of(self, phase: MovePhase) -> Floats:
        """What a move does to the tools, as above."""
        way = np.zeros((len(self._index), 6))
        way[[self._index[name] for name in phase.tools], :3] = phase.move
        return way


def _ends_by_force(phase: Phase) -> bool:
    return isinstance(phase, ClosePhase) and phase.until.force is not None


def _moved(way: Floats, position: Floats, orientation: Floats) -> tuple[Floats, Floats]:
    """Poses (t, 3) [m], (t, 4) after a way (t, 6) [m, rad]."""
    turning = way[:, 3:].any(axis=1)
    if turning.any():
        orientation = orientation.copy()
        for tool in np.flatnonzero(turning):
            orientation[tool] = turned(quaternion_turning(way[tool, 3:]), orientation[tool])
    return position + way[:, :3], orientation
