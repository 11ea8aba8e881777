"""How many actions a second many pieces take, and how far they are from the ordinary session: `make batch`.

By hand: PYTHONPATH=tests python tests/benchmarks/batch.py [--device cuda] [--pieces N ...] [--threads N] [--cells N]
Processor time of all threads, without compiling; on a card wall time, with reading what is seen.
"""

from __future__ import annotations

import argparse
import time
from typing import Literal

import numpy as np
from many_pieces import STEP, SUBSTEPS, drawn, scene, velocity
from pbd_run import PbdRun

from softseam_services.pbd.batch.batch import Batch

STEPS = 16


def speed(pieces: int, cells: int, threads: int, device: Literal["cpu", "cuda"]) -> tuple[float, float, int]:
    """Actions a second while pieces are held, time to begin one anew [us], and nodes of each."""
    batch = Batch(scene(cells), pieces, STEP, SUBSTEPS, threads, device)
    clock, spent = time.perf_counter if device == "cuda" else time.process_time, []
    began = clock()
    batch.put(np.arange(pieces), drawn(batch))
    anew = clock() - began
    for number in range(STEPS):
        way = np.repeat(STEP * velocity(number)[None], pieces, axis=0)
        began = clock()
        batch.step(way)
        spent.append(clock() - began)
    batch.close()
    return pieces / float(np.median(spent[6:])), 1e6 * anew / pieces, batch.structure.n_nodes


def difference(cells: int, device: Literal["cpu", "cuda"]) -> tuple[float, float]:
    """Largest difference of places [m], and of forces to the largest, from the ordinary session's."""
    run, batch = PbdRun(scene(cells)), Batch(scene(cells), 1, STEP, SUBSTEPS, 1, device)
    moving, apart, force, most = np.unique(run.solver.model.blocks.corners), 0.0, 0.0, 0.0
    for number in range(STEPS):
        run.velocity[:] = velocity(number)
        reply, out = run.step(), batch.step(STEP * velocity(number)[None])
        apart = max(apart, float(np.abs(run.fields().x[moving] - batch.places(0)).max()))
        force = max(force, float(np.abs(reply.wrench[:, :3] - out.force[0]).max()))
        most = max(most, float(np.abs(reply.wrench[:, :3]).max()))
    return apart, force / most


def main() -> None:
    """Print a line a size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--pieces", type=int, nargs="*")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--cells", type=int, nargs="*", default=[2, 3, 4, 5])
    wanted = parser.parse_args()
    for cells in wanted.cells:
        apart, force = difference(cells, wanted.device)
        print(f"{cells}x{cells}x{cells} blocks: from the ordinary session {1e6 * apart:.2f} um, forces {force:.0e}")
        for pieces in wanted.pieces or ([4096] if wanted.device == "cuda" else [1, 8, 256]):
            rate, anew, nodes = speed(pieces, cells, wanted.threads, wanted.device)
            print(f"  {pieces} pieces of {nodes} nodes: {rate:,.0f} actions/s, a new piece {anew:.0f} us", flush=True)


if __name__ == "__main__":
    main()
