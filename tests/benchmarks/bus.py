"""What the bus costs: `make bus`, or `python tests/benchmarks/bus.py [SCENE]`.

Starts real services and runs a scene embedded and over the bus, as FEM only, PBD only and hybrid. Prints the real-time
factor (RTF) that a client sees once everything is warm, what an exchange costs beyond the solvers' own work (median),
an echo of the same size to the same processes in the same run, and their ratio.
"""

from __future__ import annotations

import re
import socket
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import softseam
from softseam.variants import Model
from softseam_protocol.bus import Bus, Inbox, Received
from softseam_protocol.codec import decode
from softseam_protocol.facts import machine
from softseam_protocol.messages import Event
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor

ROOT = Path(__file__).resolve().parents[2]
MODELS: tuple[Model | None, ...] = (None, "fem", "pbd", "hybrid")
"""None: as the scene says"""
REPEATS = 3
"""runs of which the fastest counts: other work on the machine only slows down"""
_READY = 300.0
_TOLD = re.compile(r"cost (\d+) us .* takes (\d+) us")


@dataclass(frozen=True)
class Run:
    """One run on the bus; times in us."""

    rtf: float
    exchanges: float
    overhead: int
    echo: int


def rtf(session: softseam.Session) -> tuple[float, float]:
    """Real-time factor from the second step on, as the client sees it, and the mean exchanges a step."""
    session.reset()
    first = session.run(max_steps=1)
    exchanges: list[int] = []
    began = perf_counter()
    last = session.run(lambda seen: exchanges.append(seen.seam.exchanges))
    return (last.time - first.time) / (perf_counter() - began), sum(exchanges) / len(exchanges)


def embedded(scene: str, model: Model | None) -> float:
    with softseam.open(scene, model=model) as session:
        return max(rtf(session)[0] for _ in range(REPEATS))


def on_the_bus(scene: str, model: Model | None, endpoint: str, published: Inbox[Received]) -> Run:
    """The fastest of several runs; what an exchange cost is told when a session is closed."""
    runs = []
    for _ in range(REPEATS):
        with softseam.open(scene, endpoint, model=model) as session:
            factor, exchanges = rtf(session)
        runs.append(Run(factor, exchanges, *_told(published)))
    return max(runs, key=lambda run: run.rtf)


def _told(published: Inbox[Received]) -> tuple[int, int]:
    """Overhead of an exchange and echo, from the event that says so [us]."""
    while (received := published.get(5.0)) is not None:
        if received.key.endswith("/event"):
            event = decode(received.payload, Event)
            found = _TOLD.search(event.message) if event.kind == "bus" else None
            if found is not None:
                return int(found[1]), int(found[2])
    raise RuntimeError("no service told what the bus cost")


def main(scene: str) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        options = BusOptions(connect=f"tcp/127.0.0.1:{probe.getsockname()[1]}")
    print(f"{scene}, {machine()}\n")
    print("| model | RTF embedded | RTF on the bus | exchanges a step | overhead of one [us] | echo [us] | ratio |")
    print("|---|---|---|---|---|---|---|")
    with (
        tempfile.TemporaryDirectory() as folder,
        supervisor(UpOptions(options, Path(folder)), lambda line: None) as services,
    ):
        if not services.wait_ready(_READY):
            raise RuntimeError(f"the services were not ready within {_READY:g} s")
        with Bus(options.connect) as bus:
            published = bus.subscribe(Keys().session_all())
            for model in MODELS:
                run = on_the_bus(scene, model, options.connect, published)
                print(
                    f"| {model or 'as is'} | {embedded(scene, model):.1f} | {run.rtf:.1f} | {run.exchanges:.2f} | "
                    f"{run.overhead} | {run.echo} | {run.overhead / run.echo:.2f} |"
                )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "scenes" / "tofu_grasp.yaml"))
