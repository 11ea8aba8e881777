"""Every check of the kit fails where a participant has the fault that it is about, and none where it has none.

The example participant answers on a real bus, in a thread; a fault changes what it gets, does or says.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import StringIO
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.conform.command import FAILED, NOT_CLAIMED, PASSED, conform, run_checks, wait_answers
from softseam.conform.seat import Service
from softseam.conform.table import CHECKS
from softseam.errors import BadInput
from softseam.examples.participant.requests import Participant, Seat
from softseam_protocol.bus.client import Bus, Router
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
    SnapshotTaken,
)
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode

KEY = Keys().participant("block")


class Faulty(Participant):
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

    def seat_of(self, request: Any) -> Seat:
        return self.seats[request.header.session, request.header.part]


class Lenient(Participant):
    """Answers what it should refuse, or refuses it by another kind; with `acts` it does what it refuses."""

    def __init__(self, kind: str, becomes: str = "internal", acts: bool = False) -> None:
        super().__init__()
        self._kind, self._becomes, self._acts = kind, becomes, acts

    def __call__(self, payload: bytes) -> bytes:
        try:
            return super().__call__(payload)
        except (Refused, SchemaMismatch) as error:
            kind = error.failure.kind if isinstance(error, Refused) else "schema"
            text = error.failure.message if isinstance(error, Refused) else str(error)
            if self._acts:
                for seat in self.seats.values():
                    seat.block.x = seat.block.x + 1e-3
            raise Refused(Failure(FailureKind(self._becomes if kind == self._kind else kind), text)) from None
        except Exception:
            if self._kind != "garbage":
                raise
            raise Refused(Failure(FailureKind.INTERNAL, "")) from None


def _anew(self: Faulty, request: Any) -> Any:
    """Forgets what it was asked: every Advance is another one."""
    if isinstance(request, Advance):
        seat = self.seats.get((request.header.session, request.header.part))
        if seat is not None:
            seat.kept.pop(Advance, None)
            seat.exchange = -1 if request.header.step == seat.committed else seat.exchange
    return request


def _goes_on(self: Faulty, request: Any) -> Any:
    """A redone step begins where the one before ended."""
    if isinstance(request, Advance) and request.header.exchange:
        seat = self.seat_of(request)
        if seat.tentative is not None and request.header.exchange > seat.exchange:
            seat.block.x, seat.block.v = seat.tentative
    return request


def _forgets_commit(self: Faulty, request: Any) -> Any:
    """A new step does not commit the one before."""
    if isinstance(request, Advance) and request.header.step:
        seat = self.seat_of(request)
        if seat.tentative is not None and request.header.step == seat.committed + 1:
            seat.tentative = seat.block.x, seat.block.v
    return request


def _keeps(self: Faulty, request: Any) -> Any:
    """A Commit of the tentative step keeps it."""
    if isinstance(request, Commit):
        seat = self.seat_of(request)
        if seat.tentative is not None and request.header.step == seat.committed:
            seat.block.x, seat.block.v = seat.tentative
    return request


def _reply(kind: type, change: Callable[[Any], Any]) -> Callable[[Faulty, Any, Any], Any]:
    return lambda self, request, reply: change(reply) if isinstance(reply, kind) else reply


def _inverted(reply: Advanced) -> Advanced:
    return replace(reply, compliance=-reply.compliance)


def _of_another(self: Faulty, request: Any, reply: Any) -> Any:
    if isinstance(reply, SnapshotTaken):  # velocities are left out
        block = self.seat_of(request).block
        n = 24 * len(block.x)
        return replace(reply, state=reply.state[:n] + bytes(n) + reply.state[2 * n :])
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
            if isinstance(request, Advance) and len(request.seam_force) == 4:
                return replace(request, seam_force=np.zeros((9, 3)))
            return request

        super().__init__(asked)


def _dragged(reply: Advanced) -> Advanced:
    return replace(reply, momentum=0.99 * reply.momentum)


def _torque(self: Faulty, request: Any) -> Any:
    """A spin that dies away."""
    if isinstance(request, Advance) and request.header.step:
        seat = self.seat_of(request)
        if seat.tentative is not None:
            x, v = seat.tentative
            seat.tentative = x, 0.98 * v + 0.02 * v.mean(axis=0)
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


FAULTS: dict[str, Callable[[], Participant]] = {
    "repeat": lambda: Faulty(said=_reply(Advanced, lambda r: replace(r, slip=float(np.random.default_rng().random())))),
    "redo": lambda: Faulty(_goes_on),
    "commit": lambda: Faulty(_forgets_commit),
    "discard": lambda: Faulty(_keeps),
    "restore": lambda: Faulty(said=_of_another),
    "release": lambda: Faulty(_keeps_session),
    "stale_step": lambda: Lenient("stale"),
    "step_ahead": lambda: Lenient("", acts=True),
    "unknown_session": lambda: Lenient("not_configured"),
    "wrong_shape": AnyShape,
    "not_a_number": lambda: Lenient("garbage"),
    "other_schema": lambda: Lenient("schema", "invalid"),
    "unknown_model": AnyModel,
    "garbage": lambda: Lenient("garbage"),
    "momentum": lambda: Faulty(said=_reply(Advanced, _dragged)),
    "angular_momentum": lambda: Faulty(_torque),
    "energy": lambda: Faulty(said=_reply(Advanced, lambda r: replace(r, seam_work=0.0))),
    "rigid_motion": lambda: Faulty(_pulled),
    "uniform_stress": lambda: Faulty(_lopsided),
    "compliance_definite": lambda: Faulty(said=_reply(Advanced, _inverted)),
    "compliance_predicts": lambda: Faulty(said=_reply(Advanced, lambda r: replace(r, compliance=1.2 * r.compliance))),
    "correct": lambda: Faulty(lambda _, r: replace(r, push=1.1 * r.push) if isinstance(r, Correct) else r),
}


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(where):
        yield where


@pytest.fixture
def bus(endpoint: str) -> Iterator[Bus]:
    with Bus(endpoint) as opened:
        yield opened


def outcomes(bus: Bus, endpoint: str, participant: Participant, *names: str) -> dict[str, str]:
    with Bus(endpoint) as other:
        server = other.serve({KEY: participant, Keys().echo("block"): bytes}).start()
        try:
            wait_answers(bus, Keys(), "block")
            return {row.name: row.outcome for row in run_checks(Service(bus, KEY, "block"), names)}
        finally:
            server.close()


def test_every_check_has_its_fault() -> None:
    assert list(FAULTS) == list(CHECKS)


def test_the_example_conforms(bus: Bus, endpoint: str) -> None:
    assert set(outcomes(bus, endpoint, Participant()).values()) == {PASSED}


@pytest.mark.parametrize("name", FAULTS)
def test_a_check_fails_where_its_fault_is(bus: Bus, endpoint: str, name: str) -> None:
    assert outcomes(bus, endpoint, FAULTS[name](), name) == {name: FAILED}


def test_what_is_not_claimed_is_not_checked(bus: Bus, endpoint: str) -> None:
    def less(reply: Configured) -> Configured:
        assert reply.capabilities is not None
        return replace(reply, capabilities=replace(reply.capabilities, compliance=False, corrects=False))

    found = outcomes(bus, endpoint, Faulty(said=_reply(Configured, less)))
    assert [name for name, outcome in found.items() if outcome == NOT_CLAIMED] == [
        "compliance_definite",
        "compliance_predicts",
        "correct",
    ]
    assert FAILED not in found.values()


def test_a_service_that_is_not_there_is_named(endpoint: str) -> None:
    with pytest.raises(BadInput, match="no participant is called 'nobody'; none lives in deployment 'local'"):
        conform(endpoint, "nobody", None, None, (), Console(file=StringIO()))
    with pytest.raises(BadInput, match="table of conformance checks: no row 'momentun'; did you mean 'momentum'"):
        conform(endpoint, "nobody", None, None, ("momentun",), Console(file=StringIO()))
