"""Requests to a server that is watched: who dies without an answer is given up soon, whatever the timeout."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from softseam_protocol.bus import Bus, Router, WatchedAsker
from softseam_protocol.codec import decode, encode
from softseam_protocol.errors import BusTimeout, NoReply, Refused
from softseam_protocol.inbox import Inbox
from softseam_protocol.live_tokens import LiveTokens
from softseam_protocol.messages import SCHEMA_VERSION, Commit, Committed, Failure, Header
from softseam_protocol.topics import Keys
from softseam_protocol.watched_asker import GRACE

KEYS = Keys("watched")
KEY = KEYS.orchestrator
EVERY = KEYS.every_live("orchestrator")
HEADER = Header(SCHEMA_VERSION, "s", "near", 0, 1, 0, 0.0)
LONG = 60.0
"""timeout of requests that must not need it [s]"""
SOON = GRACE + 4.0
"""far below it, and enough for a busy machine [s]"""
_SERVER = """
import sys
from softseam_protocol.bus import Bus
bus = Bus(sys.argv[1])
server = bus.serve({sys.argv[2]: bytes})
bus.declare_live(sys.argv[3])
print("ready", flush=True)
server.run()
"""


class Hanging:
    """A server that answers when it is let go, and a token of another session: one can go without the other."""

    def __init__(self, endpoint: str, instance: str) -> None:
        self.asked, self.released = threading.Event(), threading.Event()
        self._bus, self._holder = Bus(endpoint), Bus(endpoint)
        self._bus.serve({KEY: self._handle}).start()
        self._holder.declare_live(KEYS.live("orchestrator", "orchestrator", instance))

    def _handle(self, payload: bytes) -> bytes:
        header = decode(payload, Commit).header
        if header.step == 0:
            raise Refused(Failure("stale", "step 0 is over"))
        if header.step > 1:
            self.asked.set()
            self.released.wait(30.0)
        return encode(Committed(header))

    def lose_token(self) -> None:
        self._holder.close()

    def close(self) -> None:
        self.released.set()
        self._holder.close()
        self._bus.close()


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(where):
        yield where


@pytest.fixture
def server(endpoint: str, request: pytest.FixtureRequest) -> Iterator[Hanging]:
    hanging = Hanging(endpoint, request.node.name[:60])
    yield hanging
    hanging.close()


def ask(asker: WatchedAsker, step: int) -> Committed:
    header = Header(SCHEMA_VERSION, "s", "near", 0, step, 0, 0.0)
    reply: Committed = asker.call(Commit(header), Committed)
    assert reply.header == header
    return reply


def asker_of(bus: Bus, timeout: float = LONG) -> WatchedAsker:
    """One that has reached the server and knows its token."""
    watch = bus.watch_live(EVERY)
    came = watch.get(5.0)
    assert came is not None and came.alive
    asker = bus.watched_asker(KEY, timeout, EVERY)
    end = time.monotonic() + 5.0
    while True:
        try:
            ask(asker, 1)
            return asker
        except NoReply:  # the router has not introduced the two yet
            assert time.monotonic() < end


def test_a_server_that_goes_without_an_answer_is_given_up(endpoint: str, server: Hanging) -> None:
    with Bus(endpoint) as bus:
        asker = asker_of(bus)

        def lose_token_when_asked() -> None:
            if server.asked.wait(10.0):
                server.lose_token()

        lost = threading.Thread(target=lose_token_when_asked)
        lost.start()
        began = time.monotonic()
        with pytest.raises(NoReply, match="its server died"):
            ask(asker, 2)
        assert time.monotonic() - began < SOON
        lost.join()


def test_a_server_that_has_gone_already_is_given_up(endpoint: str, server: Hanging) -> None:
    """The request was sent after the token had gone, and still reached somebody who does not answer."""
    with Bus(endpoint) as bus:
        asker = asker_of(bus)
        watch = bus.watch_live(EVERY)
        server.lose_token()
        changes = [watch.get(5.0), watch.get(5.0)]
        assert [change is not None and change.alive for change in changes] == [True, False]
        began = time.monotonic()
        with pytest.raises(NoReply, match="its server died"):
            ask(asker, 2)
        assert time.monotonic() - began < SOON
        server.released.set()
        assert ask(asker, 1)  # one that does answer is heard


def test_the_last_answer_of_a_server_that_goes_is_taken(endpoint: str, server: Hanging) -> None:
    with Bus(endpoint) as bus:
        asker = asker_of(bus)
        watch = bus.watch_live(EVERY)
        assert watch.get(5.0) is not None

        def go() -> None:
            server.asked.wait(10.0)
            server.lose_token()
            watch.get(5.0)
            server.released.set()

        going = threading.Thread(target=go)
        going.start()
        assert ask(asker, 2)
        going.join()


def test_the_going_of_another_server_ends_no_wait(endpoint: str, server: Hanging) -> None:
    """Two of a kind show their tokens, as where one is being replaced: which of them was asked, nobody knows."""
    with Bus(endpoint) as bus, Bus(endpoint) as old:
        asker = asker_of(bus)
        watch = bus.watch_live(EVERY)
        old.declare_live(KEYS.live("orchestrator", "orchestrator", "old"))
        while (change := watch.get(5.0)) is not None and not change.key.endswith("/old"):
            continue
        answers: list[Committed] = []
        asking = threading.Thread(target=lambda: answers.append(ask(asker, 2)))
        asking.start()
        assert server.asked.wait(10.0)
        old.close()
        while (change := watch.get(5.0)) is not None and change.alive:
            continue
        asking.join(GRACE + 0.5)
        assert asking.is_alive()
        server.released.set()
        asking.join(10.0)
        assert len(answers) == 1


def test_every_failure_has_its_error(endpoint: str, server: Hanging) -> None:
    """As it has with any other request; a server that shows no token is waited for as long."""
    with Bus(endpoint) as bus:
        asker = asker_of(bus)
        with pytest.raises(Refused, match="step 0 is over"):
            ask(asker, 0)
        with pytest.raises(BusTimeout, match=r"within 0\.2 s"):
            asker.call(Commit(Header(SCHEMA_VERSION, "s", "near", 0, 2, 0, 0.0)), Committed, 0.2)
        server.released.set()
        assert ask(asker, 2)
        nobody = bus.watched_asker(KEYS.recorder, LONG, KEYS.every_live("recorder"))
        with pytest.raises(NoReply, match="nobody serves it"):
            ask(nobody, 1)
        server.released.clear()
        other = bus.watched_asker(KEY, GRACE + 0.5, KEYS.every_live("recorder"))
        began = time.monotonic()
        with pytest.raises(BusTimeout):
            ask(other, 2)
        assert time.monotonic() - began > GRACE + 0.4


def test_a_request_at_the_moment_of_a_kill_ends_soon(endpoint: str) -> None:
    """Before, in, or after the millisecond in which the router learns of it: an error, and no wait for the timeout."""
    key = KEYS.echo("victim")
    with Bus(endpoint) as bus:
        asker = bus.watched_asker(key, LONG, KEYS.every_live("participant"))
        for n in range(5):
            token = KEYS.live("participant", "victim", f"i{n}")
            with subprocess.Popen(
                [sys.executable, "-c", _SERVER, endpoint, key, token], stdout=subprocess.PIPE, text=True
            ) as process:
                try:
                    assert process.stdout is not None and process.stdout.readline() == "ready\n"
                    end = time.monotonic() + 5.0
                    while token not in bus.live(KEYS.every_live("participant")):
                        assert time.monotonic() < end
                    began = time.monotonic()
                    process.send_signal(signal.SIGKILL)
                    while time.monotonic() - began < 0.0005 * n:
                        continue
                    with pytest.raises(NoReply, match="victim"):
                        asker.call(Commit(HEADER), Committed)
                    assert time.monotonic() - began < SOON
                finally:
                    process.kill()


def test_what_waits_is_forgotten() -> None:
    """Each request listens to the tokens; one that is over leaves nothing behind."""
    tokens = LiveTokens()
    for _ in range(100):
        inbox: Inbox[object] = Inbox()
        assert not tokens.tell(inbox)
        inbox.close()
    assert len(tokens._inboxes) == 1
    tokens.heard("a", True)
    tokens.heard("a", False)
    assert tokens.tell(Inbox())
