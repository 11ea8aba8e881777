"""Malformed, oversized, foreign, stale and repeated requests are answered with a typed error and change nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from real_services import Services
from trajectory import bits

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import DecodeError, Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Bundle,
    Configure,
    Configured,
    Observe,
    Release,
    Released,
    Snapshot,
    SnapshotTaken,
    ToolMotion,
)
from softseam_protocol.messages.session import Close, Observation, Open, Save, Saved, Step
from softseam_protocol.participant.handler import ParticipantHandler
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import MAX_BYTES, decode, encode
from softseam_services.server import ParticipantServer

pytestmark = pytest.mark.slow
KEYS = Keys()
WAIT = 60.0


def header(step: int = 0, exchange: int = 0, session: str = "stranger", participant: str = "near") -> Header:
    return Header(SCHEMA_VERSION, session, participant, 0, step, exchange, 0.01 * step)


def client_header(number: int, session: str = "client") -> Header:
    return Header(SCHEMA_VERSION, session, "", 0, 0, number, 0.0)


def advance(step: int, exchange: int = 0) -> Advance:
    still = np.array([[0.0, 0.0, 0.0], [0.02, -0.0205, 0.021], [0.02, 0.0205, 0.021]])
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    motion = ToolMotion(still, upright, still, upright)
    return Advance(header(step, exchange), 0.01, np.full((0, 3), 0.0), motion)


@pytest.fixture(scope="module", autouse=True)
def said_before(services: Services) -> int:
    """How many lines the supervisor had said, with all services well, when the tests of this file began."""
    services.wait_well()
    return len(services.lines.lines)


@pytest.fixture
def seat(bus: Bus, bar: Bundle) -> Iterator[str]:
    """A configured participant of a session of its own; the key of its service."""
    key = KEYS.participant("pbd")
    cells = np.arange(4, dtype=np.int32)
    bus.call(key, Configure(header(), bar, "pbd", cells, np.zeros(0, np.int32)), Configured, WAIT)
    yield key
    bus.call(key, Release(header()), Released, WAIT)


def state(bus: Bus, key: str, step: int) -> object:
    return bits(bus.call(key, Snapshot(header(step)), SnapshotTaken, WAIT).state)


def refusal(bus: Bus, key: str, payload: bytes) -> Refused:
    with pytest.raises(Refused) as caught:
        bus.request(key, payload, WAIT)
    return caught.value


@pytest.mark.parametrize("service", ["pbd", "fem", "orchestrator"])
def test_noise_is_refused_by_type(bus: Bus, service: str) -> None:
    key = KEYS.orchestrator if service == "orchestrator" else KEYS.participant(service)
    for payload in (b"", b"\x00", b"hello", bytes(range(256)) * 100, bytes(1 << 20)):
        assert refusal(bus, key, payload).failure.kind == "invalid"


def test_damaged_requests_are_refused_and_change_nothing(bus: Bus, seat: str) -> None:
    """Every prefix and many single flipped bits of a real request."""
    bus.call(seat, advance(0), Advanced, WAIT)
    before = state(bus, seat, 1)
    good = encode(advance(1))
    rng = np.random.default_rng(0)
    for cut in range(0, len(good), 37):
        assert refusal(bus, seat, good[:cut]).failure.kind in ("invalid", "schema", "stale", "not_configured")
    answered = 0
    for _ in range(60):
        damaged = bytearray(good)
        damaged[rng.integers(len(good) - 300)] ^= 1 << rng.integers(8)
        try:
            reply = decode(bus.request(seat, bytes(damaged), WAIT))
        except Refused as error:
            assert error.failure.kind in ("invalid", "schema", "stale", "not_configured"), error
        else:
            answered += 1  # the flipped bit was a number's: a request as good as any
            assert isinstance(reply, Advanced)
    if answered == 0:
        assert state(bus, seat, 1) == before


def test_an_oversized_message_is_refused_before_it_is_read() -> None:
    handler = ParticipantHandler(ParticipantServer(), ("pbd",))
    with pytest.raises(DecodeError, match=r"byte|MiB|large"):
        handler(bytes(MAX_BYTES + 1))
    assert handler.refused["invalid"] == 1


@pytest.mark.parametrize("service", ["pbd", "orchestrator"])
def test_another_schema_version_is_named(bus: Bus, bar: Bundle, service: str) -> None:
    other = replace(header(), schema=SCHEMA_VERSION + 1)
    if service == "pbd":
        error = refusal(bus, KEYS.participant("pbd"), encode(Observe(other)))
    else:
        error = refusal(bus, KEYS.orchestrator, encode(Open(other, bar)))
    assert error.failure.kind == "schema"
    assert str(SCHEMA_VERSION + 1) in error.failure.message and "version" in error.failure.message


def test_foreign_messages_are_refused(bus: Bus, bar: Bundle, seat: str) -> None:
    """Messages of the protocol, but for somebody else."""
    assert refusal(bus, seat, encode(Open(header(), bar))).failure.kind == "invalid"
    assert refusal(bus, KEYS.orchestrator, encode(advance(0))).failure.kind == "invalid"
    wrong_model = Configure(header(), bar, "fem", np.arange(4, dtype=np.int32), np.zeros(0, np.int32))
    assert "runs 'pbd', not 'fem'" in refusal(bus, seat, encode(wrong_model)).failure.message
    nobody = replace(advance(0), header=header(session="nobody"))
    assert refusal(bus, seat, encode(nobody)).failure.kind == "not_configured"


def test_a_repeated_request_gets_the_same_bytes(bus: Bus, seat: str) -> None:
    first = bus.request(seat, encode(advance(0)), WAIT)
    assert bus.request(seat, encode(advance(0)), WAIT) == first
    after = state(bus, seat, 1)
    bus.call(seat, advance(1), Advanced, WAIT)
    bus.call(seat, advance(1, 1), Advanced, WAIT)
    assert state(bus, seat, 2) != after


def test_a_stale_request_changes_nothing(bus: Bus, seat: str) -> None:
    for step in range(3):
        bus.call(seat, advance(step), Advanced, WAIT)
    before = state(bus, seat, 3)
    for old in (advance(0), advance(1, 5), advance(7)):
        assert refusal(bus, seat, encode(old)).failure.kind == "stale"
    assert state(bus, seat, 3) == before


def test_the_orchestrator_answers_a_request_once(bus: Bus, bar: Bundle) -> None:
    key, session = KEYS.orchestrator, "repeats"
    assert refusal(bus, key, encode(Save(client_header(1, session)))).failure.kind == "not_configured"
    opening = encode(Open(client_header(1, session), bar))
    opened = bus.request(key, opening, WAIT)
    assert bus.request(key, opening, WAIT) == opened
    assert refusal(bus, key, encode(Open(client_header(2, session), bar))).failure.kind == "invalid"
    step = encode(Step(client_header(3, session), 2, True, {}, False))
    first = bus.request(key, step, WAIT)
    assert bus.request(key, step, WAIT) == first
    assert decode(first, Observation).report.header.step == 1
    assert refusal(bus, key, encode(Step(client_header(2, session), 1, True, {}))).failure.kind == "stale"
    wrong = Step(client_header(4, session), 1, False, {"no_such_tool": np.zeros(3)})
    assert "no_such_tool" in refusal(bus, key, encode(wrong)).failure.message
    saved = bus.call(key, Save(client_header(5, session)), Saved, WAIT)
    assert saved.state
    bus.request(key, encode(Close(client_header(6, session))), WAIT)
    bus.request(key, encode(Close(client_header(6, session))), WAIT)
    assert refusal(bus, key, step).failure.kind == "not_configured"


def test_a_scene_that_cannot_be_simulated_is_refused(bus: Bus, bar: Bundle) -> None:
    broken = Bundle(bar.scene.replace('"poisson":0.4', '"poisson":0.6'), {})
    error = refusal(bus, KEYS.orchestrator, encode(Open(client_header(1, "broken"), broken)))
    assert error.failure.kind == "invalid" and "poisson" in error.failure.message


def test_services_are_well_after_all_that(services: Services, bus: Bus, said_before: int) -> None:
    services.wait_well()
    assert not any("restarting" in line for line in services.lines.lines[said_before:])
