"""Where a step beside a seam spends its time: `python tests/benchmarks/seam_cost.py [SCENE ...] [--set KEY=VALUE ...]`.

Every scene is run embedded, cut also where one model would do, and as FEM alone on the same cells and step; kernels are
compiled before. Times are of the processor, of the thread that works, so that other work on the machine changes them
little; the least of some runs. They are exclusive: what a part calls that has a row of its own is not in it.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from softseam.variants import Model, with_model, with_settings
from softseam_coupling.loops import closure, one_way
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_services.fem import solver as fem
from softseam_services.fem import step as fem_step
from softseam_services.orchestrator import embedded, participants, regions, simulation
from softseam_services.pbd import solver as pbd

ROOT = Path(__file__).resolve().parents[2]
SCENES = ("tofu_slab", "tofu_grasp", "cantilever")
RUNS = 3
PARTS: tuple[tuple[str, Any, str], ...] = (
    ("FEM: steps", fem_step.Stepper, "step"),
    ("FEM: yield of the seam", fem_step.Stepper, "new_compliance_root"),
    ("FEM: corrections", fem.FemSolver, "correct"),
    ("FEM: Python", fem.FemSolver, "advance"),
    ("PBD: steps", pbd, "step"),
    ("PBD: probes", pbd.PbdSolver, "_probe_again"),
    ("PBD: corrections", pbd.PbdSolver, "correct"),
    ("PBD: Python", pbd.PbdSolver, "advance"),
    ("seam: closing the gaps", closure.Closure, "solve"),
    ("seam: compliances inverted", closure.Closure, "_invert"),
    ("seam: the rest", one_way.OneWay, "solve"),
    ("messages", embedded.EmbeddedTransport, "exchange"),
    ("cuts", regions.Regions, "_switch"),
    ("snapshots", participants.Participants, "snapshot"),
    ("region rule", regions.Regions, "follow"),
    ("ledger, reports, motion", simulation.Simulation, "step"),
)
"""name of a row, and the attribute that is timed"""


class Meter:
    """Exclusive seconds and calls of wrapped functions, by row."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self._open: list[float] = []  # seconds of the parts called so far, for each part that is running

    def wrapped(self, row: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def timed(*arguments: Any, **named: Any) -> Any:
            self._open.append(0.0)
            began = time.thread_time()
            try:
                return function(*arguments, **named)
            finally:
                spent = time.thread_time() - began
                inside = self._open.pop()
                self.seconds[row] = self.seconds.get(row, 0.0) + spent - inside
                self.calls[row] = self.calls.get(row, 0) + 1
                if self._open:
                    self._open[-1] += spent

        return timed

    @contextmanager
    def running(self) -> Iterator[None]:
        """All parts are timed, and both sides work in one thread."""
        kept = [(owner, name, getattr(owner, name)) for _, owner, name in PARTS]
        alone = embedded.WORTH_A_THREAD
        embedded.WORTH_A_THREAD = np.inf
        for (row, _, _), (owner, name, function) in zip(PARTS, kept, strict=True):
            setattr(owner, name, self.wrapped(row, function))
        try:
            yield
        finally:
            embedded.WORTH_A_THREAD = alone
            for owner, name, function in kept:
                setattr(owner, name, function)


def run(scene: str, model: Model, settings: list[str]) -> tuple[dict[str, float], dict[str, int], list[StepReport]]:
    """Seconds and calls of each row, the least of some runs, and the reports."""
    loaded = load_scene(ROOT / "scenes" / f"{scene}.yaml")
    described = with_settings(with_model(loaded.scene, model), settings)
    one = simulation.Simulation(bundle_scene(described, loaded.bundle.files), embedded.EmbeddedTransport())
    meters: list[Meter] = []
    reports: list[StepReport] = []
    while not one.done:
        one.step()
    for _ in range(RUNS):
        meter = Meter()
        reports = []
        with meter.running():
            one.reset()
            meter.seconds.clear()
            meter.calls.clear()
            while not one.done:
                reports.append(one.step())
        meters.append(meter)
    one.close()
    best = min(meters, key=lambda meter: sum(meter.seconds.values()))
    return best.seconds, best.calls, reports


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")
    given = parser.parse_args()
    columns = {}
    for scene in given.scenes:
        alone = run(scene, "fem", given.settings)[0]
        columns[scene] = (*run(scene, "hybrid", given.settings), sum(alone.values()))
    print("| ms of the run (calls) | " + " | ".join(columns) + " |")
    print("|---|" + "---|" * len(columns))
    for row, _, _ in PARTS:
        cells = [
            f"{1e3 * seconds.get(row, 0.0):.0f} ({calls.get(row, 0)})" for seconds, calls, _, _ in columns.values()
        ]
        print(f"| {row} | " + " | ".join(cells) + " |")
    totals = [sum(seconds.values()) for seconds, _, _, _ in columns.values()]
    print("| **all** | " + " | ".join(f"{1e3 * total:.0f}" for total in totals) + " |")
    print("| FEM alone | " + " | ".join(f"{1e3 * alone:.0f}" for _, _, _, alone in columns.values()) + " |")
    means = [np.mean([report.seam.exchanges for report in reports]) for _, _, reports, _ in columns.values()]
    print("| exchanges a step | " + " | ".join(f"{mean:.2f}" for mean in means) + " |")


if __name__ == "__main__":
    main()
