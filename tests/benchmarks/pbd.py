"""How fast the PBD participant is, and how far from what the machine could do: `make pbd`.

By hand: NUMBA_NRT_STATS=1 PYTHONPATH=tests python tests/benchmarks/pbd.py (numba counts allocations when told to).
Times are the least of several repeats, without compiling: CPU time of one core, wall time of two. Limits come from
the same run: products and sums on numbers in registers, and copies in memory. Compare ratios, not figures.
"""

from __future__ import annotations

import functools

import numpy as np
from numba import njit
from numba.core.runtime.nrt import rtsys
from numpy.typing import NDArray
from pbd_run import PbdRun, block_scene
from pbd_scenes import scene_a, scene_b, scene_b_in_the_product, two_threads
from rich.console import Console
from rich.table import Table
from timing import least

from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advance
from softseam_protocol.scene.bodies import BodySpec
from softseam_services.body.materials import build_material
from softseam_services.pbd.forms import SIGNS, build_forms
from softseam_services.pbd.hourglass import block_constants
from softseam_services.pbd.kernels.block import Constants, new_workspace
from softseam_services.pbd.kernels.block_rows import N_FOLD, N_STRESS
from softseam_services.pbd.kernels.form import N_FORM
from softseam_services.pbd.kernels.lanes import LANES, aligned
from softseam_services.pbd.kernels.sweep import sweep

Floats = NDArray[np.float64]
BYTES = 2 * 8 * N_STRESS // LANES + 8 * 4 + 2 * 8 + 2 * 32
"""of a block and sweep: its stress to and fro, 8 node ids, volume and softness, and one node to and fro"""
FLOPS = 690
"""of a block and sweep: 183 fused products and sums, 147 products, 173 sums, 5 quotients, a root, and the logarithm"""
EDGE = 0.0125
PLATE = {"kind": "box", "size": (0.01, 0.06, 0.06), "friction": 0.6}


