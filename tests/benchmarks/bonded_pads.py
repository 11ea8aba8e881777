"""Pads that are bonded, and pads that touch: `python tests/benchmarks/bonded_pads.py [--levels 2]`.

Pads of 2 cm squeeze a cube of 5 cm by 15 %, without weight. Once their footprint is held, nodes by nodes, in statics:
cells that end at the edges, and are halved again and again beside these, where alone the error is; it falls like h, for
the edge is a singular one. Once by contact with pads that do not slip, on the same cells of the whole cube. What is
held stands for contact on cells that end at the edges, and is known without any: bonds are as stiff as contact may be.
hex27_full, integrated exactly, is too stiff on any cells, and bounds the force from above.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.edge_stress import hexahedra
from element_statics import Statics, lattice
from fem_run import FemRun, block

from softseam_services.body.build import build_body

Floats = NDArray[np.float64]
EDGE, PAD, SQUEEZE = 0.05, 0.02, 0.15
"""of the cube and of the pads [m]; share of the cube's edge"""
FROM_PAD = np.array([0.0, 5.0, 13.0, 25.0]) * 1e-3
FROM_MIDDLE = np.array([0.0, 5.0, 10.0, 15.0, 25.0]) * 1e-3
"""borders of an octant's cells, from the pad to the middle and from the middle outwards [m]"""


def halved(lines: Floats, at: float) -> Floats:
    """Borders with one more in the middle of each piece that touches `at`."""
    middles = 0.5 * (lines[1:] + lines[:-1])
    beside = np.isclose(lines[1:], at) | np.isclose(lines[:-1], at)
    return np.sort(np.concatenate([lines, middles[beside]]))


def held(x: Floats, y: Floats, element: str) -> tuple[float, int]:
    """Force on a pad whose footprint's nodes are held [N], and the cells of the whole cube."""
    lines = (x, y, y)
    counts = (len(x) - 1, len(y) - 1, len(y) - 1)

    def shift(rest: Floats) -> Floats:
        moved = np.empty_like(rest)
        for axis, line in enumerate(lines):
            even = np.linspace(0.0, line[-1], len(line))
            moved[:, axis] = np.interp(rest[:, axis], even, line)
        return moved - rest

    case = Statics(lattice((x[-1], y[-1], y[-1]), counts, shift), element)
    at = case.x_rest.copy()
    fixed = np.abs(at - np.array([x[-1], 0.0, 0.0])) < 1e-9
    pad = (at[:, 0] < 1e-9) & (at[:, 1:] < 0.5 * PAD + 1e-9).all(axis=1)
    fixed[pad] = True
    for share in (0.25, 0.5, 0.75, 1.0):
        at[pad, 0] = share * SQUEEZE * 0.5 * EDGE
        at = case.solve(at, fixed, tolerance=1e-7)
    return 4.0 * float(case.forces(at)[pad, 0].sum()), 8 * case.body.n_cells


def touched(x: Floats, y: Floats) -> float:
    """Force on a pad that touches and does not slip, of all the cube [N]."""
    along = np.concatenate([x - 0.5 * EDGE, 0.5 * EDGE - x[-2::-1]])
    beside = np.concatenate([-y[:0:-1], y])
    data, _ = hexahedra((along, beside, beside + 0.5 * EDGE))
    pad = {"kind": "box", "size": (0.01, PAD, PAD), "friction": 50.0}
    tools = {
        name: {**pad, "position": (side * (0.5 * EDGE + 0.005), 0.0, 0.5 * EDGE)}
        for name, side in (("left", -1.0), ("right", 1.0))
    }
    shape = {"shape": {"kind": "mesh", "path": "cells.vtk", "cells": "own"}, "cell": None}
    scene = block(tools=tools, gravity=(0.0, 0.0, 0.0), step=0.02, regions={"default": "fem"}, body=shape)
    run = FemRun(scene, body=build_body(scene, {"cells.vtk": data}))
    steps = 15
    speed = SQUEEZE * 0.5 * EDGE / (steps * 0.02)
    for _ in range(steps):
        run.step({"left": (speed, 0.0, 0.0), "right": (-speed, 0.0, 0.0)})
    for _ in range(steps):
        reply = run.step()
    return float(np.abs(reply.wrench[:, 0]).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", type=int, default=2, help="each with cells half as long beside the edges")
    given = parser.parse_args()
    x, y = FROM_PAD, FROM_MIDDLE
    levels: list[tuple[float, float, float]] = []
    print("| cells | beside the edges [mm] | held, hex27_full [N] | held, hex27 [N] | touched, hex27 [N] | CPU [s] |")
    print("|---|---|---|---|---|---|")
    for _ in range(given.levels):
        began = time.process_time()
        (full, n_cells), (force, _) = (held(x, y, element) for element in ("hex27_full", "hex27"))
        levels.append((full, force, touched(x, y)))
        took = time.process_time() - began
        h = 1e3 * float(np.diff(y).min())
        print(f"| {n_cells} | {h:g} | {' | '.join(f'{each:.3f}' for each in levels[-1])} | {took:.0f} |", flush=True)
        x, y = halved(x, 0.0), halved(y, 0.5 * PAD)
    if len(levels) > 1:
        limits = (2.0 * fine - coarse for coarse, fine in zip(*levels[-2:], strict=True))
        print(f"| | 0, by order 1 | {' | '.join(f'{each:.3f}' for each in limits)} | |")


if __name__ == "__main__":
    main()
