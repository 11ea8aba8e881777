"""What follows a step that is taken: it is measured, booked, judged, the cuts adapt to it, and what is odd is said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.session import ErrorEstimate, Frame
from softseam_services.orchestrator.bodies import Bodies
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.energy_balance import Entry
from softseam_services.orchestrator.moving_tools import Move, Moved, MovingTools
from softseam_services.orchestrator.reports import work_of_drive
from softseam_services.orchestrator.solutions import Solutions
from softseam_services.orchestrator.step_warnings import Tell, ToolWarnings
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost
from softseam_services.orchestrator.whereabouts import LOOK_EVERY

T = TypeVar("T")
Floats = NDArray[np.float64]

CHECKPOINT_STEPS = 50


class Taken(NamedTuple):
    """A step, as it was taken."""

    solutions: Solutions
    wrenches: Mapping[str, Floats]
    """of each body that is in no pile, on the tools (t, 6) [N, N m]"""
    move: Move
    moved: Moved
    ongoing: bool
    """whether the run went on as it began"""
    done: bool
    """and is over as it ends"""


class AfterStep:
    """The stages of a step's recipe after it is taken.

    duration  of the scene [s]; None where its motion says when it ends
    say       receives kind and text of every event
    """

    def __init__(self, bodies: Bodies, moving: MovingTools, clock: Clock, duration: float | None, say: Tell) -> None:
        self._bodies, self._moving, self._clock, self._duration, self._say = bodies, moving, clock, duration, say
        self._warnings = ToolWarnings(say)

    def forget(self) -> None:
        """The last step is another's."""
        self._warnings.forget()
        self._bodies.overlaps.forget()
        for body in self._bodies.named.values():
            body.warnings.forget()
            body.whereabouts.forget()
            body.creep.forget()
            body.pierced.forget()
            body.breaking.forget()
            body.losses.forget()

    def try_to(self, act: Callable[[], T]) -> T | None:
        """What follows a step that is taken: a participant that is lost in it is an event, and the step counts."""
        try:
            return act()
        except (ParticipantLost, ParticipantFailed) as error:
            step = self._clock.step - 1
            self._say("lost", f"step {step} is taken, but what follows it was not done: {error}")
            return None

    def measure(self, taken: Taken, frames: Mapping[str, Frame]) -> dict[str, float]:
        """Quantities of all bodies."""
        found: dict[str, float] = {}
        for name, body in self._bodies.apart.items():
            replies, frame = taken.solutions[name].replies, frames.get(name)
            found |= body.measure(replies, taken.wrenches[name], *self._moving.poses, frame, self._moving.lifting)
        for pile in self._bodies.piles:
            found |= pile.measure(*self._moving.poses, frames, self._moving.lifting)
        return found

    def book(self, taken: Taken, dt: float) -> dict[str, Entry]:
        """Enter a step of dt [s] into the balance of each body and pile."""
        entries = {}
        for pile in self._bodies.piles:
            entries[pile.pile.part] = pile.book(self._clock.step - 1, taken.move.command, dt)
        for name, body in self._bodies.apart.items():
            drive_work = work_of_drive(taken.wrenches[name], taken.move.command, dt)
            entries[name] = body.book(taken.solutions[name].replies, taken.solutions[name], drive_work)
        return entries

    def adapt(self, taken: Taken) -> bool:
        """Let the cuts follow the step; whether one did. Every so often parts keep what they are recovered from."""
        switched = False
        awake = self._bodies.awake
        for name, body in (self._bodies.named if self._clock.step == 1 else self._bodies.apart).items():
            if name not in awake:
                continue
            energies = self.try_to(partial(body.follow, taken.solutions[name].replies, taken.move.motion))
            if energies is not None:
                body.balance.switched(energies)
                switched = True
        if self._clock.step % CHECKPOINT_STEPS == 0:
            for name, body in self._bodies.apart.items():
                if name in awake:
                    self.try_to(body.participants.snapshot)
            for pile in self._bodies.piles:
                if not pile.pile.sleepers.all():
                    self.try_to(pile.pile.snapshot)
            self._bodies.forget_sent()
        return switched

    def judge(self, taken: Taken) -> dict[str, ErrorEstimate]:
        """How far the run may be off, by body, where the scene's own motion ends; looked at as its phases end."""
        if not taken.ongoing or taken.move.by_hand or not (taken.moved.phase_ends or taken.done):
            return {}
        self._bodies.store()
        found = {}
        for name, body in self._bodies.named.items():
            replies, at = taken.solutions[name].replies, self._moving.poses
            estimate = self.try_to(partial(body.judge, replies, *at, taken.done))
            if estimate is not None:
                found[name] = estimate
        return found

    def warn(self, taken: Taken, estimates: Mapping[str, ErrorEstimate]) -> None:
        """Tell what of the step is worth an event."""
        at, move, moved = self._clock.step - 1, taken.move, taken.moved
        looks = taken.done or self._clock.step % LOOK_EVERY == 0
        for pile in self._bodies.piles:
            pile.notify(at, estimates)
            if looks:
                self.try_to(partial(pile.watch, at, *self._moving.poses))
        for name, body in self._bodies.apart.items():
            replies = taken.solutions[name].replies
            body.warnings.follow(at, replies, body.balance.raised, estimates.get(name))
            if looks:
                self.try_to(partial(body.watch, at, replies, taken.wrenches[name], *self._moving.poses))
        overlaps = self._bodies.overlaps
        if looks and overlaps.possible:
            overlaps.look(at, np.array([taken.solutions.bounds(name) for name in self._bodies.named]))
        if moved.missed:
            self._say("force", f"step {at}: {moved.missed}")
        if moved.unreached:
            self._say("not_done", f"step {at}: {moved.unreached}")
        if moved.phase_ends and (turned := self.try_to(partial(self._moving.turned_away, moved.ended))):
            self._say("not_done", f"step {at}: {turned}")
        self._warnings.follow(at, move.too_far, self._moving.met)
        if taken.done and taken.ongoing:
            self._warn_of_left(move.by_hand)

    def _warn_of_left(self, by_hand: bool) -> None:
        """Tell, as a run ends, what the scene asks for that was not done."""
        for body in self._bodies.named.values():
            body.regions.tell_unmet()
        if self._duration is not None and not by_hand and (left := self._moving.left_out(self._duration)):
            self._say("not_done", left)