@njit(error_model="numpy", fastmath={"contract"})
def _multiply(values: Floats, rounds: int) -> None:
    """Sixteen fused products and sums one after the other for each of many numbers in cache."""
    for _ in range(rounds):
        for i in range(len(values)):
            v = values[i]
            v = (((v * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01
            v = (((v * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01
            v = (((v * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01
            v = (((v * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01) * 0.99 + 0.01
            values[i] = v


def limits() -> tuple[float, float]:
    """Products and sums [flops/s] and copies, read and written [bytes/s], of one core."""
    values = aligned(512)
    _multiply(values, 1)
    rounds = 10_000
    flops = 32 * len(values) * rounds / least(lambda: _multiply(values, rounds))
    source, to = np.ones(1 << 24), np.ones(1 << 24)
    return flops, 2 * source.nbytes / least(lambda: np.copyto(to, source))


@njit(error_model="numpy")
def _sweeps(
    n: int,
    ws: Floats,
    xw: Floats,
    nodes: NDArray[np.int32],
    volume: Floats,
    softness: Floats,
    stress: Floats,
    constants: Constants,
    h: float,
) -> None:
    for _ in range(n):
        sweep(ws, xw, nodes, volume, softness, stress, constants, 0, 0.5, h, 0, len(nodes))


def lattice(counts: tuple[int, int, int]) -> tuple[int, NDArray[np.int32]]:
    """Node count and coloured batches (b, 8, LANES) of a box of blocks, laid out as `build_blocks` does."""
    steps = np.array([1, counts[0] + 1, (counts[0] + 1) * (counts[1] + 1)])
    n_nodes = int(np.prod(np.array(counts) + 1))
    corner = np.array([(i, j, k) for k in range(2) for j in range(2) for i in range(2)]) @ steps
    batches = []
    for colour in range(8):
        axes = [np.arange(colour >> axis & 1, counts[axis], 2) for axis in range(3)]
        place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
        nodes = (place @ steps)[:, None] + corner
        pad = np.broadcast_to(n_nodes + np.arange(8), (-len(nodes) % LANES, 8))
        batches.append(np.concatenate([nodes, pad]).reshape(-1, LANES, 8).transpose(0, 2, 1))
    return n_nodes, np.ascontiguousarray(np.concatenate(batches), dtype=np.int32)


def time_sweep(counts: tuple[int, int, int], boxes: bool = True) -> tuple[int, float]:
    """Blocks, and seconds a sweep over them, of a slightly shaken box; or of the same in blocks of any shape."""
    n_nodes, nodes = lattice(counts)
    scene = block_scene()
    rest = [EDGE * np.arange(count + 1) for count in counts]
    x = np.stack(np.meshgrid(*rest, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    xw = aligned(n_nodes + 8, 4)
    xw[:n_nodes, :3] = x + 1e-5 * np.random.default_rng(0).standard_normal(x.shape)
    xw[:n_nodes, 3] = 1.0 / (1050.0 * EDGE**3)
    xw[n_nodes:, :3] = EDGE * np.array([(i, j, k) for k in range(2) for j in range(2) for i in range(2)])
    real = nodes[:, 0] < n_nodes
    volume, softness = np.where(real, EDGE**3, 0.0), np.where(real, 8.0 * xw[0, 3], 0.0)
    assert isinstance(scene.body, BodySpec)
    material = build_material(scene.body.material)
    none = np.zeros((0, N_FOLD, LANES))
    if boxes:
        table = block_constants(material, np.full(3, EDGE), "physical")[None]
        constants = Constants(table, np.zeros(len(nodes), dtype=np.int32), none)
    else:
        cube = 0.5 * EDGE * SIGNS[None]
        form = build_forms(cube + 1e-4 * np.random.default_rng(1).standard_normal(cube.shape), material, "physical")[0]
        table = np.ascontiguousarray(np.broadcast_to(form[0][:, None], (len(nodes), N_FORM, LANES)))
        constants = Constants(table, np.arange(len(nodes), dtype=np.int32), none)
    arrays = new_workspace(), xw, nodes, volume, softness, aligned(len(nodes), N_STRESS), constants, 1e-4
    inner = max(1, 20_000 // int(real.sum()))
    _sweeps(1, *arrays)
    return int(real.sum()), least(lambda: _sweeps(inner, *arrays)) / inner


def sweep_table(console: Console, flops: float, copied: float) -> None:
    table = Table("blocks", "ns a block", "10^6 blocks/s", "GFLOP/s", "of limit", "GB/s", "of limit")
    sizes, times = [], []
    for counts in ((4, 4, 2), (5, 5, 4), (10, 10, 10), (22, 22, 21), (46, 46, 47), (100, 100, 100)):
        n, seconds = time_sweep(counts)
        sizes.append(n)
        times.append(seconds)
        per = seconds / n
        done, moved = FLOPS / per, BYTES / per
        table.add_row(
            str(n),
            f"{1e9 * per:.1f}",
            f"{1e-6 / per:.1f}",
            f"{1e-9 * done:.1f}",
            f"{done / flops:.0%}",
            f"{1e-9 * moved:.1f}",
            f"{moved / copied:.0%}",
        )
    console.print(table)
    n, seconds = time_sweep((22, 22, 21), boxes=False)
    console.print(f"a block of any shape among {n}: {1e9 * seconds / n:.1f} ns, {seconds / times[3]:.2f} times a box")
    slope = np.polyfit(np.log(sizes[1:]), np.log(times[1:]), 1)[0]
    small = times[0] / sizes[0] / (times[3] / sizes[3])
    console.print(f"time ~ blocks^{slope:.3f} from 1e2 to 1e6; a block among 32 costs {small:.2f} of one among 1e4")


def _allocated() -> int:
    """How often numba has allocated in this process."""
    return int(rtsys.get_allocation_stats().alloc)  # type: ignore[no-untyped-call]


def _allocations(run: PbdRun, request: Advance, substeps: int) -> int:
    """What numba allocates in a step; handing an array over counts, too, so only differences mean something."""
    run.scratch.planned = substeps
    before = _allocated()
    run.attempt(request)
    run.scratch.planned = 11
    return _allocated() - before


def small_body(console: Console) -> None:
    """One step of 11 substeps of 32 blocks: alone, and resting on the ground between two plates."""
    table = Table("32 blocks x 11 substeps", "advance [us]", "inside the kernel [us]", "allocations, 11 more")
    for touching in (False, True):
        away, below = (-0.0302, 0.0) if touching else (-0.2, -1.0)
        tools = {
            "ground": {"kind": "plane", "point": (0.0, 0.0, below), "friction": 0.6},
            "left": {**PLATE, "position": (away, 0.0, 0.025)},
            "right": {**PLATE, "position": (-away, 0.0, 0.025)},
        }
        gravity = (0.0, 0.0, -9.81 if touching else 0.0)
        scene = block_scene(
            (0.05, 0.05, 0.025),
            0.025,
            gravity=gravity,
            tools=tools,
            moved=("left", "right"),
            step=0.01,
            pbd={"substeps": 11},
        )
        run = PbdRun(scene)
        run.velocity[1:, 0] = 0.005, -0.005
        run.run(0.2)
        request, solver = run.request(), run.solver
        reply = solver.advance(request)
        allocations = _allocations(run, request, 22) - _allocations(run, request, 11)
        name = f"{reply.figure(Figure.CONTACTS):.0f} points touch" if touching else "free"
        whole = least(functools.partial(solver.advance, request))
        inside = least(functools.partial(run.attempt, request))
        table.add_row(name, f"{1e6 * whole:.1f}", f"{1e6 * inside:.1f}", str(allocations))
    console.print(table)


def main() -> None:
    console = Console()
    flops, copied = limits()
    console.print(f"limits of this core: {1e-9 * flops:.0f} GFLOP/s, {1e-9 * copied:.1f} GB/s copied")
    sweep_table(console, flops, copied)
    small_body(console)
    two_threads(console)
    scene_a(console)
    scene_b(console)
    scene_b_in_the_product(console)


if __name__ == "__main__":
    main()
