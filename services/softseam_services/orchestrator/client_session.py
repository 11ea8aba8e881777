"""One client's session in the orchestrator: its simulation, its publications, its last answer."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from softseam_protocol.bus.client import Bus
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Begin
from softseam_protocol.messages.session import (
    ErrorEstimate,
    Event,
    Frame,
    Load,
    Observation,
    Observations,
    Open,
    Reset,
    Save,
    Saved,
    Step,
    StepReport,
)
from softseam_protocol.scene.command import Command, checked_command
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode
from softseam_services.orchestrator.after_step import CHECKPOINT_STEPS
from softseam_services.orchestrator.bus_transport import BusTransport
from softseam_services.orchestrator.client_view import FAILURES, counted, observation, restore, snapshot
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.kept_session import SPELL, Asked, Base, Entry, KeptSession
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.recorder_feed import RecorderFeed
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost
from softseam_services.recorder.begin import begin

FRAME_PERIOD = 0.04
"""simulated time between recorded frames [s]"""
_TURN = 0.1
"""wall time after which a request for each step's observation is answered [s]: its asker shows progress"""
_MOST_EVENTS = 1000


class Stopped(RuntimeError):
    """The session is being closed, or the service stopped, in the middle of a request."""


@dataclass
class Answer:
    """The last request of a session and what it was answered."""

    kind: type
    number: int
    payload: bytes


