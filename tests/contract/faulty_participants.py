"""Participants with one fault each, made of the example: what the checks of the kit must see.

A fault changes what the example gets, does or says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from softseam.examples.participant.block import LinearBlock
from softseam_protocol.errors import Refused, SchemaMismatch
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Commit,
    Configure,
    Configured,
    Correct,
    Failure,
    Release,
    Request,
    Restore,
    SnapshotTaken,
)
from softseam_protocol.participant.handler import ParticipantHandler
from softseam_protocol.participant.part_solver import participant_of
from softseam_protocol.participant.requests import Slot
from softseam_protocol.wire.codec import decode, encode


class Example(ParticipantHandler):
    """The example, without its process."""

    def __init__(self) -> None:
        super().__init__(participant_of(LinearBlock), ("block", "fem", "pbd"))

    @property
    def slots(self) -> dict[tuple[str, str], Slot]:
        return self.participant.slots


class Faulty(Example):
    """The example with one fault: `asked` changes requests, `said` replies; `seat_of` finds the session's part."""

    def __init__(
        self,
        asked: Callable[[Faulty, Any], Any] = lambda _, request: request,
        said: Callable[[Faulty, Any, Any], Any] = lambda _, request, reply: reply,
    ) -> None:
        super().__init__()
        self._asked, self._said = asked, said

    def __call__(self, payload: bytes) -> bytes:
        request = decode(payload, Request)
        reply = decode(super().__call__(encode(self._asked(self, request))))
        return encode(replace(self._said(self, request, reply), header=request.header))

    def seat_of(self, request: Any) -> Slot:
        return self.slots[request.header.session, request.header.part]


class Lenient(Example):
    """Answers what it should refuse, or refuses it by another kind; with `acts` it does what it refuses."""

    def __init__(self, kind: str, becomes: str = "internal", acts: bool = False, text: str = "") -> None:
        super().__init__()
        self._kind, self._becomes, self._acts, self._text = kind, becomes, acts, text

    def __call__(self, payload: bytes) -> bytes:
        try:
            return super().__call__(payload)
        except (Refused, SchemaMismatch) as error:
            kind = error.failure.kind if isinstance(error, Refused) else "schema"
            text = self._text or (error.failure.message if isinstance(error, Refused) else str(error))
            if self._acts:
                for slot in self.slots.values():
                    was = slot.solver.committed
                    slot.solver.committed = replace(was, x=was.x + 1e-3)
            raise Refused(Failure(FailureKind(self._becomes if kind == self._kind else kind), text)) from None
        except Exception:
            if self._kind != "garbage":
                raise
            raise Refused(Failure(FailureKind.INTERNAL, "")) from None


def _goes_on(self: Faulty, request: Any) -> Any:
    """A redone step begins where the one before ended."""
    if isinstance(request, Advance) and request.header.exchange:
        slot = self.seat_of(request)
        if slot.solver.tentative is not None and request.header.exchange > slot.exchange:
            slot.solver.committed = slot.solver.tentative
    return request


def _forgets_commit(self: Faulty, request: Any) -> Any:
    """A new step does not commit the one before."""
    if isinstance(request, Advance) and request.header.step:
        slot = self.seat_of(request)
        if slot.solver.tentative is not None and request.header.step == slot.committed + 1:
            slot.solver.tentative = slot.solver.committed
    return request


def _commit_drags(self: Faulty, request: Any) -> Any:
    """A Commit alone loses some of the velocity."""
    if isinstance(request, Commit):
        slot = self.seat_of(request)
        if slot.solver.tentative is not None:
            slot.solver.tentative = replace(slot.solver.tentative, v=0.9999 * slot.solver.tentative.v)
    return request


def _keeps(self: Faulty, request: Any) -> Any:
    """A Commit of the tentative step keeps it."""
    if isinstance(request, Commit):
        slot = self.seat_of(request)
        if slot.solver.tentative is not None and request.header.step == slot.committed:
            slot.solver.committed = slot.solver.tentative
    return request


def _forgets_the_tentative(self: Faulty, request: Any) -> Any:
    """What is refused is forgotten with what came before."""
    if isinstance(request, Advance) and request.header.step > 1:
        slot = self.seat_of(request)
        slot.replies.clear()
        slot.exchange = -1
        slot.solver.committed = replace(slot.solver.committed, x=slot.solver.tentative.x)
    return request


def _any_epoch(self: Faulty, request: Any) -> Any:
    """Old epochs are taken for the one that it is in."""
    return replace(request, header=replace(request.header, epoch=1))


