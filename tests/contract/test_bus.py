"""The bus over a real router: every way a request can fail has its error, in bounded time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest
from asked import free_endpoint, served, until

from softseam_protocol.bus import client as bus_module
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.inbox import Inbox, Received
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.bus.server import MOST_WAITING
from softseam_protocol.errors import BusError, BusTimeout, DecodeError, ForkedBus, NoReply, Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Commit, Committed, Failure, Observe, Release
from softseam_protocol.messages.session import Event
from softseam_protocol.topics import Keys, Live
from softseam_protocol.wire.codec import decode, encode

KEYS = Keys("test")
KEY = KEYS.participant("fem")
HEADER = Header(SCHEMA_VERSION, "s", "near", 0, 1, 0, 0.0)


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = free_endpoint()
    with Router(where):
        yield where


@pytest.fixture
def bus(endpoint: str) -> Iterator[Bus]:
    with Bus(endpoint, role=SERVICE) as one:
        yield one


@pytest.fixture
def other(endpoint: str) -> Iterator[Bus]:
    with Bus(endpoint, role=SERVICE) as one:
        yield one


def test_request_gets_the_reply(bus: Bus, other: Bus) -> None:
    def handle(payload: bytes) -> bytes:
        return encode(Committed(decode(payload, Commit).header))

    server = other.serve({KEY: handle}).start()
    assert until(lambda: served(bus, KEY))
    assert bus.call(KEY, Commit(HEADER), Committed, 2.0) == Committed(HEADER)
    assert until(lambda: server.answered >= 1 and server.busy == 0.0)
    with pytest.raises(DecodeError, match=r"Committed where one of these belongs|answered with a Committed"):
        bus.call(KEY, Commit(HEADER), Release, 2.0)


def test_one_server_answers_several_keys_in_one_thread(bus: Bus, other: Bus) -> None:
    threads = set()

    def handle(payload: bytes) -> bytes:
        threads.add(threading.current_thread().name)
        return payload

    names = [KEYS.echo(f"p{i}") for i in range(3)]
    other.serve(dict.fromkeys(names, handle), name="solver").start()
    assert until(lambda: all(served(bus, name) for name in names))
    payloads = [bytes([i]) * (10 ** (i + 3)) for i in range(3)]
    pending = [bus.start(name, payload, 5.0) for name, payload in zip(names, payloads, strict=True)]
    assert [one.collect() for one in pending] == payloads
    assert threads == {"solver"}


def test_requests_to_several_servers_run_at_the_same_time(bus: Bus, other: Bus, endpoint: str) -> None:
    meeting = threading.Barrier(2, timeout=5.0)

    def handle(payload: bytes) -> bytes:
        if payload == b"meet":
            meeting.wait()
        return payload

    with Bus(endpoint, role=SERVICE) as third:
        other.serve({KEYS.echo("near"): handle}).start()
        third.serve({KEYS.echo("far"): handle}).start()
        assert until(lambda: served(bus, KEYS.echo("near")) and served(bus, KEYS.echo("far")))
        # each handler waits for the other: one after the other would break the barrier
        pending = [bus.start(KEYS.echo(name), b"meet", 5.0) for name in ("near", "far")]
        assert [one.collect() for one in pending] == [b"meet"] * 2


def test_nobody_serves_the_key(bus: Bus) -> None:
    began = time.monotonic()
    with pytest.raises(NoReply, match="test/participant/nobody/request: nobody serves it"):
        bus.request(KEYS.participant("nobody"), b"x", 5.0)
    assert time.monotonic() - began < 2.0


def test_a_hanging_server_is_a_timeout(bus: Bus, other: Bus) -> None:
    release = threading.Event()

    def hang(payload: bytes) -> bytes:
        release.wait(10.0)
        return payload

    key = KEYS.echo("slow")
    server = other.serve({key: hang}).start()
    try:
        assert until(lambda: _times_out(bus, key))
        assert server.busy > 0.0
    finally:
        release.set()


def _times_out(bus: Bus, key: str) -> bool:
    """Whether the server hangs; not where nobody is known to serve the key yet, or a link is made anew."""
    began = time.monotonic()
    try:
        bus.request(key, b"", 0.2)
    except NoReply:
        return False
    except BusTimeout as error:
        assert f"{key}: no answer within 0.2 s" in str(error)
        return 0.1 < time.monotonic() - began < 2.0
    return False


@pytest.mark.parametrize(
    ("payload", "kind", "text"),
    [
        (b"raise", "internal", "ZeroDivisionError"),
        (b"refuse", "stale", "step 3 is over"),
        (b"foreign", "invalid", "not a softseam message"),
        (b"\x0a\x12softseam.v9.Commit", "schema", "schema version 9"),
        (encode(Observe(HEADER)), "invalid", "Observe where one of these belongs: Commit"),
    ],
)
def test_a_failing_handler_answers_with_its_failure(bus: Bus, other: Bus, payload: bytes, kind: str, text: str) -> None:
    def handle(payload: bytes) -> bytes:
        if payload == b"raise":
            return bytes(1 // 0)
        if payload == b"refuse":
            raise Refused(Failure(FailureKind.STALE, "step 3 is over"))
        return encode(decode(payload, Commit))

    other.serve({KEY: handle}).start()
    assert until(lambda: served(bus, KEY, payload=encode(Commit(HEADER))))
    with pytest.raises(Refused, match=text) as caught:
        bus.request(KEY, payload, 2.0)
    assert caught.value.failure.kind == kind
    # the server goes on
    assert bus.request(KEY, encode(Commit(HEADER)), 2.0) == encode(Commit(HEADER))


_SERVER = """
import sys, threading
from softseam_protocol.bus.client import Bus
from softseam_protocol.topics import Keys
bus = Bus(sys.argv[1], role='service')
keys = Keys("test")
def handle(payload):
    if payload == b"hang":
        print("hanging", flush=True)
        threading.Event().wait()
    return payload
