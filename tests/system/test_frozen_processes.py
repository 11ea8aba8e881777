"""Processes of the bus that are frozen again and again, each for about the lease or longer: all are heard of again."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import pytest

from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.bus.session import LEASE
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions

pytestmark = pytest.mark.slow

KEYS = Keys("frozen")
SLEEPERS, SECONDS = 6, 20.0
BACK = 30.0
"""longest time until one is heard of again: zenoh gives leaving a bus whose links are full 10 s [s]"""
SETTLED = 2.5 * LEASE
"""time after which one that is heard of has been looked at by all [s]"""
PROGRAM = """
import sys, threading
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions
with BusOptions(connect=sys.argv[1]).open() as bus:
    bus.declare_live(Keys("frozen").live("participant", sys.argv[2], "i"))
    threading.Event().wait()
"""


class Sleeper:
    """A process that shows a token, and is stopped and continued."""

    def __init__(self, endpoint: str, name: str) -> None:
        self.token = KEYS.live("participant", name, "i")
        self.process = subprocess.Popen([sys.executable, "-c", PROGRAM, endpoint, name])
        self.is_frozen = False
        self.due = 0.0
        """when it is to be frozen next"""
        self.timer: threading.Timer | None = None
        self.last = time.monotonic()
        """when it was heard of last, or thawed"""
        self.times = 0

    def freeze(self) -> None:
        """For about the lease or longer; a thread of its own thaws it, whoever waits for an answer meanwhile."""
        self.is_frozen = True
        self.process.send_signal(signal.SIGSTOP)
        self.timer = threading.Timer(random.uniform(0.7, 3.0) * LEASE, self.thaw)
        self.timer.start()

    def thaw(self) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.times += 1
        self.last = time.monotonic()
        self.due = self.last + SETTLED + random.uniform(0.0, 1.0)
        self.is_frozen = False

    def close(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
        os.kill(self.process.pid, signal.SIGCONT)
        self.process.kill()
        self.process.wait()


@pytest.fixture
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(endpoint):
        yield endpoint


def heard(buses: Sequence[Bus]) -> set[str]:
    """Who is heard of on each."""
    return set.intersection(*(bus.live(KEYS.every_live("participant")) for bus in buses))


@pytest.mark.slow
def test_all_are_heard_of_again(endpoint: str) -> None:
    """By another peer, and by a client of the router, which answers for all that have no link with them."""
    random.seed(3)
    with BusOptions(connect=endpoint).open() as peer, Bus(endpoint, role=SERVICE) as client, ExitStack() as stack:
        sleepers = [Sleeper(endpoint, f"sleeper-{i}") for i in range(SLEEPERS)]
        for one in sleepers:
            stack.callback(one.close)
        deadline = time.monotonic() + 30.0
        while len(heard((peer, client))) < SLEEPERS:
            assert time.monotonic() < deadline, "they do not come up"
            time.sleep(0.1)  # the pace of asking
        end, tokens = time.monotonic() + SECONDS, set[str]()
        while time.monotonic() < end or any(one.is_frozen or one.token not in tokens for one in sleepers):
            tokens = heard((peer, client))
            for one in sleepers:
                now = time.monotonic()
                if one.is_frozen:
                    continue
                if one.token not in tokens:
                    assert now < one.last + BACK, f"frozen {one.times} times, and not heard of again"
                else:
                    one.last = now
                    if one.due < now < end:
                        one.freeze()
            time.sleep(0.05)  # the pace of asking and of freezing
        assert sum(one.times for one in sleepers) >= 2 * SLEEPERS
