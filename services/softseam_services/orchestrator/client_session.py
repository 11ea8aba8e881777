"""One client's session in the orchestrator: its simulation, its publications, its last answer."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from softseam_protocol.bus.client import Bus
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Begin
from softseam_protocol.messages.session import ErrorEstimate, Event, Frame, Observation, Observations, Step, StepReport
from softseam_protocol.scene.command import Command, checked_command
from softseam_protocol.topics import Keys
from softseam_services.orchestrator.bus_transport import BusTransport
from softseam_services.orchestrator.client_view import counted, observation, restore, snapshot
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
        routes: Mapping[str, str] | None = None,
    ) -> None:
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

    @property
    def opened(self) -> bool:
        return self._simulation is not None

    @property
    def simulation(self) -> Simulation:
        assert self._simulation is not None
        return self._simulation

    def open(self, bundle: Bundle, record: bool) -> Observation:
        """Build the simulation and configure its participants."""
        self._bundle, self._record = bundle, record
        self._transport = BusTransport(self._bus, self._keys, services=self._routes)
        self._feed = RecorderFeed(self._bus, self._keys, self._session, record=record, warn=self._warn)
        try:
            self._simulation = Simulation(bundle, self._transport, session=self._session, emit=self._emit)
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
        self._last, self._trouble, self.steps = None, None, 0
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
        if trouble is not None:
            raise trouble
        return self._each(request) if request.each else self._steps(request)

    def _steps(self, request: Step) -> Observation:
        commands = self._commands(request)
        for remaining in range(request.count, 0, -1):
            try:
                if not self._step(commands, fields=request.fields and remaining == 1, more=remaining > 1):
                    break
            except (StepFailed, ParticipantFailed, ParticipantLost) as error:
                raise counted(error, request.count - remaining, request.count) from error.__cause__
        return self._observe(request.fields, taken=True)

    def _each(self, request: Step) -> Observations:
        """Take as many steps as fit into a turn, one at least."""
        began = time.monotonic()
        taken: list[Observation] = []
        commands = self._commands(request)
        more = True
        while more:
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
        return Observations(request.header, taken or [self._observe(request.fields, taken=True)])

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
        if self.cancelled or self._stopping():
            raise Stopped("the session is being closed: the steps left were not taken")
        if commands is None and self.simulation.done:
            return False
        due = self._record and (self.steps + 1) % max(1, round(FRAME_PERIOD / self.simulation.scene.step)) == 0
        self._last = self.simulation.step(commands, fields=due or fields, more=more and commands is None)
        self.steps += 1
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

    def _begin(self) -> Begin:
        bodies = {name: one.body for name, one in self.simulation.bodies.items()}
        return begin(self._bundle, bodies, self.simulation.tools, self._session, self._seed)

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