def _any_state(self: Faulty, request: Any) -> Any:
    """Whatever is restored is taken for the state that it has."""
    return replace(request, state=self.seat_of(request).solver.snapshot()) if isinstance(request, Restore) else request


def altered(kind: type, change: Callable[[Any], Any]) -> Callable[[Faulty, Any, Any], Any]:
    return lambda self, request, reply: change(reply) if isinstance(reply, kind) else reply


def _of_another(self: Faulty, request: Any, reply: Any) -> Any:
    if isinstance(reply, SnapshotTaken):  # velocities are left out
        solver = self.seat_of(request).solver
        was = solver.committed
        solver.committed = replace(was, v=0.0 * was.v)
        reply = replace(reply, state=solver.snapshot())
        solver.committed = was
    return reply


def _keeps_session(self: Faulty, request: Any) -> Any:
    return (
        replace(request, header=replace(request.header, session="nobody-else"))
        if isinstance(request, Release)
        else request
    )


class AnyModel(Faulty):
    """Builds whatever model it is asked for."""

    def __init__(self) -> None:
        super().__init__(
            lambda self, request: replace(request, model="block") if isinstance(request, Configure) else request
        )


class AnyShape(Faulty):
    """Takes forces of any shape, as zero."""

    def __init__(self) -> None:
        def asked(self: Faulty, request: Any) -> Any:
            if isinstance(request, Advance) and len(request.coupling_force) == 4:
                return replace(request, coupling_force=np.zeros((9, 3)))
            return request

        super().__init__(asked)


def _torque(self: Faulty, request: Any) -> Any:
    """A spin that dies away."""
    if isinstance(request, Advance) and request.header.step:
        slot = self.seat_of(request)
        if slot.solver.tentative is not None:
            v = slot.solver.tentative.v
            slot.solver.tentative = replace(slot.solver.tentative, v=0.98 * v + 0.02 * v.mean(axis=0))
    return request


def _pulled(self: Faulty, request: Any) -> Any:
    """What is turned is pulled back to where it was at rest."""
    if isinstance(request, Configure) and request.state is not None and request.mesh is not None:
        x, rest = request.state.x, request.mesh.x_rest
        return replace(request, state=replace(request.state, x=x + 0.05 * (rest - rest.mean(0)) * [1, -1, 0]))
    return request


def _lopsided(self: Faulty, request: Any) -> Any:
    """One node bears more than its share."""
    if isinstance(request, Configure) and request.mesh is not None:
        rest = request.mesh.x_rest.copy()
        rest[22] += 1e-3
        return replace(request, mesh=replace(request.mesh, x_rest=rest))
    return request


def changed(kind: type, **change: Callable[[Any], Any]) -> Callable[[], Example]:
    """Fields of its replies of this kind are changed."""
    return lambda: Faulty(said=altered(kind, lambda r: replace(r, **{k: f(getattr(r, k)) for k, f in change.items()})))


def coupled(**change: Callable[[Any], Any]) -> Callable[[], Example]:
    """The same of what it says of its coupling nodes."""
    return changed(Advanced, coupling=lambda r: replace(r, **{k: f(getattr(r, k)) for k, f in change.items()}))


def _on_state(change: Callable[[Slot], None]) -> Callable[[Faulty, Any], Any]:
    """What a step of the example begins with is changed."""

    def asked(self: Faulty, request: Any) -> Any:
        if isinstance(request, Advance):
            change(self.seat_of(request))
        return request

    return asked


def _deaf(slot: Slot) -> None:
    """Forces on the coupling nodes do nothing."""
    slot.solver.part.inverse(0.002)[:] = 0.0


def _push_of(change: Callable[[Any], Any]) -> Callable[[], Example]:
    return lambda: Faulty(lambda _, r: replace(r, push=change(r.push)) if isinstance(r, Correct) else r)


def _yields_more() -> Example:
    """Tells that it yields more than it does, and corrects by what it told."""

    def said(_: Faulty, request: Any, reply: Any) -> Any:
        if not isinstance(request, Advance):
            return reply
        return replace(reply, coupling=replace(reply.coupling, compliance=1.1 * reply.coupling.compliance))

    return Faulty(lambda _, r: replace(r, push=1.1 * r.push) if isinstance(r, Correct) else r, said)


def _moved(reply: Advanced) -> Advanced:
    return replace(reply, coupling=replace(reply.coupling, x=reply.coupling.x + 1e-9))


