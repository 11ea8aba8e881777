"""What keys cost: `python tests/benchmarks/keys.py`. Round trips with keys and without, by turns, in one run.

Two routers, each with a service and a client of its own; of one pair sessions show no key, and nothing is asked for. A
client's round trip goes by the router, where access is controlled; a service's goes directly. Two of a kind by turns,
2,000 of each kind; prints the least and the median [us], and what keys add.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import numpy as np

from softseam_protocol.bus import client
from softseam_protocol.bus.asking import Asker
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import CLIENT, SERVICE
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions

BLOCKS, ROUNDS = 1000, 2
PAYLOAD = bytes(2000)
KEY = Keys().orchestrator


def without_keys() -> None:
    """From now on sessions of this process show none, and ask for none."""
    vars(client)["settings_of"] = lambda *args, **options: {}


def serve(endpoint: str, role: str) -> None:
    """One process: the router, or a service that sends back what it gets."""
    if role == "router":
        with Router(endpoint):
            sys.stdin.read()
    else:
        with BusOptions(connect=endpoint).open() as bus:
            bus.serve({KEY: bytes}).start()
            sys.stdin.read()


@contextmanager
def processes(endpoint: str, keys: bool) -> Iterator[None]:
    started = []
    try:
        for role in ("router", "service"):
            argv = (sys.executable, __file__, endpoint, role, "keys" if keys else "none")
            started.append(subprocess.Popen(argv, stdin=subprocess.PIPE))
        yield
    finally:
        for each in reversed(started):
            each.communicate()


def block(asker: Asker) -> list[float]:
    spent = []
    for _ in range(ROUNDS):
        began = perf_counter()
        asker.start(PAYLOAD).collect()
        spent.append(perf_counter() - began)
    return spent


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def joined(endpoint: str, role: str) -> Bus:
    bus = BusOptions(connect=endpoint).open() if role == SERVICE else Bus(endpoint, 20.0)
    if not bus.wait_answers(Keys().every_live(), KEY):
        raise RuntimeError("the service does not answer")
    return bus


def main() -> None:
    secured, plain = free_endpoint(), free_endpoint()
    with processes(secured, True), processes(plain, False):
        buses = {("with keys", role): joined(secured, role) for role in (CLIENT, SERVICE)}
        without_keys()
        buses |= {("without", role): joined(plain, role) for role in (CLIENT, SERVICE)}
        askers = {name: bus.asker(KEY, 10.0) for name, bus in buses.items()}
        for asker in askers.values():
            block(asker)
        spent: dict[tuple[str, str], list[float]] = {name: [] for name in askers}
        for _ in range(BLOCKS):
            for name, asker in askers.items():
                spent[name] += block(asker)
        for bus in buses.values():
            bus.close()
    figures = {name: 1e6 * np.array([min(each), np.median(each)]) for name, each in spent.items()}
    for role in (CLIENT, SERVICE):
        one, other = figures["with keys", role], figures["without", role]
        added = 100.0 * (one / other - 1.0)
        print(f"{role}: least {one[0]:.0f} for {other[0]:.0f} us ({added[0]:+.1f} %), ", end="")
        print(f"median {one[1]:.0f} for {other[1]:.0f} us ({added[1]:+.1f} %)")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        if sys.argv[3] == "none":
            without_keys()
        serve(sys.argv[1], sys.argv[2])
    else:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["SOFTSEAM_KEYS"] = str(Path(folder) / "keys")
            main()
