"""How many actions a second many pieces take, and how far they are from the ordinary session: `make batch`.

By hand: PYTHONPATH=tests python tests/benchmarks/batch.py [--device cuda] [--pieces N ...] [--threads N] [--cells N]
Processor time of all threads, without compiling; on a card wall time, with reading what is seen.
"""

from __future__ import annotations

import argparse
import time
from typing import Literal

import numpy as np
from pbd_run import Floats, PbdRun

from softseam_protocol.scene.scene import Scene
from softseam_services.pbd.batch.batch import Batch
from softseam_services.pbd.batch.pieces import Pieces

STEP, SUBSTEPS, STEPS = 0.04, 40, 16
PAD = {"kind": "box", "size": [0.01, 0.09, 0.09], "friction": 0.6}


def scene(cells: int) -> Scene:
    """A cube of tofu, 2 mm from two pads."""
    whole = {"coarse": {"boxes": [{"min": [-1, -1, -1], "max": [1, 1, 1]}]}, "substeps": SUBSTEPS}
    material = {"kind": "neo_hookean", "young": 2e4, "poisson": 0.45, "density": 1050}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "pieces",
            "gravity": [0, 0, -9.81],
            "step": STEP,
            "body": {"shape": {"kind": "block", "size": [0.05] * 3}, "cell": [0.05 / cells] * 3, "material": material},
            "tools": {
                "ground": {"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1], "friction": 0.6},
                "left": {**PAD, "position": [-0.032, 0, 0.044]},
                "right": {**PAD, "position": [0.032, 0, 0.044]},
            },
            "motion": [{"tools": ["left", "right"], "close": 0.02, "until": {"time": 1.0}}],
            "models": {"pbd": whole},
        }
    )


def velocity(number: int) -> Floats:
    """Of the tools (3, 3) [m/s]: close by 3.2 mm, hold, rise."""
    found = np.zeros((3, 3))
    if number < 4:
        found[1, 0], found[2, 0] = 0.02, -0.02
    elif number > 5:
        found[1:, 2] = 0.05
    return found


def drawn(batch: Batch) -> Pieces:
    """A batch's worth of pieces."""
    random, own = np.random.default_rng(0), batch.structure.own(batch.count)
    size = own.size * random.uniform(0.9, 1.1, own.size.shape)
    position = own.position.copy()
    position[:, 1, 0], position[:, 2, 0] = -0.5 * size[:, 0] - 0.006, 0.5 * size[:, 0] + 0.006
    young, poisson = own.young * random.uniform(0.7, 1.3, batch.count), random.uniform(0.32, 0.47, batch.count)
    density, friction = own.density * random.uniform(0.7, 1.3, batch.count), own.friction
    return Pieces(size, young, poisson, density, friction, position, own.orientation)


def speed(pieces: int, cells: int, threads: int, device: Literal["cpu", "cuda"]) -> tuple[float, float, int]:
    """Actions a second while pieces are held, time to begin one anew [us], and nodes of each."""
    batch = Batch(scene(cells), pieces, STEP, SUBSTEPS, threads, device)
    began = time.perf_counter()
    batch.put(np.arange(pieces), drawn(batch))
    anew, clock = time.perf_counter() - began, time.perf_counter if device == "cuda" else time.process_time
    spent = []
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
