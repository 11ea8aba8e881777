"""Converged forces of the grasp scene with friction: `python tests/benchmarks/grasp_reference.py [--cells 2 3 4 6 8]`.

FEM alone on n x n x n cells at several steps: grip force [N] at 5, 10 and 15 % compression, at the end of the hold and
after the lift. The plates start 0.5 mm clear of the cube, which settles on its own. Contact at the plates' edges is
singular, so forces approach their limit about like 1/n: the limit is the intercept of the least-squares line through
the finest three, its uncertainty half the distance from the finest value or from the line without the coarsest of the
three, whichever is more. Steps: the same with the step length. One process a core.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.progress import Progress

LEVELS = (0.05, 0.10, 0.15)
NAMES = ("5 %", "10 %", "15 %", "hold", "lifted")
SCENE = Path(__file__).resolve().parents[2] / "scenes" / "tofu_grasp.yaml"


def grasp(n: int, step: float, lift: bool) -> dict[str, float]:
    """Forces [N] of n^3 cells and this step [s], with wall seconds and peak memory [MB]."""
    from softseam.variants import with_model, with_settings
    from softseam_protocol.scene.file import bundle_scene, load_scene
    from softseam_services.orchestrator.embedded import EmbeddedTransport
    from softseam_services.orchestrator.simulation import Simulation

    clear = 0.025 + 0.0005 + 0.005
    settings = [f"body.cell={0.05 / n}", f"step={step}"]
    settings += [f"tools.{name}.position=[{sign * clear}, 0, 0.029]" for name, sign in (("left", -1), ("right", 1))]
    scene = with_settings(with_model(load_scene(SCENE).scene, "fem"), settings)
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    began = perf_counter()
    closing: list[tuple[float, float]] = []
    forces: dict[str, float] = {}
    while not simulation.done:
        report = simulation.step()
        force = report.quantities["grip_force"]
        if report.phase == 1:
            closing.append((report.quantities["compression"], force))
        elif report.phase == 2:
            forces["hold"] = force
        elif report.phase > 2 and not lift:
            break
        else:
            forces["lifted"] = force
    compression, along = np.array(closing).T
    forces |= dict(zip(NAMES, np.interp(LEVELS, compression, along).tolist(), strict=False))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return forces | {"seconds": perf_counter() - began, "memory": memory, "nodes": len(simulation.body.x_rest)}


def limit(h: list[float], values: list[float]) -> tuple[float, float]:
    """Intercept at h = 0 of the line through the finest three, and its uncertainty."""
    order = np.argsort(h)[:3]
    x, y = np.array(h)[order], np.array(values)[order]
    intercept = float(np.polyfit(x, y, 1)[1])
    shorter = float(np.polyfit(x[:2], y[:2], 1)[1])
    return intercept, max(0.5 * abs(intercept - float(y[0])), abs(intercept - shorter))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[2, 3, 4, 6, 8], help="cells an edge")
    parser.add_argument("--steps", type=float, nargs="+", default=[0.02, 0.01, 0.005], help="[s], at --at cells")
    parser.add_argument("--at", type=int, default=3, help="cells an edge at which the step is varied")
    parser.add_argument("--step", type=float, default=0.01, help="[s], at which the cells are varied")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--lift-up-to", type=int, default=8, help="finer cells stop after the hold")
    parser.add_argument("--json", type=Path, help="write each result here as it comes")
    given = parser.parse_args()
    runs = sorted({(n, given.step) for n in given.cells} | {(given.at, step) for step in given.steps}, reverse=True)
    done: dict[tuple[int, float], dict[str, float]] = {}
    with Progress(console=Console(stderr=True)) as progress, ProcessPoolExecutor(given.jobs) as pool:
        task = progress.add_task("grasps", total=len(runs))
        futures = {pool.submit(grasp, n, step, n <= given.lift_up_to): (n, step) for n, step in runs}
        for future in as_completed(futures):
            done[futures[future]] = future.result()
            progress.advance(task)
            if given.json:
                given.json.write_text(json.dumps([{"n": k[0], "step": k[1]} | v for k, v in sorted(done.items())]))
    print("| cells | step [ms] | " + " | ".join(NAMES) + " | seconds | MB |")
    print("|---|---|" + "---|" * (len(NAMES) + 2))
    for (n, step), forces in sorted(done.items()):
        shown = " | ".join(f"{forces[name]:.3f}" if name in forces else "" for name in NAMES)
        print(f"| {n}^3 | {1e3 * step:g} | {shown} | {forces['seconds']:.0f} | {forces['memory']:.0f} |")
    for text, keys, h in (
        ("cells to 0", [(n, given.step) for n in given.cells], [1.0 / n for n in given.cells]),
        ("step to 0", [(given.at, step) for step in given.steps], list(given.steps)),
    ):
        cells = []
        for name in NAMES:
            at = [i for i, key in enumerate(keys) if name in done[key]]
            value, uncertainty = limit([h[i] for i in at], [done[keys[i]][name] for i in at])
            cells.append(f"{value:.3f} +- {uncertainty:.3f}")
        print(f"| limit, {text} | | " + " | ".join(cells) + " | | |")


if __name__ == "__main__":
    main()
