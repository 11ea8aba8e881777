"""An interrupt while two participants work at once, in one process."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator

import pytest

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Commit, Reply, Request
from softseam_services.orchestrator import embedded
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.server import ParticipantServer

LONG = 0.2
"""[s] that the slow one works on after the interrupt"""


@pytest.fixture(autouse=True)
def _interruptible() -> Iterator[None]:
    """A process that a shell has put into the background ignores interrupts, and so do those that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Slow(ParticipantServer):
    """Says when it has begun and ended; where asked to, it interrupts the main thread, which waits for it by then."""

    def __init__(self, interrupts: bool) -> None:
        super().__init__()
        self.began, self.ended, self._interrupts = threading.Event(), threading.Event(), interrupts

    def handle(self, request: Request) -> Reply:
        self.began.set()
        work = threading.Event()
        work.wait(LONG)
        if self._interrupts:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        work.wait(LONG)
        self.ended.set()
        return super().handle(request)


class Quick(ParticipantServer):
    """Waits until the other has begun; interrupted itself, or not."""

    def __init__(self, other: Slow, interrupted: bool) -> None:
        super().__init__()
        self._other, self._interrupted = other, interrupted

    def handle(self, request: Request) -> Reply:
        assert self._other.began.wait(10.0)
        if self._interrupted:
            raise KeyboardInterrupt
        return super().handle(request)


@pytest.mark.parametrize("who", ["at work", "waiting"])
def test_an_interrupt_leaves_nobody_at_work(who: str, monkeypatch: pytest.MonkeyPatch) -> None:
    transport = EmbeddedTransport()
    slow = Slow(interrupts=who == "waiting")
    servers = iter((slow, Quick(slow, interrupted=who == "at work")))
    monkeypatch.setattr(embedded, "ParticipantServer", lambda: next(servers))
    monkeypatch.setattr(embedded, "WORTH_A_THREAD", -1.0)  # nothing is too short for one
    requests = {name: Commit(Header(SCHEMA_VERSION, "test", name, 0, 0, 0, 0.0)) for name in ("near", "far")}
    with pytest.raises(KeyboardInterrupt):
        transport.exchange(requests)
    assert slow.ended.is_set()
    transport.close()
