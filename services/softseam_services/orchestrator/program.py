"""The motion of a scene: how far which tool moves in each step.

A phase that knows its own end, because only time or the tools' way decides it, ends within a step and the next takes
up the rest of it: what a step moves is the sum of both ways, and the poses at the end of a step are those of the exact
motion however long the steps are. Where a force decides (an end by force, a force held, a limit), whole steps belong to
one phase: the force is known after the step. Where it ends a phase, the tools go back to where it is (`force_search`).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import (
    ClosePhase,
    GripPhase,
    HoldPhase,
    MovePhase,
    OpenPhase,
    Phase,
    ReleasePhase,
    TurnPhase,
)
from softseam_services.body.body import SAME
from softseam_services.orchestrator.force_search import ForceSearch, is_near
from softseam_services.orchestrator.grip import Grip
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.unfinished import fell_short, left_out, turned_away, unreached
from softseam_services.shapes.turns import quaternion_turning, turned
from softseam_services.tools.kernels import rotate
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
_WAY, _HANDS = (MovePhase, TurnPhase), (GripPhase, ReleasePhase)
"""phases in which tools have a way to go, and in which they take or let go particles"""


class Progress(NamedTuple):
    """Where the motion stands: all that evolves."""

    phase: int = 0
    elapsed: float = 0.0
    """in this phase [s]"""
    search: ForceSearch = ForceSearch()
    """of the force that ends it"""


class Program:
    """Turns the scene's motion into what tools do, one step at a time.

    phases  of the scene
    dt      step [s]
    grips   of the closing phases
    driven  phases in which a drive has its say (see `Drives.phases`)
    """

    def __init__(
        self,
        phases: tuple[Phase, ...],
        dt: float,
        tools: ToolSet,
        grips: Grips,
        driven: Collection[int] = (),
    ) -> None:
        self._phases = phases
        self._dt = dt
        self._tools = tools
        self.grips = grips
        self._index = {name: i for i, name in enumerate(tools.names)}
        self._whole = {*driven, *self._ends()}
        """phases that take whole steps"""
        self._searches = {number: force for number, force in self._ends().items() if number not in driven}
        """forces that end phases [N], where no drive has its say"""
        self._ramps = {number: phase.ramp for number, phase in enumerate(phases) if isinstance(phase, _WAY)}
        """how far moves [m] and turns [rad] are after which time, by phase"""
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

    def closes_next(self, progress: Progress, position: Floats, orientation: Floats) -> bool:
        """Whether tools at these poses begin to close in the coming step, after a phase that is not over yet."""
        if self.done(progress):
            return False
        left, later = self._left(progress, position, orientation), progress.phase + 1
        while left < self._dt and later < len(self._phases):
            if isinstance(self._phases[later], ClosePhase):
                return True
            left += self._left(Progress(later), position, orientation)
            later += 1
        return False

    def closing_force(self, progress: Progress, wrench: Floats, orientation: Floats) -> float:
        """Mean force on the tools that close in this phase [N], of wrenches (t, 6) [N, N m]; 0 in others."""
        grip = self.grips.of(progress.phase)
        return 0.0 if grip is None else grip.force(wrench, orientation)

    def met(self, position: Floats, orientation: Floats) -> str:
        """The gripping tools where nothing is left between them, in words; '' before, and without a grip."""
        grip = self.grips.first
        if grip is None or grip.gap(position, orientation) > 0.0:
            return ""
        return f"{' and '.join(self._tools.names[tool] for tool in grip.tools)} have met"

    def step(self, progress: Progress, position: Floats, orientation: Floats) -> tuple[Floats, Progress | None]:
        """What the tools do in the coming step, from poses (t, 3) [m], (t, 4).

        Returns their velocities and angular velocities (t, 6) [m/s, rad/s], and the progress after the step; None where
        a force decides that (see `after`). Raises StepFailed where tools have met that nothing else would stop.
        """
        if self.done(progress):
            return np.zeros((len(position), 6)), progress
        if progress.elapsed == 0.0:
            self.grips.begin(progress.phase, position, orientation)
        self._demand_gap(progress, position, orientation)
        if progress.phase in self._whole:
            duration = min(self._dt, self._left(progress, position, orientation))
            if progress.phase in self._searches:
                duration = min(duration, self._to_force(progress, position, orientation))
            return self._way(progress, duration, position, orientation) / self._dt, None
        rest, tick = self._dt, SAME * self._dt
        if self._left(progress, position, orientation) > rest + tick:
            way = self._way(progress, rest, position, orientation)
            return way / self._dt, Progress(progress.phase, progress.elapsed + rest)
        way = np.zeros((len(position), 6))
        while rest > tick and not self.done(progress):
            if rest < self._dt and self._waits(progress, way):
                break
            left = self._left(progress, position, orientation)
            duration = min(left, rest)
            part = self._way(progress, duration, position, orientation)
            way += part
            rest -= duration
            if left > duration + tick:
                progress = Progress(progress.phase, progress.elapsed + duration)
                break
            progress = Progress(progress.phase + 1)
            position, orientation = _moved(part, position, orientation)
            if rest > tick and not (self.done(progress) or self._waits(progress, way)):
                self.grips.begin(progress.phase, position, orientation)
        return way / self._dt, progress

    def after(self, progress: Progress, position: Floats, orientation: Floats, grip_force: float) -> Progress:
        """Progress after a step that a force decided on; it ended with these tool poses and this mean force [N]."""
        number, elapsed = progress.phase, progress.elapsed + self._dt
        there = Progress(number, elapsed)
        phase = self._phases[number]
        ended = self._left(there, position, orientation) <= self._slack(number)
        if number in self._searches:
            wanted, gap = self._searches[number], self._grip(number).gap(position, orientation)
            assert isinstance(phase, ClosePhase)
            before = progress.search
            if progress.elapsed == 0.0:
                before = ForceSearch(gap + 2.0 * phase.close * self._dt)
            ended = ended or before.ended(grip_force, wanted)
            there = Progress(number, elapsed, before.after(gap, grip_force, wanted))
        elif isinstance(phase, ClosePhase) and phase.until.force is not None:
            ended = ended or grip_force >= phase.until.force
        return Progress(number + 1) if ended else there

    def missed(self, progress: Progress, force: float) -> str:
        """What to say of a phase that ends past the force [N] that was to end it; '' of others. Progress is that before
        its last step."""
        wanted = self._searches.get(progress.phase)
        if wanted is None or is_near(force, wanted) or not (progress.search.passed or force > wanted):
            return ""  # one that ends by its time before it ever had the force ends as it was asked to
        return (
            f"motion[{progress.phase}] ends with {force:.3g} N, not with the {wanted:g} N of until.force: shorten the "
            "step, close more slowly, or leave it more of until.time"
        )

    def unreached(self, progress: Progress, position: Floats, orientation: Floats, force: float) -> str:
        """What to say of a phase that its time ended before its tools, at these poses and with this mean force [N], got
        where they were to; '' of others. Progress is that before its last step."""
        phase, grip = self._phases[progress.phase], self.grips.of(progress.phase)
        if grip is None or not isinstance(phase, ClosePhase) or phase.until.time is None:
            return ""
        if progress.elapsed + self._dt < phase.until.time * (1.0 - SAME):
            return ""  # something else ended it
        return unreached(progress.phase, phase, grip.compression(position, orientation), force)

    def turned_away(self, number: int, position: Floats, orientation: Floats) -> str:
        """What to say of a phase that ended at its compression with tools at these poses, where the body turned between
        them instead; '' of others."""
        phase = self._phases[number]
        if not isinstance(phase, ClosePhase) or phase.until.compression is None:
            return ""
        told = self._grip(number).compression(position, orientation)
        if told < phase.until.compression * (1.0 - SAME):
            return ""
        return turned_away(number, phase, told, self.grips.as_it_stands(number, position, orientation))

    def fell_short(self, number: int, short: Floats) -> str:
        """What to say of tools that a drive kept from some of their way in a phase (t, 3) [m]; '' of none."""
        phase = self._phases[number]
        if isinstance(phase, MovePhase):
            ordered = {self._index[name]: np.array(way) for name, way in phase.ways.items() if any(way)}
        else:
            return ""
        return fell_short(number, {self._tools.names[t]: (way, -short[t]) for t, way in ordered.items()})

    def left_out(self, progress: Progress, position: Floats, orientation: Floats, duration: float) -> str:
        """What to say of a motion that stands here when the duration [s] of a run is over; '' where it is over, too."""
        for number in range(progress.phase, len(self._phases)):
            begun = number == progress.phase
            at = progress if begun else Progress(number)
            if self._left(at, position, orientation) > 0.5 * self._dt:
                return left_out(self._phases, number, begun and progress.elapsed > 0.0, duration)
        return ""

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
        planned = Program(self._phases, self._dt, self._tools, self.grips.fresh())
        position, orientation = self._tools.position, self._tools.orientation
        for number in range(len(self._phases)):
            planned.grips.begin(number, position, orientation)
            length = planned._left(Progress(number), position, orientation)
            if math.isinf(length):
                return None
            way = planned._way(Progress(number), length, position, orientation)
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
            return max(0.0, self._ramps[progress.phase].time - progress.elapsed)
        if isinstance(phase, OpenPhase):
            if phase.until is not None:
                return max(0.0, phase.until.way / phase.open - progress.elapsed)
            grip = self._grip(progress.phase)
            return max(0.0, grip.spread_begun - grip.spread(position, orientation)) / (grip.rate * phase.open)
        bounds = [math.inf]
        if phase.until.compression is not None:
            grip = self._grip(progress.phase)
            way = (phase.until.compression - grip.compression(position, orientation)) * grip.width
            bounds.append(max(0.0, way) / (grip.rate * phase.close) if np.isfinite(grip.touch) else math.inf)
        if phase.until.time is not None:
            bounds.append(max(0.0, phase.until.time - progress.elapsed))
        return min(bounds)

    def _demand_gap(self, progress: Progress, position: Floats, orientation: Floats) -> None:
        """Raise StepFailed where a phase that only a force ends has its tools where nothing is left between them."""
        phase, number = self._phases[progress.phase], progress.phase
        if not isinstance(phase, ClosePhase) or phase.until.time is not None:
            return
        grip, until = self._grip(number), phase.until
        if until.compression is not None and np.isfinite(grip.touch):
            return
        if grip.gap(position, orientation) <= 0.0:
            names = " and ".join(repr(name) for name in phase.tools)
            before, key = (
                (f"they squeezed the body by {until.compression:g}, which they pass", "until.compression")
                if until.force is None
                else (f"they pressed with {until.force:g} N", "until.force")
            )
            raise StepFailed(
                f"motion[{number}]: {names} have met before {before}: ask for less in {key}, or give until.time as well"
            )

    def _to_force(self, progress: Progress, position: Floats, orientation: Floats) -> float:
        """Time that the tools take to where the force is looked for next, negative for back, a step at most [s]."""
        phase, search = self._phases[progress.phase], progress.search
        assert isinstance(phase, ClosePhase)
        if search.stands:
            return 0.0
        grip = self._grip(progress.phase)
        way = grip.gap(position, orientation) - search.to(self._searches[progress.phase])
        return min(self._dt, max(-self._dt, way / (grip.rate * phase.close)))

    def _grip(self, number: int) -> Grip:
        """Of a phase that closes or opens."""
        grip = self.grips.of(number)
        assert grip is not None
        return grip

    def _ends(self) -> dict[int, float]:
        """Forces that end closing phases [N], by phase."""
        closing = ((n, phase) for n, phase in enumerate(self._phases) if isinstance(phase, ClosePhase))
        return {n: phase.until.force for n, phase in closing if phase.until.force is not None}

    def _slack(self, number: int) -> float:
        """How early a phase that takes whole steps may end [s]: one that only stands ends with the nearest step."""
        phase = self._phases[number]
        if isinstance(phase, ClosePhase):
            return SAME * max(self._dt, self._grip(number).width / (2.0 * phase.close))
        return (SAME if isinstance(phase, (*_WAY, OpenPhase)) else 0.5) * self._dt

    def _waits(self, progress: Progress, way: Floats) -> bool:
        """Whether a phase waits for the next step: a force decides on it, hands open or close, or tools turn twice."""
        phase = self._phases[progress.phase]
        if isinstance(phase, TurnPhase) and way[:, 3:].any():
            return True
        return progress.phase in self._whole or isinstance(phase, _HANDS)

    def _way(self, progress: Progress, duration: float, position: Floats, orientation: Floats) -> Floats:
        """What a phase does to the tools in a time [s], from poses (t, 3) [m], (t, 4): (t, 6) [m, rad]."""
        number, phase = progress.phase, self._phases[progress.phase]
        if isinstance(phase, MovePhase):
            return self._share(progress, duration) * self._moves[number]
        way = np.zeros((len(position), 6))
        if isinstance(phase, ClosePhase | OpenPhase):
            grip = self._grip(number)
            speed = phase.close if isinstance(phase, ClosePhase) else -phase.open
            way[list(grip.tools), :3] = speed * duration * grip.inward_now(orientation)
        elif isinstance(phase, TurnPhase):
            rotation = self._share(progress, duration) * np.array(phase.turn)
            turn = quaternion_turning(rotation)
            tools = [self._index[name] for name in phase.tools]
            centre = position[tools].mean(axis=0) if phase.about is None else np.array(phase.about)
            for tool in tools:
                arm = position[tool] - centre
                way[tool, :3] = np.array(rotate(turn, *arm)) - arm
                way[tool, 3:] = rotation
        return way

    def _share(self, progress: Progress, duration: float) -> float:
        """Of a move or turn, what of it is done in a time [s]."""
        ramp = self._ramps[progress.phase]
        return (ramp.gone(progress.elapsed + duration) - ramp.gone(progress.elapsed)) / ramp.length

    def _all_of(self, phase: MovePhase) -> Floats:
        """What a move does to the tools, as above."""
        way = np.zeros((len(self._index), 6))
        way[[self._index[name] for name in phase.ways], :3] = list(phase.ways.values())
        return way


def _moved(way: Floats, position: Floats, orientation: Floats) -> tuple[Floats, Floats]:
    """Poses (t, 3) [m], (t, 4) after a way (t, 6) [m, rad]."""
    turning = way[:, 3:].any(axis=1)
    if turning.any():
        orientation = orientation.copy()
        for tool in np.flatnonzero(turning):
            orientation[tool] = turned(way[tool, 3:], orientation[tool])
    return position + way[:, :3], orientation
