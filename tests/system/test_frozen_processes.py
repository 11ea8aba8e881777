"""Processes of the bus that are frozen again and again, each for about the lease or longer: all are heard of again."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from softseam_protocol.bus import Bus, Router
from softseam_protocol.bus_session import LEASE
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions

pytestmark = pytest.mark.slow

KEYS = Keys("frozen")
SLEEPERS, SECONDS = 6, 40.0
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
        """when it is to be frozen, or thawed, next"""
        self.last = time.monotonic()
        """when it was heard of last, or thawed"""
        self.times = 0

    def freeze(self) -> None:
        self.process.send_signal(signal.SIGSTOP)
        self.is_frozen, self.due = True, time.monotonic() + random.uniform(0.7, 3.0) * LEASE

    def thaw(self) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.is_frozen, self.last = False, time.monotonic()
        self.due = self.last + SETTLED + random.uniform(0.0, 1.0)
        self.times += 1

    def close(self) -> None:
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


def live(bus: Bus) -> set[str]:
    return bus.live(KEYS.every_live("participant"))


def test_all_are_heard_of_again(endpoint: str) -> None:
    random.seed(3)
    with BusOptions(connect=endpoint).open() as bus, ExitStack() as stack:
        sleepers = [Sleeper(endpoint, f"sleeper-{i}") for i in range(SLEEPERS)]
        for one in sleepers:
            stack.callback(one.close)
        deadline = time.monotonic() + 30.0
        while len(live(bus)) < SLEEPERS:
            assert time.monotonic() < deadline, "they do not come up"
            time.sleep(0.1)
        end = time.monotonic() + SECONDS
        heard = live(bus)
        while time.monotonic() < end or any(one.is_frozen or one.token not in heard for one in sleepers):
            heard = live(bus)
            for one in sleepers:
                now = time.monotonic()
                if one.is_frozen:
                    if now > one.due:
                        one.thaw()
                elif one.token not in heard:
                    assert now < one.last + BACK, f"frozen {one.times} times, and not heard of again"
                else:
                    one.last = now
                    if one.due < now < end:
                        one.freeze()
            time.sleep(0.05)
        assert min(one.times for one in sleepers) >= 3
