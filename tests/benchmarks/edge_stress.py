"""Von Mises stress beside fingertips: `python tests/benchmarks/edge_stress.py [--most-cells 1000] [--steps 0.04]`.

With `--fast`: few cells whose borders were chosen by trying, against docs/results/verification.md, with the
real-time factor of each (processor time, the least of three runs, the building of the body left out).

tofu_pads by FEM alone on hexahedra of a file: some millimetres from a fingertip's edge the stress falls by two thirds
within three more, so cells are thin towards the edge that a point is near, and long elsewhere. Each probe has
levels of its own. Values are of the end of the last hold. The estimate is the finest level's, its uncertainty what
the finest level differs by from the one before it, or the step's influence on the coarsest level, whichever is more;
cells along the edge are long in the series above and beside, which this does not see.
Results are kept in `out/edge-stress` and used again by the same code; an interrupted series goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from hexahedra import lattice, vtk

from softseam.embedded import solver_digest
from softseam.variants import with_model, with_settings
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import load_scene, scene_json
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

Floats = NDArray[np.float64]
Lateral = tuple[int, int, int, float]
"""cells below the fingertip, beside it and above; how many times as long the longest is as that at the upper edge"""
Level = tuple[int, Lateral, Lateral]
"""cells in the left half along x; along y; along z"""

SCENES = Path(__file__).resolve().parents[2] / "scenes"
EDGE = 0.05
SIDES = ((0.015, 0.035), (0.0153, 0.0356))
"""of the fingertips on the body at rest along y and z: it has sagged by 0.3 and 0.6 mm when they touch it [m]"""
FAR, TOWARDS_FACE = 3.0, 8.0
"""how many times as long the longest cells are: where no probe is near; towards the left face"""
EVEN, FINE = (2, 2, 2, FAR), (2, 3, 2, FAR)
LEVELS: dict[str, tuple[Level, ...]] = {
    "above": ((4, EVEN, (2, 3, 3, 6.0)), (6, EVEN, (2, 4, 5, 8.0)), (7, EVEN, (2, 5, 6, 10.0))),
    "beside": ((4, (2, 3, 3, 6.0), EVEN), (6, (2, 4, 5, 8.0), EVEN), (7, (2, 5, 6, 10.0), EVEN)),
    "under": (
        (4, EVEN, EVEN),
        (5, FINE, FINE),
        (6, (2, 4, 2, FAR), (2, 4, 2, FAR)),
        (8, (2, 5, 2, FAR), (2, 5, 2, FAR)),
    ),
}

Lines = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
"""where cells end along x, y and z inside the cube, from its lower faces [mm]"""
REFERENCES = {"grip": 2.86, "above": 3080.0, "beside": 1970.0, "under": 2630.0}
"""docs/results/verification.md, docs/decisions/19 [N, Pa]"""
EVEN_MM, PAST_MM = (12.5, 25.0, 37.5), (7.5, 15.0, 25.0, 35.0, 42.5)
FEW: tuple[Lines, ...] = (
    (EVEN_MM, EVEN_MM, EVEN_MM),
    (EVEN_MM, PAST_MM, PAST_MM),
    ((14.7,), (15.0, 25.0, 35.0, 42.1), (15.3, 27.3, 35.6, 39.0)),
    ((13.1,), (15.0, 25.0, 35.0, 42.0), (15.3, 28.0, 35.6, 38.2)),
    ((11.2, 29.5), (15.0, 25.0, 35.0, 41.8), (15.3, 28.9, 35.6, 38.0)),
    (EVEN_MM, (15.0, 25.0, 35.0, 42.5), (15.3, 24.5, 31.0, 35.6, 38.9, 43.5)),
)


def towards_end(count: int, ratio: float) -> Floats:
    """Where `count` cells on [0, 1] end that become shorter towards 1, in all by the factor `ratio` (count + 1,)."""
    along = np.linspace(1.0, 0.0, count + 1)
    return np.asarray(1.0 - np.expm1(np.log(ratio) * along) / (ratio - 1.0))


def towards_both(count: int, ratio: float) -> Floats:
    """The same towards 0 and 1 (count + 1,)."""
    along = np.linspace(-1.0, 1.0, count + 1)
    inward = np.expm1(np.log(ratio) * (1.0 - np.abs(along))) / (ratio - 1.0)
    return np.asarray(0.5 * (1.0 + np.sign(along) * (1.0 - inward)))


def across(low: float, high: float, cells: Lateral) -> Floats:
    """Where cells end along an axis on which a fingertip lies between `low` and `high` [m]."""
    below, beside, above, ratio = cells
    middle = towards_end(beside, ratio) if ratio > FAR else towards_both(beside, FAR)
    upper = 1.0 - towards_end(above, ratio)[::-1]
    return np.concatenate(
        [low * towards_end(below, FAR), low + (high - low) * middle[1:], high + (EDGE - high) * upper[1:]]
    )


def mesh(level: Level) -> tuple[bytes, int]:
    """The cube in these cells as a file, and how many they are."""
    half = 0.5 * EDGE
    left = half * (1.0 - towards_end(level[0], TOWARDS_FACE)[::-1])
    x = np.concatenate([left, half + half * towards_end(2, FAR)[1:]])
    return hexahedra((x, across(*SIDES[0], level[1]), across(*SIDES[1], level[2])))


def hexahedra(lines: tuple[Floats, Floats, Floats]) -> tuple[bytes, int]:
    """The cube in cells that end at these places along x, y and z [m], as a file, and how many they are."""
    counts = (len(lines[0]) - 1, len(lines[1]) - 1, len(lines[2]) - 1)
    points, cells = lattice(counts, (float(counts[0]), float(counts[1]), float(counts[2])))
    number = np.rint(points - points.min(axis=0)).astype(np.int64)
    return vtk(np.stack([line[number[:, i]] for i, line in enumerate(lines)], axis=1), cells), len(cells)


def run(file: bytes, n_cells: int, step: float) -> dict[str, float]:
    """Grip force [N] and von Mises stress [Pa] of all probes at the end, with CPU seconds."""
    scene = with_model(load_scene(SCENES / "tofu_pads.yaml").scene, "fem")
    own = "body.shape={kind: mesh, path: cells.vtk, cells: own}"
    scene = with_settings(scene, [own, "body.cell=null", f"step={step}"])
    simulation = Simulation(Bundle(scene_json(scene), {"cells.vtk": file}), EmbeddedTransport())
    began = time.process_time()
    while not simulation.done:
        report = simulation.step()
    found = {name: report.quantities[f"{name}.von_mises"] for name in scene.probes}
    simulation.close()
    seconds = time.process_time() - began
    return {
        "cells": n_cells,
        "grip": report.quantities["grip_force"],
        **found,
        "seconds": seconds,
        "simulated": report.header.time,
    }


def kept(level: Level, step: float, folder: Path) -> dict[str, float]:
    """`run`, or what it gave before."""
    shape = "_".join("-".join(f"{n:g}" for n in cells) for cells in (level[1], level[2]))
    file = folder / f"{solver_digest()[:12]}_{level[0]}_{shape}_{1e3 * step:g}ms.json"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        found = run(*mesh(level), step)
        file.write_text(json.dumps(found))
    return dict(json.loads(file.read_text()))


def few(steps: list[float]) -> None:
    """Errors and speed of the few cells, in these steps [s]."""
    print("| cells | step [ms] | real-time factor | grip [%] | above [%] | beside [%] | under [%] |")
    print("|---|---|---|---|---|---|---|")
    for planes in FEW:
        x, y, z = (1e-3 * np.array([0.0, *inner, 1e3 * EDGE]) for inner in planes)
        file, n_cells = hexahedra((x, y, z))
        counts = f"{len(x) - 1} x {len(y) - 1} x {len(z) - 1}"
        for step in steps:
            runs = [run(file, n_cells, step) for _ in range(3)]
            errors = " | ".join(f"{100.0 * (runs[0][name] / true - 1.0):+.1f}" for name, true in REFERENCES.items())
            rtf = runs[0]["simulated"] / min(found["seconds"] for found in runs)
            print(f"| {counts} | {1e3 * step:g} | {rtf:.1f} | {errors} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("probes", nargs="*", default=list(LEVELS), help="which ones' series to run; default: all")
    parser.add_argument("--steps", type=float, nargs="+", default=[0.04, 0.01], help="[s]: all levels, the coarsest")
    parser.add_argument("--most-cells", type=int, default=1000, help="levels with more are left out")
    parser.add_argument("--out", type=Path, default=Path("out/edge-stress"))
    parser.add_argument("--fast", action="store_true", help="errors and speed of few cells instead")
    given = parser.parse_args()
    if given.fast:
        few([0.08, 0.04])
        return
    print("| fine at | cells | step [ms] | grip [N] | above [Pa] | beside [Pa] | under [Pa] | CPU [s] |")
    print("|---|---|---|---|---|---|---|---|")
    limits = []
    for probe in given.probes:
        runs = [(level, given.steps[0]) for level in LEVELS[probe]] + [(LEVELS[probe][0], s) for s in given.steps[1:]]
        values = []
        for level, step in runs:
            if mesh(level)[1] > given.most_cells:
                continue
            found = kept(level, step, given.out)
            stress = " | ".join(f"{found[name]:.0f}" for name in LEVELS)
            print(
                f"| {probe} | {found['cells']:.0f} | {1e3 * step:g} | {found['grip']:.3f} | {stress} "
                f"| {found['seconds']:.0f} |",
                flush=True,
            )
            values.append((step, found[probe]))
        series = [value for step, value in values if step == given.steps[0]]
        others = [abs(value / series[0] - 1.0) for step, value in values if step != given.steps[0]]
        off = max([abs(series[-2] / series[-1] - 1.0), *others])
        limits.append(f"{probe}: {series[-1]:.0f} Pa, known to {100.0 * off:.1f} %")
    print("\n" + "\n".join(limits))


if __name__ == "__main__":
    main()
