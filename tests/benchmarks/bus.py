"""What the bus costs: `make bus`, or `python tests/benchmarks/bus.py [SCENE ...]`.

Starts real services and runs a scene embedded and over the bus, as FEM only, PBD only and hybrid. Prints the real-time
factor (RTF) that a client sees once everything is warm, what an exchange costs beyond the solvers' own work (median),
an echo of the same size to the same processes in the same run, and their ratio. Then, of hybrids, the wall time of a
step at the orchestrator (median), the work of the busier participant in it, and what is beyond, in echoes: the bus, the
orchestrator's own work, and where one side waits for the other's answer, the work of the less busy one.
"""

from __future__ import annotations

import re
import socket
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

import softseam
from softseam.variants import Model
from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.inbox import Inbox, Received
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.facts import machine
from softseam_protocol.messages.session import Event
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor

ROOT = Path(__file__).resolve().parents[2]
MODELS: tuple[Model | None, ...] = (None, "fem", "pbd", "hybrid")
"""None: as the scene says"""
HYBRIDS = ("tofu_grasp", "cantilever", "tofu_slab")
REPEATS = 3
"""runs of which the fastest counts: other work on the machine only slows down"""
_READY = 300.0
_TOLD = re.compile(r"cost (\d+) us .* takes (\d+) us")


@dataclass(frozen=True)
class Run:
    """One run on the bus; times in us."""

    rtf: float
    exchanges: float
    wall: float
    """of a step, as the next three (medians)"""
    busy: float
    """of the participant that worked longer"""
    beyond: float
    """wall - busy"""
    bus: float
    """what exchanges take beyond the slowest participant's work in each"""
    overhead: int
    echo: int


def follow(session: softseam.Session) -> tuple[float, float, list[float]]:
    """RTF as the client sees it, exchanges a step, and the four times of a `Run`, from the second step on."""
    session.reset()
    first = session.run(max_steps=1)
    exchanges: list[int] = []
    seconds: list[tuple[float, float, float]] = []

    def take(seen: softseam.Observation) -> None:
        spent = seen.seconds
        exchanges.append(seen.seam.exchanges)
        seconds.append((spent["total"], max(spent["fem"], spent["pbd"]), spent["bus"]))

    began = perf_counter()
    last = session.run(take)
    factor = (last.time - first.time) / (perf_counter() - began)
    wall, busy, bus = 1e6 * np.array(seconds).T
    medians = np.median([wall, busy, wall - busy, bus], axis=1)
    return factor, sum(exchanges) / len(exchanges), medians.tolist()


def embedded(scene: str, model: Model | None) -> float:
    with softseam.open(scene, model=model) as session:
        return max(follow(session)[0] for _ in range(REPEATS))


def on_the_bus(scene: str, model: Model | None, endpoint: str, published: Inbox[Received]) -> Run:
    """The fastest of several runs; what an exchange cost is told when a session is closed."""
    runs = []
    for _ in range(REPEATS):
        with softseam.open(scene, endpoint, model=model) as session:
            factor, exchanges, (wall, busy, beyond, bus) = follow(session)
        runs.append(Run(factor, exchanges, wall, busy, beyond, bus, *_told(published)))
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


def main(scenes: list[Path]) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        options = BusOptions(connect=f"tcp/127.0.0.1:{probe.getsockname()[1]}")
    scene = str(scenes[0])
    print(f"{scenes[0].stem}, {machine()}\n")
    print("| model | RTF embedded | RTF on the bus | exchanges a step | overhead of one [us] | echo [us] | ratio |")
    print("|---|---|---|---|---|---|---|")
    with (
        tempfile.TemporaryDirectory() as folder,
        supervisor(UpOptions(options, Path(folder)), lambda line: None) as services,
    ):
        if not services.wait_ready(_READY):
            raise RuntimeError(f"the services were not ready within {_READY:g} s")
        with Bus(options.connect, role=SERVICE) as bus:
            published = bus.subscribe(Keys().session_all())
            for model in MODELS:
                run = on_the_bus(scene, model, options.connect, published)
                print(
                    f"| {model or 'as is'} | {embedded(scene, model):.1f} | {run.rtf:.1f} | {run.exchanges:.2f} | "
                    f"{run.overhead} | {run.echo} | {run.overhead / run.echo:.2f} |"
                )
            print("\n| hybrid | exchanges a step | a step [us] | FEM or PBD | beyond | the bus in it | echo | echoes |")
            print("|---|---|---|---|---|---|---|---|")
            for path in scenes:
                run = on_the_bus(str(path), "hybrid", options.connect, published)
                print(
                    f"| {path.stem} | {run.exchanges:.2f} | {run.wall:.0f} | {run.busy:.0f} | "
                    f"{run.beyond:.0f} | {run.bus:.0f} | {run.echo} | {run.beyond / run.echo:.2f} |"
                )


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]] or [ROOT / "scenes" / f"{name}.yaml" for name in HYBRIDS])