class ClientSession:
    """Runs one session. One request at a time: whoever calls holds `lock`."""

    def __init__(
        self,
        bus: Bus,
        keys: Keys,
        session: str,
        stopping: Callable[[], bool],
        kept: KeptSession,
        routes: Mapping[str, str] | None = None,
    ) -> None:
        self.kept = kept
        self.lock = threading.Lock()
        self.answer: Answer | None = None
        self.cancelled = False
        self.used = time.monotonic()
        """when the last request ended; now, while one is at work"""
        self.steps = 0
        """steps taken, for the heartbeat"""
        self._bus, self._keys, self._session, self._routes = bus, keys, session, routes
        self._stopping = stopping
        self._simulation: Simulation | None = None
        self._last: StepReport | None = None
        self._events: list[Event] = []
        self._trouble: StepFailed | ParticipantFailed | ParticipantLost | None = None
        """what ended the last request for each step's observation; the next one is told"""
        self._from = 0
        """steps before those that this orchestrator knows"""
        self._begun = (0, 0)
        """number of a request in the middle of which it was taken up, and how many of its steps were taken before"""
        self._unkept = 0
        """steps of the last request that the base of what is kept lacks"""

    @property
    def opened(self) -> bool:
        return self._simulation is not None

    @property
    def simulation(self) -> Simulation:
        assert self._simulation is not None
        return self._simulation

    def open(self, request: Open, epoch: int = -1) -> Observation:
        """Build the simulation and configure its participants, who were asked nothing of later epochs."""
        self._opened, bundle, record = request, request.bundle, request.record
        self._bundle, self._record = bundle, record
        clock = Clock(self._session, 1.0, epoch)
        self._transport = BusTransport(self._bus, self._keys, services=self._routes)
        self._feed = RecorderFeed(self._bus, self._keys, self._session, record=record, warn=self._warn)
        try:
            self._simulation = Simulation(bundle, self._transport, emit=self._emit, clock=clock)
            self._seed = self._simulation.scene.seed
            return self._observe(fields=True)
        except BaseException:  # nothing is kept back: whatever ends this leaves no session, feed or asker behind
            self._simulation = None
            self._events.clear()
            self._feed.close()
            self._transport.close()
            raise

    def reset(self, seed: int, bundle: Bundle | None = None) -> Observation:
        """Begin the scene anew, or another one in its place."""
        self._feed.end("reset")
        self._last, self._trouble, self.steps, self._from = None, None, 0, 0
        if bundle is None:
            self.simulation.reset(seed)
        else:
            self._simulation, self._bundle = self.simulation.with_scene(bundle, seed), bundle
        self._seed = seed
        self._events.clear()
        self._feed.begin(self._begin())
        seen = self._observe(fields=True)
        for frame in seen.frames.values():
            self._feed.publish(frame)
        return seen

    def step(self, request: Step) -> Observation | Observations:
        """Take `count` steps, fewer where the scene's motion ends before."""
        trouble, self._trouble = self._trouble, None
        self._unkept = 0
        if trouble is not None:
            raise trouble
        return self._each(request) if request.each else self._steps(request)

    def _steps(self, request: Step, again: int | None = None) -> Observation:
        """again: how many were taken of a request that is done once more."""
        commands, number = self._commands(request), request.header.exchange
        before = self._begun[1] if self._begun[0] == number else 0
        for remaining in range(request.count - before if again is None else again, 0, -1):
            if again is None:
                self._heed()
            fields = request.fields and (request.each or remaining == 1)
            try:
                if not self._step(commands, fields, more=remaining > 1):
                    break
            except (StepFailed, ParticipantFailed, ParticipantLost) as error:
                raise counted(error, request.count - remaining, request.count) from error.__cause__
            if again is None and self._due and (base := self._base(number, request.count - remaining + 1)):
                self._keep(base)
                self._unkept = 0
        return self._observe(request.fields, taken=True)

    def _each(self, request: Step) -> Observations:
        """Take as many steps as fit into a turn, one at least."""
        began = time.monotonic()
        taken: list[Observation] = []
        commands = self._commands(request)
        more = True
        while more:
            self._heed()
            more = len(taken) + 1 < request.count and time.monotonic() - began < _TURN
            try:
                if not self._step(commands, request.fields, more):
                    break
            except (StepFailed, ParticipantFailed, ParticipantLost) as error:
                if not taken:
                    raise
                self._trouble = error
                break
            taken.append(self._observe(request.fields, taken=True))
            more = more and not self._due
        return Observations(request.header, taken or [self._observe(request.fields, taken=True)])

    def _heed(self) -> None:
        if self.cancelled or self._stopping():
            raise Stopped("the session is being closed: the steps left were not taken")

    def _commands(self, request: Step) -> Command | None:
        """Velocities of tools; None for the scene's motion. Raises BadCommand."""
        if request.program:
            return None
        still, grips = np.zeros(3), request.gripping
        return checked_command(
            {
                name: [
                    *request.velocities.get(name, still),
                    *request.turning.get(name, still),
                    *([grips[name]] if name in grips else []),
                ]
                for name in (request.velocities | request.turning | grips)
            },
            self.simulation.scene,
        )

    def _step(self, commands: Command | None, fields: bool, more: bool) -> bool:
        """Take a step with these velocities; None follows the scene's motion, unless that is over.

        more: another step of the same request follows.
        """
        if not self._feed.begun:
            self._feed.begin(self._begin())
        if commands is None and self.simulation.done:
            return False
        due = self._record and (self.steps + 1) % max(1, round(FRAME_PERIOD / self.simulation.scene.step)) == 0
        self._last = self.simulation.step(commands, fields=due or fields, more=more and commands is None)
        self.steps += 1
        self._unkept += 1
        self.used = time.monotonic()
        return True

    def save(self) -> bytes:
        return snapshot(self.simulation, self._last)

    def load(self, state: bytes) -> Observation:
        self._last, self._trouble = restore(self.simulation, state), None
        self._warn("restored", f"the state of step {round(self.simulation.time / self.simulation.scene.step)} is back")
        return self._observe(fields=True)

    def estimate(self) -> ErrorEstimate | None:
        return self.simulation.estimate()

    def close(self, reason: str) -> None:
        """End the recording, release the participants."""
        if self._simulation is None:
            return
        simulation, self._simulation = self._simulation, None
        try:
            self._tell_bus_times()
            self._feed.end(reason)
        finally:
            self._feed.close()
            simulation.close()

    # ---- outliving the orchestrator

    def note(self, request: Asked, payload: bytes) -> None:
        """Keep what was asked, before it is answered by `payload`; without one, of a request that failed."""
        base, entry = None, Entry(request, answer=payload)
        if isinstance(request, Open):
            self._keep(self._based(b""))
            return
        if isinstance(request, Reset):
            base, entry = self._based(b""), Entry(replace(request, bundle=None))
        elif isinstance(request, Load):
            base, entry = self._based(request.state), Entry(replace(request, state=b""), answer=payload)
        elif isinstance(request, Save):
            base = self._based(decode(payload, Saved).state)
        elif isinstance(request, Step):
            base = self._base() if request.each and self._due else None
            taken = self._unkept if base is None else 0
            # how many steps fit into an answer of each of them is a matter of time
            entry = Entry(request, taken, not payload, payload if request.each else b"")
            if not payload and not taken:
                return
        self._keep(base, entry)

    def take_up(self) -> None:
        """Be where the session was when its orchestrator was lost.

        Raises Damaged where that is not known any more, and what opening, loading and stepping do.
        """
        base, entries = self.kept.read()
        epoch = time.time_ns()  # later than all of the orchestrator that is lost: what that one asked is refused
        self._answered(base.opened, encode(self.open(base.opened, epoch)))
        try:
            self._seed = base.seed
            if base.state:
                self._last, self.steps = restore(self.simulation, base.state), base.steps
                self._from = round(self.simulation.time / self.simulation.scene.step)
                self._begun = base.number, base.taken
                self._feed.begin(self._begin())
            for entry in entries:
                self._again(entry)
        except BaseException:
            self.close("it could not be taken up")
            raise
        self._keep(base, *entries)
        self._warn("restored", f"the orchestrator was lost; another one goes on after step {self.steps}")

    def _again(self, entry: Entry) -> None:
        """Do once more what was asked of the orchestrator that is lost."""
        request, answer, self._begun = entry.request, entry.answer, (0, 0)
        if isinstance(request, Step):
            seen = self._steps(request, entry.taken)
            answer = answer or encode(seen)
        elif isinstance(request, Reset):
            answer = encode(self.reset(request.seed))
        if not entry.failed:
            self._answered(request, answer)

    def _answered(self, request: Asked, payload: bytes) -> None:
        self.answer = Answer(type(request), request.header.exchange, payload)

    @property
    def _due(self) -> bool:
        """Whether a state is to be kept: where participants keep theirs anyway, as what follows a state that is kept
        elsewhere may have other last bits."""
        at = round(self.simulation.time / self.simulation.scene.step)
        return at % CHECKPOINT_STEPS == 0 and time.monotonic() - self.kept.since >= SPELL

    def _base(self, number: int = 0, taken: int = 0) -> Base | None:
        """The session as it stands, after some steps of a request; None where participants are lost."""
        try:
            return self._based(self.save(), number, taken)
        except FAILURES:
            return None

    def _based(self, state: bytes, number: int = 0, taken: int = 0) -> Base:
        opened = replace(self._opened, bundle=self._bundle)
        return Base(opened, self._seed, self.steps, number, taken, state)

    def _keep(self, base: Base | None, *entries: Entry) -> None:
        try:
            self.kept.keep(base, *entries)
        except OSError as error:
            why = error.strerror or error
            self._warn("kept", f"the session would end with its orchestrator: it is not kept ({why})")

    # ---- small parts

    def _begin(self) -> Begin:
        bodies = {name: one.body for name, one in self.simulation.bodies.items()}
        found = begin(self._bundle, bodies, self.simulation.tools, self._session, self._seed)
        at = self._from * self.simulation.scene.step
        return replace(found, header=replace(found.header, step=self._from, time=at))

    def _observe(self, fields: bool, taken: bool = False) -> Observation:
        simulation, events = self.simulation, self._events
        return observation(simulation, self._last, fields=fields, taken=taken, events=events, session=self._session)

    def _emit(self, message: StepReport | Frame | Event) -> None:
        if isinstance(message, Event):
            self._events.append(message)
            del self._events[:-_MOST_EVENTS]
        self._feed.publish(message)

    def _warn(self, kind: str, message: str) -> None:
        header = Header(SCHEMA_VERSION, self._session, "", 0, 0, 0, 0.0) if self._last is None else self._last.header
        self._emit(Event(header, EventKind(kind), message))

    def _tell_bus_times(self) -> None:
        """An event that compares the cost of an exchange with an echo of the same size."""
        times = self._transport.times
        if times.exchanges == 0:
            return
        echo = self._transport.echo(times.size)
        if echo > 0.0:
            self._warn(
                "bus",
                f"{times.exchanges} exchanges cost {1e6 * times.overhead:.0f} us each beyond the solvers' work; "
                f"an echo of the same {times.size} B to the same processes takes {1e6 * echo:.0f} us "
                f"({times.overhead / echo:.2f} times)",
            )
