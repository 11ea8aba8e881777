"""The tools while they move: by the scene's motion, whose progress is kept here, or by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import ToolMotion
from softseam_protocol.scene.command import Command
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.archive import Arrays, floats
from softseam_services.orchestrator.drives import Drives
from softseam_services.orchestrator.force_search import ForceSearch
from softseam_services.orchestrator.grips import Grips, Placed
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.tool_set import ToolSet
from softseam_services.tools.travel import beyond_middle

Floats = NDArray[np.float64]


class Move(NamedTuple):
    """What the tools are to do in a step."""

    command: Floats
    """(t, 6) [m/s, rad/s]"""
    motion: ToolMotion
    gripping: NDArray[np.int8]
    """1 for tools that hold particles (t,)"""
    after: Progress | None
    """of the motion; None where a force decides that"""
    by_hand: bool
    too_far: Sequence[str]
    """tools that move half their thickness"""


class Moved(NamedTuple):
    """How the motion stands after a step."""

    phase: int
    """in which the step ends, or -1"""
    phase_ends: bool
    ended: int
    """which phase it was"""
    missed: str
    """what to say of a phase that ends off its force; '' of others"""
    unreached: str
    """what to say of one that its time ended before its tools got where they were to"""


class MovingTools:
    """Poses of the tools, what they do next, and what they felt.

    bodies  that they touch
    placed  where each stands
    """

    def __init__(self, scene: Scene, tools: ToolSet, bodies: Sequence[AnyBody], placed: Placed | None = None) -> None:
        self.tools, self._dt = tools, scene.step
        grips = Grips(scene, tools, bodies, placed)
        self._drives = Drives(scene, bodies, grips)
        self.program = Program(scene.motion, scene.step, tools, grips, self._drives.phases)
        """the scene's motion"""
        self.reset()

    def reset(self) -> None:
        """Back to the start of the scene."""
        self._progress = Progress()
        self.program.grips.reset()
        self._drives.reset()
        self.position = self.tools.position.copy()
        """(t, 3) [m]"""
        self.orientation = self.tools.orientation.copy()
        """unit quaternions w, x, y, z (t, 4)"""
        self._gripping = np.zeros(len(self.tools.names), dtype=np.int8)
        self.lifting = False
        """whether a tool has risen that touched a body"""
        self._ahead: Move | None = None  # after the step at hand, and
        self._promised: Move | None = None  # after the one that was taken

    @property
    def poses(self) -> tuple[Floats, Floats]:
        """Positions and orientations."""
        return self.position, self.orientation

    @property
    def done(self) -> bool:
        """Whether the scene's motion is over."""
        return self.program.done(self._progress)

    @property
    def met(self) -> str:
        """The closing tools where nothing is left between them, in words; '' before."""
        return self.program.met(*self.poses)

    def next(self, velocities: Command | None) -> Move:
        """What the tools do in the coming step: with these velocities (see `Simulation.step`), or as the scene says.

        Raises StepFailed where closing tools have met that nothing else would stop.
        """
        progress: Progress | None
        promised, self._promised, self._ahead = self._promised, None, None
        if promised is not None and velocities is None:
            return promised
        if velocities is None:
            command, progress = self.program.step(self._progress, self.position, self.orientation)
            self._drives.apply(command, self._progress, self.orientation)
            gripping = self.program.gripping(self._progress, self._gripping)
        else:
            command, gripping = self._commanded(velocities)
            progress = self._progress
        return self._move(command, gripping, progress, self.poses, velocities is not None)

    def _move(
        self,
        command: Floats,
        gripping: NDArray[np.int8],
        progress: Progress | None,
        poses: tuple[Floats, Floats],
        by_hand: bool = False,
    ) -> Move:
        motion = tool_motion(*poses, command, self._dt)
        if any(gripping.tolist()):
            motion = replace(motion, gripping=gripping.copy())
        return Move(command, motion, gripping, progress, by_hand, beyond_middle(self.tools, motion))

    def ahead(self, move: Move) -> ToolMotion | None:
        """How the tools move in the step after `move`; None where that depends on what they feel, or a phase ends.

        `next` tells the same then, where the scene's motion is followed.
        """
        after = move.after
        if move.by_hand or after is None or after.phase > self._progress.phase:
            return None
        position, orientation = move.motion.position_next, move.motion.orientation_next
        if self.program.closes_next(after, position, orientation):
            return None  # it is looked then where the body stands
        command, progress = self.program.step(after, position, orientation)
        gripping = self.program.gripping(after, move.gripping)
        self._ahead = self._move(command, gripping, progress, (position, orientation))
        return self._ahead.motion

    def take(self, move: Move, wrench: Floats) -> Moved:
        """The step was taken, and all bodies did this to the tools (t, 6) [N, N m]."""
        self.position, self.orientation = move.motion.position_next, move.motion.orientation_next
        self._gripping = move.gripping
        self._promised, self._ahead = self._ahead, None
        if not move.by_hand:
            self._drives.measured(wrench, self.orientation)
        self.program.grips.step(wrench, *self.poses, move.by_hand)
        before, after, missed, unreached = self._progress, move.after, "", ""
        closing = self.program.closing_force(before, wrench, self.orientation)
        if after is None:
            after = self.program.after(before, self.position, self.orientation, closing)
            missed = self.program.missed(before, closing) if after.phase > before.phase else ""
        if after.phase > before.phase:
            if not missed:
                unreached = self.program.unreached(before, self.position, self.orientation, closing)
            unreached = unreached or self.program.fell_short(before.phase, self._drives.short)
            self._drives.short[:] = 0.0
        self._progress = after
        self.lifting = self.lifting or _rises(move.command, wrench)
        ends = after.phase > before.phase
        return Moved(self.program.phase_of(before, after), ends, before.phase, missed, unreached)

    def turned_away(self, phase: int) -> str:
        """What to say of a body that turned between tools in a phase that has just ended; '' of others."""
        return self.program.turned_away(phase, *self.poses)

    def left_out(self, duration: float) -> str:
        """What to say of the motion as it stands when the duration [s] of a run is over; '' where it is over, too."""
        return self.program.left_out(self._progress, self.position, self.orientation, duration)

    # ---- snapshots

    def save(self) -> Arrays:
        """All that evolves."""
        progress = self._progress
        return {
            "progress": np.array([progress.phase, progress.elapsed, self.lifting, *progress.search.to_list()]),
            "position": self.position,
            "orientation": self.orientation,
            "drives": self._drives.save(),
            "gripping": self._gripping,
            "grips": self.program.grips.save(),
        }

    def load(self, saved: Arrays) -> None:
        """Continue from `save`. Raises KeyError or ValueError, and changes nothing, where that is of other tools."""
        now = self.save()
        known = floats({name: saved[name].reshape(array.shape) for name, array in now.items()})
        phase, elapsed, lifting, *search = known["progress"].tolist()
        self.program.grips.load(known["grips"])
        self._progress = Progress(int(phase), elapsed, ForceSearch.from_list(search))
        self.lifting, self.position, self.orientation = bool(lifting), known["position"], known["orientation"]
        self._gripping = known["gripping"].astype(np.int8)
        self._drives.load(known["drives"])
        self._ahead = self._promised = None

    # ---- by hand

    def _commanded(self, velocities: Command) -> tuple[Floats, NDArray[np.int8]]:
        """What tools do (t, 6) [m/s, rad/s], and 1 for those that hold particles (t,)."""
        command = np.zeros((len(self.tools.names), 6))
        gripping = self._gripping.copy()
        for name, velocity in velocities.items():
            tool = self.tools.names.index(name)
            command[tool, : len(velocity[:6])] = velocity[:6]
            if len(velocity) == 7:
                gripping[tool] = velocity[6] != 0.0
        return command, gripping


def _rises(command: Floats, wrench: Floats) -> bool:
    """Whether a tool rises, by velocities (t, 6) [m/s, rad/s], that felt a body, by wrenches (t, 6) [N, N m]."""
    return any(
        up > 0.0 and any(force) for up, force in zip(command[:, 2].tolist(), wrench[:, :3].tolist(), strict=True)
    )