def _then(change: Callable[[Any], Any]) -> Callable[[], Example]:
    """Serves what follows a correction, and says something else."""

    def said(self: Faulty, request: Any, reply: Any) -> Any:
        if not isinstance(request, Correct) or request.then is None:
            return reply
        return replace(reply, then=change(decode(Example.__call__(self, encode(request.then)))))

    return lambda: Faulty(said=said)


NONE = np.zeros((0, 0))

FAULTS: list[tuple[str, str, Callable[[], Example]]] = [
    ("repeat", "the same bytes", changed(Advanced, extras=lambda _: {"slip": float(np.random.default_rng().random())})),
    ("repeat", "Configured as before", changed(Configured, strain=lambda _: float(np.random.default_rng().random()))),
    ("redo", "the first answer to the first force", lambda: Faulty(_goes_on)),
    ("redo", "another answer to another force", lambda: Faulty(_on_state(_deaf))),
    ("commit", "a second step with the momentum of the first", lambda: Faulty(_forgets_commit)),
    ("commit", "the same step after a Commit", lambda: Faulty(_commit_drags)),
    ("discard", "positions as at the start", lambda: Faulty(_keeps)),
    ("restore", "the same bits from the restored session", lambda: Faulty(said=_of_another)),
    ("release", "a Failure of kind not_configured", lambda: Faulty(_keeps_session)),
    ("stale_step", "a Failure of kind stale", lambda: Lenient("stale")),
    ("old_epoch", "a Failure of kind stale", lambda: Faulty(_any_epoch)),
    ("step_ahead", "the same step as before the refusal", lambda: Lenient("", acts=True)),
    ("step_ahead", "the same bytes for the request before the refusal", lambda: Faulty(_forgets_the_tentative)),
    ("step_ahead", "what is wrong and the remedy", lambda: Lenient("stale", "stale", text="no")),
    ("unknown_session", "a Failure of kind not_configured", lambda: Lenient("not_configured")),
    ("wrong_shape", "a Failure of kind invalid", AnyShape),
    ("not_a_number", "a Failure of kind invalid", lambda: Lenient("garbage")),
    ("other_schema", "a Failure of kind schema", lambda: Lenient("schema", "invalid")),
    ("unknown_model", "a Failure of kind invalid", AnyModel),
    ("foreign_state", "a Failure of kind invalid", lambda: Faulty(_any_state)),
    ("garbage", "a Failure of kind invalid", lambda: Lenient("garbage")),
    ("momentum", "momentum that changes by", changed(Advanced, momentum=lambda p: 0.99 * p)),
    ("angular_momentum", "the same angular momentum", lambda: Faulty(_torque)),
    ("angular_momentum", "of a part that spins", changed(Advanced, angular_momentum=lambda L: 0.0 * L)),
    ("energy", "kinetic energy of a part that flies", changed(Advanced, kinetic=lambda e: 0.9 * e)),
    ("energy", "gravity's energy", changed(Configured, gravity=lambda e: -e)),
    ("energy", "strain energy of a uniform stretch", changed(Configured, strain=lambda e: 2.0 * e)),
    ("energy", "work of the coupling forces", coupled(work=lambda e: 0.0)),
    ("energy", "energy of at most that work", changed(Advanced, strain=lambda e: e + 1e-3)),
    ("rigid_motion", "no strain energy", lambda: Faulty(_pulled)),
    ("uniform_stress", "a force of E strain area", lambda: Faulty(_lopsided)),
    ("uniform_stress", "a force of E strain area", lambda: Faulty(_on_state(_deaf))),
    (
        "compliance_definite",
        "Capabilities.compliance: true",
        changed(Configured, capabilities=lambda able: replace(able, compliance=False)),
    ),
    ("compliance_definite", "no negative eigenvalue", coupled(compliance=lambda H: -H)),
    ("compliance_definite", "a symmetric compliance", coupled(compliance=np.triu)),
    ("compliance_definite", "a compliance of shape (27, 27)", coupled(compliance=lambda _: NONE)),
    ("compliance_predicts", "the move that the compliance foresees", coupled(compliance=lambda H: 1.2 * H)),
    ("compliance_predicts", "a compliance of shape (27, 27)", coupled(compliance=lambda _: NONE)),
    ("correct", "the move that was foreseen", _push_of(lambda push: 1.1 * push)),
    ("correct", "what redoing the step gives", _yields_more),
    ("correct", "a step that can be corrected", coupled(correctable=lambda _: False)),
    ("correct", "Coupled.x of shape (9, 3)", coupled(x=lambda x: x[:1])),
    ("correct_then", "the same bits as in two requests", _then(_moved)),
    ("correct_then", "the header of Correct.then", _then(lambda r: replace(r, header=replace(r.header, step=7)))),
]
