"""What the parts of one body are asked, and what they answer: requests with their headers, and replies that are read.

Which forces act, which exchange is the last, when a step is given up: that the island decides (`participants`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies
from softseam_coupling.loops.loop import Correction, PartRequest
from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import FailureKind, Status
from softseam_protocol.messages.participant import ToolMotion
from softseam_protocol.messages.pile import Guest
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.parts import Parts
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.transport import ParticipantFailed, Transport

Floats = NDArray[np.float64]

_NOTHING = np.zeros(0)
_NO_VECTORS, _AS_SENT, _NO_IDS = np.zeros((0, 3)), np.zeros((0, 0)), np.zeros(0, dtype=np.int32)
_AWAKE = np.zeros(0, dtype=np.int8)
_NO_REPLIES: Mapping[str, messages.Reply] = {}
_OLDER = messages.Failure(
    FailureKind.SCHEMA,
    "it does not tell the energies that it begins with: install the same version of softseam on both sides",
)


class StepFailed(RuntimeError):
    """A step could not be taken, nor is any part of it; the simulation stands at the last committed step and can be
    stepped again. Only what the seam learned in trying may be kept."""


class PartClient:
    """Of the present cut of one body.

    clock  of the simulation; cuts count its epochs
    say    receives kind and text of every event
    """

    def __init__(self, bundle: messages.Bundle, transport: Transport, clock: Clock, say: Tell) -> None:
        self._bundle, self._transport, self._clock, self._say = bundle, transport, clock, say
        self._epoch = self._tick = 0
        self._n_asked = self._asked = -1  # exchanges of the tick at hand, and of the one before
        self._under_way = False  # a step is, or was when it failed
        self.parts: Parts
        """the present cut"""
        self.able: dict[str, messages.Capabilities] = {}
        """what they can do, of those that have coupling nodes"""

    def build(
        self, parts: Parts, state: messages.BodyState | None, meshes: Mapping[str, messages.PartMesh | None]
    ) -> Energies:
        """Build the parts of another cut in a new epoch: in this state, or to be restored; its energies."""
        self._clock.epoch += 1
        self._epoch, self.parts = self._clock.epoch, parts
        self._n_asked, self._under_way = -1, False
        replies = self._transport.exchange(
            {
                name: messages.Configure(
                    self._header(name),
                    self._bundle,
                    parts.models[name],
                    parts.cells[name],
                    parts.coupling_nodes,
                    state,
                    parts.owns_points(name),
                    parts.body,
                    meshes[name],
                )
                for name in parts.names
            }
        )
        begun = {name: reply for name, reply in replies.items() if isinstance(reply, messages.Configured)}
        for name, reply in begun.items():
            if math.isnan(reply.kinetic + reply.strain + reply.gravity):
                raise ParticipantFailed(name, _OLDER)
        known = {name: reply.capabilities for name, reply in begun.items()}
        self.able = {name: able for name, able in known.items() if able is not None}
        return Energies(
            sum(reply.kinetic for reply in begun.values()),
            sum(reply.strain for reply in begun.values()),
            sum(reply.gravity for reply in begun.values()),
        )

    def stand(self, step: int) -> None:
        """Be about to take the step of this number; before `build`."""
        self._tick = step

    def _header(self, part: str, exchange: int = 0) -> Header:
        """Names a request of the present cut."""
        return Header(SCHEMA_VERSION, self._clock.session, part, self._epoch, self._tick, exchange, self._clock.time)

    def _next_header(self, part: str) -> Header:
        """Names the first request of the step that follows the present one."""
        clock = self._clock
        return Header(SCHEMA_VERSION, clock.session, part, self._epoch, self._tick + 1, 0, (clock.step + 1) * clock.dt)

    # ---- a step

    @property
    def begins(self) -> bool:
        """Whether the next exchange is the first of its step."""
        return self._n_asked < 0

    def advance(
        self,
        wanted: Mapping[str, PartRequest],
        dt: float,
        motion: ToolMotion,
        fields: bool,
        turn: Floats = _NOTHING,
    ) -> dict[str, messages.Request]:
        """The next exchange of a step of dt [s]; fields: ask parts for theirs, too, where this may be the last."""
        self._n_asked, self._under_way = self._n_asked + 1, True
        header, n = self._header, self._n_asked
        return {
            name: _advance_request(header(name, n), dt, motion, one, fields and one.last, turn)
            for name, one in wanted.items()
        }

    def advance_next(
        self, wanted: Mapping[str, PartRequest], dt: float, motion: ToolMotion
    ) -> dict[str, messages.Advance]:
        """The first exchange of the step after this one."""
        return {name: _advance_request(self._next_header(name), dt, motion, one) for name, one in wanted.items()}

    def correct(
        self, corrections: Mapping[str, Correction], fields: bool, after: Mapping[str, messages.Advance]
    ) -> dict[str, messages.Request]:
        """What moves its parts on, as a step ends; after: what is to be served at once."""
        self._n_asked += 1
        return {
            name: messages.Correct(self._header(name, self._n_asked), one.push, one.force, fields, after.get(name))
            for name, one in corrections.items()
            if name in self.parts.cells
        }

    def exchange(
        self, requests: Mapping[str, messages.Request], known: Mapping[str, messages.Reply] = _NO_REPLIES
    ) -> dict[str, messages.Advanced]:
        """Ask, and read what is answered; known: what was answered before. Raises StepFailed."""
        return self.read({**known, **(self._transport.exchange(requests) if requests else {})})

    def read(self, replies: Mapping[str, messages.Reply]) -> dict[str, messages.Advanced]:
        """The answers of parts. Raises StepFailed."""
        found = {}
        for name, reply in replies.items():
            assert isinstance(reply, messages.Advanced)
            model = self.parts.models[name]
            if reply.status is not Status.CONVERGED:
                text = f"step {self._clock.step}, {name} ({model}): {reply.why}"
                if not math.isfinite(reply.kinetic):
                    raise StepFailed(text)
                self._say("solver", text)
            found[name] = reply
        return found

    def skip(self) -> None:
        """The next exchange was asked for already, with the correction of the step before."""
        self._n_asked, self._under_way = self._n_asked + 1, True

    def end_step(self) -> None:
        """The last exchange was the step's."""
        self._asked = self._n_asked
        self._tick += 1
        self._n_asked, self._under_way = -1, False

    def reopen(self) -> None:
        """The step before was not taken: it is under way again, and to be given up."""
        self._tick -= 1
        self._n_asked, self._under_way = self._asked, True

    def began_ahead(self) -> None:
        """The first exchange of the step at hand was served, and is to be given up."""
        self._n_asked, self._under_way = 0, True

    def give_up(self) -> None:
        """Have a step that is under way taken back by those that took it."""
        if self._under_way:
            self._transport.exchange(
                {name: messages.Commit(self._header(name, self._n_asked + 1)) for name in self.parts.names}
            )
            self._under_way = False

    # ---- what they know

    def observe(self, indicators: bool, own: bool) -> dict[str, messages.Fields]:
        """Each part's fields."""
        requests = {name: messages.Observe(self._header(name), indicators, own) for name in self.parts.names}
        replies = self._transport.exchange(requests)
        return {name: reply for name, reply in replies.items() if isinstance(reply, messages.Fields)}

    def snapshot(self) -> dict[str, bytes]:
        """Each part's state, which the transport keeps to recover a participant with."""
        replies = self._transport.exchange(
            {name: messages.Snapshot(self._header(name, self._n_asked + 1)) for name in self.parts.names}
        )
        return {name: reply.state for name, reply in replies.items() if isinstance(reply, messages.SnapshotTaken)}

    def restore(self, states: Mapping[str, bytes]) -> None:
        """Continue from `snapshot`."""
        self._transport.exchange(
            {name: messages.Restore(self._header(name), states[name]) for name in self.parts.names}
        )

    def release(self, names: Collection[str]) -> None:
        """Let go of participants, of this cut or another."""
        if names:
            self._transport.exchange({name: messages.Release(self._header(name)) for name in sorted(names)})


def _advance_request(
    header: Header,
    dt: float,
    motion: ToolMotion,
    part: PartRequest,
    fields: bool = False,
    turn: Floats = _NOTHING,
) -> messages.Advance:
    """What a loop asks a part for, over a step of dt [s] with this motion of the tools, as a message.

    turn: of the whole body, see `Advance`
    """
    target = _NO_VECTORS if part.target is None else part.target
    impedance = _AS_SENT if part.impedance is None else part.impedance
    start = _NO_VECTORS if part.start is None else part.start
    guests: list[Guest] = []
    about = target, impedance, fields, start, part.repeat, turn, _AWAKE, guests
    asked = _NO_IDS if part.asked is None else part.asked
    return messages.Advance(header, dt, part.force, motion, part.renew, *about, asked)