server = bus.serve({keys.echo("victim"): handle})
bus.declare_live(keys.live("participant", "victim", "i1"))
print("ready", flush=True)
server.run()
"""


@pytest.mark.kernels
def test_a_server_killed_in_a_request_is_an_error_at_once(bus: Bus, endpoint: str) -> None:
    with subprocess.Popen([sys.executable, "-c", _SERVER, endpoint], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "ready\n"
            watch = bus.watch_live(KEYS.every_live())
            came = watch.get(5.0)
            assert came is not None and came.alive
            assert KEYS.read_live(came.key) == Live("participant", "victim", "i1")
            assert bus.live(KEYS.every_live("participant")) == {came.key}
            assert until(lambda: served(bus, KEYS.echo("victim")))
            pending = bus.start(KEYS.echo("victim"), b"hang", 20.0)
            assert process.stdout.readline() == "hanging\n"
            began = time.monotonic()
            process.send_signal(signal.SIGKILL)
            with pytest.raises(NoReply, match="victim"):
                pending.collect()
            assert time.monotonic() - began < 5.0
            went = watch.get(5.0)
            assert went is not None and went.key == came.key and not went.alive
        finally:
            process.kill()


def test_published_messages_arrive_in_order_and_are_counted_when_lost(bus: Bus, other: Bus) -> None:
    inbox = other.subscribe(KEYS.session_all("s"))
    small = other.subscribe(KEYS.session_all("s"), limit_bytes=10)
    newest = other.subscribe(KEYS.session_all("s"), latest=True)
    key = KEYS.session("s", Event)
    assert until(lambda: _arrives(bus, key, inbox, b"start"))
    for i in range(20):
        bus.publish(key, bytes([i]) * 4)
    got: list[int] = []
    while len(got) < 20:
        item = inbox.get(5.0)
        assert item is not None
        if len(item.payload) == 4:
            got.append(item.payload[0])
    assert got == list(range(20))
    assert until(lambda: small.lost > 0) and inbox.lost == 0
    assert until(lambda: len(newest) == 1)
    last = newest.get(1.0)
    while last is not None and last.payload != bytes([19]) * 4:  # the newest so far
        last = newest.get(1.0)
    assert last is not None and last.key == key and len(newest) == 0
    assert newest.get(0.01) is None
    bus.forget(f"{KEYS.root}/session/s")


def test_whether_anybody_listens(bus: Bus, other: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unsure at first, which counts as yes; who subscribes and then asks is known before the question arrives."""
    key = KEYS.session("listened", Event)
    assert bus.listened(key)
    monkeypatch.setattr(bus_module, "INTRODUCTION", 0.0)
    assert not bus.listened(key)
    bus.serve({KEY: lambda _: b"yes" if bus.listened(key) else b"no"}).start()
    assert until(lambda: served(other, KEY))
    for _ in range(20):
        inbox = other.subscribe(KEYS.session_all())
        assert other.request(KEY, b"", 5.0) == b"yes"
        inbox.close()
        assert until(lambda: not bus.listened(key))


