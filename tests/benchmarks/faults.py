"""Kill and freeze services at random under clients that run: faults.py [FAULTS] [CLIENTS] [SEED]

Each client simulates the same scene again and again by requests of all kinds, recorded. Every report has to have the
bits of the run in one process, no client may open a session anew, and each recording has to have every step.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / "system"), str(ROOT / "tests")]

from real_services import LIMITS, READY, Lines, free_port, squeezed_bar  # noqa: E402
from trajectory import first_difference  # noqa: E402

from softseam.connected import ConnectedBackend  # noqa: E402
from softseam.errors import SoftseamError  # noqa: E402
from softseam.recording import Recording, RecordingError  # noqa: E402
from softseam.variants import with_settings  # noqa: E402
from softseam_protocol.messages.participant import Bundle  # noqa: E402
from softseam_protocol.messages.session import StepReport  # noqa: E402
from softseam_protocol.scene.file import bundle_scene  # noqa: E402
from softseam_services.bus_options import BusOptions  # noqa: E402
from softseam_services.launch import UpOptions, supervisor  # noqa: E402
from softseam_services.orchestrator.embedded import EmbeddedTransport  # noqa: E402
from softseam_services.orchestrator.simulation import Simulation  # noqa: E402

STEPS = 300
VICTIMS = ("orchestrator", "recorder", "fem", "pbd", "router")


def reference(bundle: Bundle) -> list[StepReport]:
    simulation = Simulation(bundle, EmbeddedTransport())
    reports = [simulation.step(fields=n % 4 == 3) for n in range(STEPS)]
    simulation.close()
    return reports


class Client(threading.Thread):
    """Runs until it is told to stop, between two runs."""

    def __init__(self, bundle: Bundle, endpoint: str, wanted: list[StepReport], seed: int) -> None:
        super().__init__(daemon=True)
        self.found, self.stop = Counter[str](), threading.Event()
        self._bundle, self._endpoint, self._wanted, self._draw = bundle, endpoint, wanted, random.Random(seed)

    def run(self) -> None:
        while not self.stop.is_set():
            try:
                self._once()
            except SoftseamError as error:
                self.found["lost"] += 1
                print(f"LOST {type(error).__name__}: {error}", flush=True)

    def _once(self) -> None:
        backend = ConnectedBackend(self._bundle, self._endpoint, record=True, timeout=READY)
        try:
            backend.reset(0)
            at = 0
            while at < STEPS:
                count = min(self._draw.choice((1, 1, 7, 40)), STEPS - at)
                if self._draw.random() < 0.3:
                    seen = [each.report for each in backend.follow(count)]
                    at += len(seen)
                else:
                    seen = [backend.step(count, None, False).report]
                    at += count
                if difference := first_difference(self._wanted[at - len(seen) : at], seen):
                    self.found["other bits"] += 1
                    print("OTHER BITS before", at, difference[:300], flush=True)
                    return
            self.found["same bits"] += 1
        finally:
            backend.close()
        if backend.recorded is None:
            self.found["recordings of which nothing is known"] += 1
            print("UNKNOWN", backend.unrecorded[:200], flush=True)
            return
        try:
            recording = Recording(backend.recorded.path)
            difference = first_difference(self._wanted, list(recording.reports())) or recording.note or ""
        except RecordingError as error:
            difference = str(error)
        self.found["recordings that lack something" if difference else "whole recordings"] += 1
        if difference:
            print("RECORDING", backend.recorded.path, difference[:300], flush=True)


def main(faults: int = 100, clients: int = 2, seed: int = 0) -> int:
    draw = random.Random(seed)
    folder = Path(tempfile.mkdtemp())
    os.environ["XDG_STATE_HOME"] = str(folder)
    bundle = bundle_scene(with_settings(squeezed_bar(), [f"duration={0.01 * STEPS}"]))
    wanted = reference(bundle)
    options, lines = BusOptions(connect=f"tcp/127.0.0.1:{free_port()}"), Lines()
    limits = replace(LIMITS, attempts=100_000, longest_pause=0.1)
    with supervisor(UpOptions(options, folder / "recordings", limits=limits), lines) as children:
        assert children.wait_ready(READY)
        running = [Client(bundle, options.connect, wanted, seed + n) for n in range(clients)]
        for client in running:
            client.start()
        done, began = Counter[str](), time.monotonic()
        for _ in range(faults):
            time.sleep(draw.uniform(0.2, 3.0))  # so far into whatever is under way
            name, number = draw.choice(VICTIMS), draw.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGSTOP))
            said = len(lines.lines)
            os.kill(children.pid(name), number)
            lines.wait_for(name, "restarting", after=said, timeout=60.0)
            done[f"{name} {number.name}"] += 1
            assert children.wait_ready(READY), lines.lines[-5:]
        for client in running:
            client.stop.set()
        for client in running:
            client.join(READY)
    found = sum((client.found for client in running), Counter[str]())
    print(f"{faults} faults in {time.monotonic() - began:.0f} s: {dict(sorted(done.items()))}")
    print(dict(found))
    bad = set(found) - {"same bits", "whole recordings"}
    return min(sum(found[each] for each in bad) + any(client.is_alive() for client in running), 100)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
