"""A pile of a simulation: whole bodies that one participant holds as one part, asked and answered together.

What is not a step is asked of its bodies one by one, as of any other (`MemberTransport`); the pile answers these out of
what it asked its participant for once. A model takes bodies into a pile where MODELS says that it `piles`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.islands import islands_of
from softseam_coupling.loops.loop import Outcome, PartRequest
from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.names import within
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.pile import Begun, Guest, Push
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
_FREE, _AWAKE = np.zeros((0, 3)), np.zeros(0, dtype=np.int8)


class Pile:
    """Bodies of these names, whole, under one model, which guests may touch, bodies of others.

    report  receives the events of all
    """

    def __init__(
        self,
        model: str,
        names: Sequence[str],
        guests: Sequence[str],
        n_nodes: int,
        bundle: messages.Bundle,
        scene: Scene,
        transport: Transport,
        clock: Clock,
        report: Tell,
    ) -> None:
        self.names, self.part = tuple(names), within("pile", model)
        """of its bodies, in their order; id of the part that they are"""
        self.guests = tuple(guests)
        """names of bodies of other models that touch it"""
        found = contacts_among([*names, *guests], scene.interfaces)
        self.contact_names, self.contacts = tuple(found), tuple(found.values())
        """of the interfaces between its bodies, and with guests; these"""
        self._place = {name: place for place, name in enumerate(names)}
        places = {name: place for place, name in enumerate((*names, *guests))}
        between = [[places[name] for name in contact.between] for contact in self.contacts]
        self.pairs = np.array(between, dtype=np.int64).reshape(-1, 2)
        """places of the bodies of each contact, those of guests after those of its own (m, 2)"""
        self._alone = Parts(self.part, {self.part: model}, {self.part: _NONE}, {self.part: n_nodes}, _NONE)
        self._asked_through = _ByBody(transport, names, guests)
        self._clock = clock
        self._held = Participants(
            *(bundle, scene, self._asked_through, clock, report, lambda parts: None, lambda parts, name: None)
        )
        self.asleep = np.zeros(len(names), dtype=np.int8)
        """1 for bodies that the next step is not asked of (b,)"""
        self.away = np.zeros(len(guests), dtype=np.bool_)
        """guests that sleep through it (g,)"""
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
        self.away[:] = False
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

    def lay(self, asleep: NDArray[np.bool_], away: NDArray[np.bool_]) -> bool:
        """Some of its bodies (b,) and guests (g,) sleep through the next step; whether any takes it."""
        self.asleep[:], self.away[:] = asleep, away
        return not (self.asleep.all() and self.away.all())

    @property
    def sleepers(self) -> NDArray[np.bool_]:
        """Bodies, and after them guests, that sleep through the next step (b + g,)."""
        return np.concatenate([self.asleep.astype(np.bool_), self.away])

    @property
    def tied(self) -> bool:
        """Whether something ties it to others: nothing does."""
        return False

    def make_ready(self) -> None:
        """Be about to ask for a step from where the last one ended."""
        self._forget()
        self._held.make_ready()

    def requests(self, motion: messages.ToolMotion, fields: bool) -> dict[str, messages.Request]:
        """What its participant is asked for in a step."""
        self.make_ready()
        return self.asked(motion, fields)

    def asked(
        self, motion: messages.ToolMotion, fields: bool, guests: Sequence[Guest] = ()
    ) -> dict[str, messages.Request]:
        """What the next exchange of a step asks its participant for."""
        asked = self._held.asked({self.part: PartRequest(_FREE)}, self._clock.dt, motion, fields)
        if not self.asleep.any() and not guests:
            return asked
        asleep = self.asleep.copy() if self.asleep.any() else _AWAKE
        return {
            part: replace(request, asleep=asleep, guests=list(guests))
            if isinstance(request, messages.Advance)
            else request
            for part, request in asked.items()
        }

    def on_guests(self, replies: Mapping[str, messages.Reply]) -> list[Push]:
        """What acted on its guests, in their order, as its participant has answered."""
        reply = replies[self.part]
        assert isinstance(reply, messages.Advanced) and reply.members is not None
        return reply.members.on_guests

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

    def __init__(self, inner: Transport, names: Sequence[str], guests: Sequence[str]) -> None:
        self._inner, self._names, self._guests = inner, list(names), list(guests)
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
            return replace(request, body="", bodies=self._names, states=self.states, guests=self._guests)
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


class Gathered(NamedTuple):
    """Who is in a pile, and who touches it."""

    names: tuple[str, ...]
    """of its bodies"""
    guests: tuple[str, ...]


def piles_of(
    setups: Mapping[str, Setup], interfaces: Mapping[str, InterfaceSpec], climbing: Collection[str]
) -> dict[str, Gathered]:
    """The bodies of each pile, by its model, in the scene's order: those that are whole, and that nothing may cut,
    climb or join to others. Contact between them is solved in it, and with bodies of models that visit piles, its
    guests. A pile of one without guests is a body by itself.

    setups      of all bodies, by name
    interfaces  of the scene, by name
    climbing    bodies that may go to another rung
    """
    found: dict[str, list[str]] = {}
    visitors: list[str] = []
    for name, setup in setups.items():
        regions = setup.scene.regions
        model, whole = regions.default, not regions.cut and regions.goal is None
        if not (model and setup.body.has_cells and whole and name not in climbing):
            continue
        if facts_of(model).piles:
            found.setdefault(model, []).append(name)
        elif facts_of(model).visits_piles:
            visitors.append(name)
    piles = {model: _gather(names, visitors, interfaces) for model, names in found.items()}
    return {model: pile for model, pile in piles.items() if len(pile.names) > 1 or (pile.names and pile.guests)}


def _gather(names: list[str], visitors: list[str], interfaces: Mapping[str, InterfaceSpec]) -> Gathered:
    """Bodies that nothing joins to others than these and visitors, and nothing to these but contact; of the visitors
    those that contact ties to them, directly or by others."""
    while True:
        all_ = [*names, *visitors]
        within = contacts_among(all_, interfaces)
        joined = {name for key, each in interfaces.items() if key not in within for name in each.between}
        if joined.isdisjoint(all_):
            break
        names, visitors = ([name for name in each if name not in joined] for each in (names, visitors))
    tied = islands_of(all_, (spec.between for spec in within.values()))
    met = {name for island in tied if not set(names).isdisjoint(island) for name in island}
    return Gathered(tuple(names), tuple(name for name in visitors if name in met))
