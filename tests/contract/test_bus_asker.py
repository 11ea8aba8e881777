"""Asking one key again and again: as quick to fail, and as sure to reach a server, as any other request."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from softseam_protocol.bus.asking import Asker
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.bus.session import LEASE
from softseam_protocol.errors import BusError, BusTimeout, ForkedBus, NoReply, Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Commit, Committed, Failure
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode

KEYS = Keys("asker")
KEY = KEYS.participant("fem")
HEADER = Header(SCHEMA_VERSION, "s", "near", 0, 1, 0, 0.0)
PEER = {"mode": "peer", "listen/endpoints": ["tcp/127.0.0.1:0"]}
_SERVER = """
import sys, threading
from softseam_protocol.bus.client import Bus
bus = Bus(sys.argv[1], role='service')
def handle(payload):
    if payload == b"hang":
        print("hanging", flush=True)
        threading.Event().wait()
    return payload
server = bus.serve({sys.argv[2]: handle})
print("ready", flush=True)
server.run()
"""


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(where):
        yield where


def wait_served(bus: Bus, key: str) -> None:
    """Until somebody answers; a death in between is waited for as well."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        try:
            bus.request(key, b"", 1.0)
            return
        except NoReply:
            continue
        except Refused:
            return
    raise AssertionError(f"nobody serves {key}")


@pytest.mark.parametrize("extra", [{}, PEER], ids=["client", "peer"])
def test_the_first_question_is_answered(endpoint: str, extra: dict[str, object]) -> None:
    """An asker that was made a moment ago reaches whom a plain request reaches, many times over."""
    with Bus(endpoint, extra=PEER, role=SERVICE) as other:
        other.serve({KEY: bytes}).start()
        for _ in range(25):
            with Bus(endpoint, extra=extra, role=SERVICE) as bus:
                wait_served(bus, KEY)
                asker = bus.asker(KEY, 5.0)
                assert [asker.start(bytes([i])).collect() for i in range(3)] == [b"\0", b"\1", b"\2"]


def test_every_failure_has_its_error(endpoint: str) -> None:
    """Nobody there, a refusal, a server that hangs."""
    release = threading.Event()

    def handle(payload: bytes) -> bytes:
        if payload == b"refuse":
            raise Refused(Failure(FailureKind.STALE, "step 3 is over"))
        if payload == b"hang":
            release.wait(10.0)
            return payload
        return encode(Committed(decode(payload, Commit).header))

    with Bus(endpoint, role=SERVICE) as bus, Bus(endpoint, role=SERVICE) as other:
        asker = bus.asker(KEY, 5.0)
        with pytest.raises(NoReply, match="nobody serves it"):
            asker.start(b"x").collect()
        other.serve({KEY: handle}).start()
        wait_served(bus, KEY)
        assert asker.call(Commit(HEADER), Committed) == Committed(HEADER)
        with pytest.raises(Refused, match="step 3 is over"):
            asker.start(b"refuse").collect()
        with pytest.raises(BusTimeout, match=r"within 0\.2 s"):
            bus.asker(KEY, 0.2).start(b"hang").collect()
        release.set()


@pytest.mark.kernels
def test_a_server_that_dies_and_comes_back(endpoint: str) -> None:
    """A kill in the middle of a request is an error at once; the next server is asked by the same asker."""
    key = KEYS.echo("victim")
    with Bus(endpoint, role=SERVICE) as bus:
        asker: Asker | None = None
        for _ in range(2):
            with subprocess.Popen(
                [sys.executable, "-c", _SERVER, endpoint, key], stdout=subprocess.PIPE, text=True
            ) as process:
                try:
                    assert process.stdout is not None and process.stdout.readline() == "ready\n"
                    wait_served(bus, key)
                    asker = asker or bus.asker(key, 20.0)
                    assert asker.start(b"well?").collect() == b"well?"
                    pending = asker.start(b"hang")
                    assert process.stdout.readline() == "hanging\n"
                    began = time.monotonic()
                    process.send_signal(signal.SIGKILL)
                    with pytest.raises(NoReply, match="victim"):
                        pending.collect()
                    assert time.monotonic() - began < 5.0
                finally:
                    process.kill()


@pytest.mark.kernels
def test_a_request_at_the_moment_of_a_kill_ends_at_once(endpoint: str) -> None:
    """Before, in, or after the millisecond in which the router learns of it: an error, and no wait for the timeout."""
    key = KEYS.echo("struck")
    with Bus(endpoint, role=SERVICE) as bus:
        asker = bus.asker(key, 60.0)
        for n in range(6):
            with subprocess.Popen(
                [sys.executable, "-c", _SERVER, endpoint, key], stdout=subprocess.PIPE, text=True
            ) as process:
                try:
                    assert process.stdout is not None and process.stdout.readline() == "ready\n"
                    wait_served(bus, key)
                    began = time.monotonic()
                    process.send_signal(signal.SIGKILL)
                    while time.monotonic() - began < 0.0005 * n:
                        continue
                    with pytest.raises(NoReply, match="struck"):
                        asker.start(b"hang").collect()
                    assert time.monotonic() - began < 5.0
                finally:
                    process.kill()


@pytest.mark.kernels
def test_a_server_that_is_frozen_in_a_request_is_given_up_after_the_lease(endpoint: str) -> None:
    key = KEYS.echo("frozen")
    with (
        Bus(endpoint, role=SERVICE) as bus,
        subprocess.Popen([sys.executable, "-c", _SERVER, endpoint, key], stdout=subprocess.PIPE, text=True) as process,
    ):
        try:
            assert process.stdout is not None and process.stdout.readline() == "ready\n"
            wait_served(bus, key)
            pending = bus.asker(key, 60.0).start(b"hang")
            assert process.stdout.readline() == "hanging\n"
            began = time.monotonic()
            process.send_signal(signal.SIGSTOP)
            with pytest.raises(NoReply, match="frozen"):
                pending.collect()
            assert time.monotonic() - began < LEASE + 4.0
        finally:
            process.send_signal(signal.SIGCONT)
            process.kill()


def test_a_closed_or_inherited_bus_says_so(endpoint: str) -> None:
    with Bus(endpoint, role=SERVICE) as bus, Bus(endpoint, role=SERVICE) as other:
        other.serve({KEY: bytes}).start()
        wait_served(bus, KEY)
        asker = bus.asker(KEY, 5.0)
        assert asker.start(b"x").collect() == b"x"
        child = os.fork()
        if child == 0:
            try:
                asker.start(b"x")
            except ForkedBus:
                os._exit(7)
            os._exit(1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
        asker.close()
        assert asker.start(b"as any other request").collect() == b"as any other request"
    with pytest.raises(BusError, match="closed"):
        asker.start(b"x")
