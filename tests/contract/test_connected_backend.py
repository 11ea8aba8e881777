"""What a connected session makes of an orchestrator and a recorder that do not do as they are asked."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from squeeze import Squeeze

from softseam import connected
from softseam.connected import ConnectedBackend
from softseam.errors import NoConnection, ServicesFailed
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.inbox import Inbox, LiveChange
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.errors import Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Failure
from softseam_protocol.messages.recording import End
from softseam_protocol.messages.session import Close, Observation, StepReport
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode

pytestmark = pytest.mark.kernels

KEYS = Keys()


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(where):
        yield where


def at_rest() -> Observation:
    header = Header(SCHEMA_VERSION, "s", "", 0, 0, 0, 0.0)
    none, zero = np.zeros((0, 3)), np.zeros(3)
    report = StepReport(
        header, -1, none, np.zeros((0, 4)), np.zeros((0, 6)), {}, {}, {}, {}, zero, zero,
        0.0, {}, False, none,
    )  # fmt: skip
    return Observation(header, report, {}, [])


def serve(endpoint: str, key: str, answer: Callable[[bytes], bytes], role: str) -> Bus:
    """One process's part, with its token."""
    bus = Bus(endpoint, role=SERVICE)
    bus.serve({key: answer}).start()
    bus.declare_live(KEYS.live(role, role, "only"))
    return bus


def opened(endpoint: str, *, record: bool, timeout: float = 20.0) -> ConnectedBackend:
    return ConnectedBackend(Squeeze(1).bundle, endpoint, record=record, timeout=timeout)


def refusing_to_close(payload: bytes) -> bytes:
    if isinstance(decode(payload), Close):
        raise Refused(Failure(FailureKind.BUSY, "the request before is still at work: close again"))
    return encode(at_rest())


def test_why_there_is_no_recording_is_told(endpoint: str) -> None:
    """A session that is not closed, or not recorded, closes here all the same, and says what it was told."""

    def unrecorded(payload: bytes) -> bytes:
        if isinstance(decode(payload), End):
            raise Refused(Failure(FailureKind.NOT_CONFIGURED, "the recorder refused: it was not being recorded"))
        return refusing_to_close(payload)

    with serve(endpoint, KEYS.orchestrator, unrecorded, "orchestrator"):
        backend = opened(endpoint, record=True)
        backend.close()
        assert backend.recorded is None
        assert backend.unrecorded.startswith("the recorder refused: it was not being recorded; the session")
        assert backend.unrecorded.endswith("not closed either: the request before is still at work: close again")
    with serve(endpoint, KEYS.orchestrator, refusing_to_close, "orchestrator") as orchestrator:
        backend = opened(endpoint, record=True)
        orchestrator.close()
        backend.close()
        assert backend.unrecorded.startswith("no recorder answered: ")


def test_an_orchestrator_that_shows_itself_and_is_deaf_is_asked_now_and_then(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be about to serve, or about to go: ten requests a second find out."""
    timeout = 2.0
    with Bus(endpoint, role=SERVICE) as holder:
        orchestrator = serve(endpoint, KEYS.orchestrator, lambda payload: encode(at_rest()), "orchestrator")
        backend = opened(endpoint, record=False, timeout=timeout)
        holder.declare_live(KEYS.live("orchestrator", "orchestrator", "deaf"))
        orchestrator.close()
        asked = 0
        call = Bus.call

        def counted(bus: Bus, key: str, message: object, allowed: object, left: float) -> object:
            nonlocal asked
            asked += 1
            return call(bus, key, message, allowed, left)

        monkeypatch.setattr(Bus, "call", counted)
        with pytest.raises(ServicesFailed, match="softseam up"):
            backend.reset(1)
        assert 1 < asked <= 10.0 * timeout + 2
        backend.close()


def test_a_session_is_opened_by_an_orchestrator_that_comes_late(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is being restarted: it is there only after a session has asked in vain."""
    watch, missed = Bus.watch_live, threading.Event()

    def waiting(bus: Bus, key: str) -> Inbox[LiveChange]:
        missed.set()
        return watch(bus, key)

    monkeypatch.setattr(Bus, "watch_live", waiting)
    with ThreadPoolExecutor() as pool:
        opening = pool.submit(ConnectedBackend, Squeeze(1).bundle, endpoint, record=False, timeout=20.0)
        assert missed.wait(10.0), "it gave up at once"
        with serve(endpoint, KEYS.orchestrator, lambda payload: encode(at_rest()), "orchestrator"):
            opening.result(20.0).close()


def test_who_waits_in_vain_to_be_opened_says_so_soon(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connected, "RESTART", 1.0)
    began = time.monotonic()
    with pytest.raises(NoConnection, match="softseam up"):
        ConnectedBackend(Squeeze(1).bundle, endpoint, record=False, timeout=60.0)
    assert 0.5 < time.monotonic() - began < 10.0
