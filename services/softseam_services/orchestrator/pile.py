"""A pile of a simulation: whole bodies that one participant holds as one part, asked and answered together.

What is not a step is asked of its bodies one by one, as of any other (`MemberTransport`); the pile answers these out of
what it asked its participant for once. A model takes bodies into a pile where MODELS says that it `piles`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.names import within
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.pile import Begun
from softseam_protocol.models import facts_of
from softseam_protocol.participant.state import join_states, split_states
from softseam_protocol.scene.interfaces import InterfaceSpec, contacts_among
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.participants import Participants, Tied
from softseam_services.orchestrator.parts import Parts
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.transport import Transport
from softseam_services.server import Setup

Ints = NDArray[np.int32]

_NONE: Ints = np.zeros(0, dtype=np.int32)


class Pile:
    """Bodies of these names, whole, under one model.

    report  receives the events of all
    """

    def __init__(
        self,
        model: str,
        names: Sequence[str],
        n_nodes: int,
        bundle: messages.Bundle,
        scene: Scene,
        transport: Transport,
        clock: Clock,
        report: Tell,
    ) -> None:
        self.names, self.part = tuple(names), within("pile", model)
        """of its bodies, in their order; id of the part that they are"""
        self._place = {name: place for place, name in enumerate(names)}
        contacts = contacts_among(names, scene.interfaces)
        self.contacts = tuple(contacts)
        """names of the interfaces between its bodies"""
        places = [[self._place[name] for name in contact.between] for contact in contacts.values()]
        self.pairs = np.array(places, dtype=np.int64).reshape(-1, 2)
        """bodies of each (m, 2)"""
        self._alone = Parts(self.part, {self.part: model}, {self.part: _NONE}, {self.part: n_nodes}, _NONE)
        self._asked_through = _ByBody(transport, names)
        self._held = Participants(
            *(bundle, scene, self._asked_through, clock, report, lambda parts: None, lambda parts, name: None)
        )
        self.asleep = np.zeros(len(names), dtype=np.int8)
        """1 for bodies that the next step is not asked of (b,)"""
        self._fields: dict[tuple[bool, bool], list[messages.Fields]] = {}
        self._states: list[bytes] = []
        self._to_restore: dict[int, bytes] = {}

    # ---- all of them

    @property
    def _tied(self) -> Tied:
        return self._alone, None

    @property
    def begun(self) -> Begun:
        """The energies that the bodies began with."""
        begun = self._asked_through.begun
        assert begun is not None
        return begun

    def begin(self, states: Sequence[messages.BodyState], step: int) -> None:
        """Have the part built of bodies in these states, before a step of this number."""
        self.asleep[:] = 0
        self._forget()
        self._held.stand(step)
        self._asked_through.states = list(states)
        self._held.configure(self._tied, None)

    def restore(self, step: int) -> None:
        """Continue from the states that its bodies were given, before a step of this number."""
        self._forget()
        self._held.stand(step)
        self._asked_through.states = []
        states = [self._to_restore[place] for place in range(len(self.names))]
        self._to_restore.clear()
        self._held.restore(self._tied, {self.part: join_states(states)})

    def release(self) -> None:
        """Let go of it."""
        self._held.release_all()

    def _forget(self) -> None:
        self._fields, self._states = {}, []

    # ---- a step

    def lay(self, asleep: NDArray[np.bool_]) -> bool:
        """Some of its bodies (b,) sleep through the next step; whether any takes it."""
        self.asleep[:] = asleep
        return not self.asleep.all()

    @property
    def tied(self) -> bool:
        """Whether something ties it to others: nothing does."""
        return False

    def requests(self, motion: messages.ToolMotion, fields: bool) -> dict[str, messages.Request]:
        """What its participant is asked for in a step."""
        self._forget()
        asked = self._held.requests(motion, fields)
        if not self.asleep.any():
            return asked
        return {
            part: replace(request, asleep=self.asleep.copy()) if isinstance(request, messages.Advance) else request
            for part, request in asked.items()
        }

    def taken(self, replies: Mapping[str, messages.Reply]) -> Outcome:
        """Its participant has answered `requests`. What is wrong with the step of a body is in its notes."""
        reply = replies[self.part]
        if isinstance(reply, messages.Advanced) and reply.status is not Status.CONVERGED and reply.members is not None:
            replies = {self.part: replace(reply, status=Status.CONVERGED, why="")}
        return self._held.taken(replies)

    def withdraw(self) -> None:
        """Take the step back that was taken last: it failed elsewhere."""
        self._held.withdraw()

    # ---- one of them

    def fields(self, name: str, indicators: bool, own: bool) -> messages.Fields:
        """Those of a body as it stands."""
        key = indicators, own
        if key not in self._fields:
            self._fields[key] = self._held.observe(indicators, own)[self.part].bodies
        return self._fields[key][self._place[name]]

    def snapshot(self) -> bytes:
        """Of all bodies, from which their participant can be restored."""
        return self._held.snapshot()[self.part]

    def state(self, name: str) -> bytes:
        """The snapshot of a body."""
        if not self._states:
            self._states = split_states(self.snapshot())
        return self._states[self._place[name]]

    def put_back(self, name: str, state: bytes) -> None:
        """A body is to continue from this snapshot, with all the others, see `restore`."""
        self._to_restore[self._place[name]] = state

    def holds(self, name: str) -> bool:
        """Whether a body is one of them."""
        return name in self._place

    def place(self, name: str) -> int:
        """Of a body among all."""
        return self._place[name]


class _ByBody:
    """A transport that has a part built of several bodies."""

    def __init__(self, inner: Transport, names: Sequence[str]) -> None:
        self._inner, self._names = inner, list(names)
        self.states: list[messages.BodyState] = []
        """of the bodies when they are built; empty: to be restored"""
        self.begun: Begun | None = None
        """what their participant said of them then"""

    def exchange(self, requests: Mapping[str, messages.Request]) -> dict[str, messages.Reply]:
        """See `Transport`."""
        replies = self._inner.exchange({part: self._of_bodies(request) for part, request in requests.items()})
        for reply in replies.values():
            if isinstance(reply, messages.Configured):
                self.begun = reply.begun
        return replies

    def _of_bodies(self, request: messages.Request) -> messages.Request:
        if isinstance(request, messages.Configure):
            return replace(request, body="", bodies=self._names, states=self.states)
        return request

    def wait_alive(self, participant: str, timeout: float) -> bool:
        """See `Transport`."""
        return self._inner.wait_alive(participant, timeout)

    def close(self) -> None:
        """The other belongs to somebody else."""


class MemberTransport:
    """How one body of a pile is asked, by itself, for what is not a step: the pile answers."""

    def __init__(self, pile: Pile, name: str) -> None:
        self._pile, self._name = pile, name

    def exchange(self, requests: Mapping[str, messages.Request]) -> dict[str, messages.Reply]:
        """See `Transport`. Raises ValueError for a step, which the pile takes as a whole."""
        return {part: self._answer(request) for part, request in requests.items()}

    def _answer(self, request: messages.Request) -> messages.Reply:
        pile, name, header = self._pile, self._name, request.header
        if isinstance(request, messages.Configure):
            begun, place = pile.begun, pile.place(name)
            energies = float(begun.strain[place]), float(begun.kinetic[place]), float(begun.gravity[place])
            return messages.Configured(header, 0, 0, 1, *energies)
        if isinstance(request, messages.Observe):
            return pile.fields(name, request.indicators, request.own)
        if isinstance(request, messages.Snapshot):
            return messages.SnapshotTaken(header, pile.state(name))
        if isinstance(request, messages.Restore):
            pile.put_back(name, request.state)
            return messages.Restored(header)
        if isinstance(request, messages.Release):
            return messages.Released(header)
        if isinstance(request, messages.Commit):
            return messages.Committed(header)
        raise ValueError(f"{name} is in a pile, which steps as a whole: it answers no {type(request).__name__}")

    def wait_alive(self, participant: str, timeout: float) -> bool:
        """See `Transport`."""
        return True

    def close(self) -> None:
        """There is nothing to close."""


def piles_of(
    setups: Mapping[str, Setup], interfaces: Mapping[str, InterfaceSpec], climbing: Collection[str]
) -> dict[str, tuple[str, ...]]:
    """Names of the bodies of each pile, by its model, in the scene's order: those that are whole, and that nothing may
    cut, climb or join to others. Contact between them is solved in it. A pile of one is a body by itself.

    setups      of all bodies, by name
    interfaces  of the scene, by name
    climbing    bodies that may go to another rung
    """
    found: dict[str, list[str]] = {}
    for name, setup in setups.items():
        regions = setup.scene.regions
        model, whole = regions.default, not regions.cut and regions.goal is None
        if model and setup.body.has_cells and whole and name not in climbing and facts_of(model).piles:
            found.setdefault(model, []).append(name)
    alone = {model: tuple(_without_joined(names, interfaces)) for model, names in found.items()}
    return {model: names for model, names in alone.items() if len(names) > 1}


def _without_joined(names: list[str], interfaces: Mapping[str, InterfaceSpec]) -> list[str]:
    """Bodies that nothing joins to others than these, and nothing to these but contact."""
    while True:
        within = contacts_among(names, interfaces)
        joined = {name for key, each in interfaces.items() if key not in within for name in each.between}
        if joined.isdisjoint(names):
            return names
        names = [name for name in names if name not in joined]