def test_who_reads_half_a_second_late_misses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports of a second and more wait on the way, with the system's own buffers small; zenoh's default is 153."""
    where, go, count = free_endpoint() + "#so_sndbuf=32768;so_rcvbuf=32768", threading.Event(), 300
    key, payload = KEYS.session("late", Event), bytes(1200)
    with Router(where), Bus(where, role=SERVICE) as bus, Bus(where, role=SERVICE) as other:
        inbox = other.subscribe(key)
        assert until(lambda: _arrives(bus, key, inbox, b"known"))
        while inbox.get(0.2) is not None:
            pass
        put = inbox.put
        monkeypatch.setattr(inbox, "put", lambda *item: (go.wait(10.0), put(*item)))
        for _ in range(count):
            bus.publish(key, payload, droppable=True)
            time.sleep(0.001)  # the pace of what is published
        go.set()
        assert until(lambda: len(inbox) == count), f"{len(inbox)} of {count}"


def _arrives(bus: Bus, key: str, inbox: Inbox[Received], payload: bytes) -> bool:
    bus.publish(key, payload)
    item = inbox.get(0.05)
    return item is not None and item.payload == payload


def test_a_full_server_says_busy(bus: Bus, other: Bus) -> None:
    release, key = threading.Event(), KEYS.echo("full")

    def handle(payload: bytes) -> bytes:
        release.wait(20.0)
        return payload

    server = other.serve({key: handle}).start()
    assert until(lambda: _times_out(bus, key))
    pending = [bus.start(key, b"x", 20.0) for _ in range(300)]
    assert until(lambda: server.waiting + server.turned_away >= 300)
    release.set()
    outcomes = []
    for one in pending:
        try:
            outcomes.append(one.collect())
        except Refused as error:
            outcomes.append(error.failure.kind.encode())
    assert outcomes.count(b"busy") == server.turned_away >= 300 - MOST_WAITING
    assert set(outcomes) == {b"x", b"busy"}


@pytest.mark.kernels
def test_a_forked_bus_refuses_to_work(endpoint: str) -> None:
    program = (
        "import os, sys\n"
        "from softseam_protocol.bus.client import Bus\n"
        "from softseam_protocol.errors import ForkedBus\n"
        "bus = Bus(sys.argv[1], role='service')\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    try:\n"
        "        bus.publish('softseam/test/x', b'')\n"
        "    except ForkedBus:\n"
        "        os._exit(7)\n"
        "    os._exit(1)\n"
        "code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])\n"
        "bus.close()\n"
        "sys.exit(0 if code == 7 else 1)\n"
    )
    assert subprocess.run([sys.executable, "-c", program, endpoint], timeout=30, check=False).returncode == 0
    assert issubclass(ForkedBus, BusError) and os.getpid() > 0


@pytest.mark.kernels
def test_forgetting_to_close_does_not_hang_the_interpreter(endpoint: str) -> None:
    program = (
        "import sys\n"
        "from softseam_protocol.bus.client import Bus\n"
        "bus = Bus(sys.argv[1], role='service')\n"
        "bus.serve({'softseam/test/forgotten': lambda p: p}).start()\n"
        "inbox = bus.subscribe('softseam/test/**')\n"
    )
    assert subprocess.run([sys.executable, "-c", program, endpoint], timeout=30, check=False).returncode == 0


def test_a_closed_bus_says_so(endpoint: str) -> None:
    one = Bus(endpoint, role=SERVICE)
    one.close()
    one.close()
    with pytest.raises(BusError, match="closed"):
        one.request(KEY, b"", 1.0)


@pytest.mark.parametrize("name", ["", "a/b", "a*", "@live", "x" * 65, "ä", "a b", "../x"])
def test_only_names_go_into_keys(name: str) -> None:
    for make in (Keys, KEYS.participant, KEYS.echo, lambda n: KEYS.live("client", n, "i")):
        with pytest.raises(ValueError, match="not a name"):
            make(name)
