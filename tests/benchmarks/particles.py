"""How fast constraints on particles are, and how far from what the machine could do: the second part of `make pbd`.

By hand: NUMBA_NRT_STATS=1 PYTHONPATH=tests python tests/benchmarks/particles.py (numba counts allocations only when
told to). One process and one core; times are the least of several repeats, without compiling, in CPU time. The limit,
copies in memory, is measured in the same run. Compare ratios, not figures.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
from numba import njit
from numba.core.runtime.nrt import rtsys
from numpy.typing import NDArray
from particle_run import ParticleRun, particle_scene
from rich.console import Console
from rich.table import Table
from timing import least

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Advance
from softseam_protocol.scene.file import load_scene
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.fem.elements.tetrahedra import kuhn
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.kernels.lanes import aligned
from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.kernels import distance, neo_hookean
from softseam_services.pbd.particles.parameters import build_tetrahedra
from softseam_services.tools.motion import tool_motion

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
CLOTH = Path(__file__).parents[2] / "scenes" / "cloth_fold.yaml"


@njit(error_model="numpy")
def _distances(
    n: int, ws: Floats, xw: Floats, nodes: Ints, rest: Floats, inverse: Floats, soft: Floats, lam: Floats
) -> None:
    for _ in range(n):
        distance.project_distances(ws, xw, nodes, rest, inverse, soft, lam)


@njit(error_model="numpy")
def _pairs(
    n: int, ws: Floats, xw: Floats, nodes: Ints, inverse: Floats, soft: Floats, gamma: Floats, lam: Floats
) -> None:
    for _ in range(n):
        neo_hookean.project_pairs(ws, xw, nodes, inverse, soft, gamma, lam)


def lattice(n: int) -> tuple[Floats, Ints]:
    """Particles of a square lattice (n^2, 3), a little shaken, and its springs along both sides and both diagonals."""
    number = np.arange(n * n, dtype=np.int32).reshape(n, n)
    x = np.zeros((n * n, 3))
    x[:, 0], x[:, 1] = np.tile(np.arange(n), n), np.repeat(np.arange(n), n)
    x += 1e-2 * np.random.default_rng(0).standard_normal(x.shape)
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:])]
    pairs += [(number[:-1, :-1], number[1:, 1:]), (number[:-1, 1:], number[1:, :-1])]
    return x, np.concatenate([np.stack(pair, axis=-1).reshape(-1, 2) for pair in pairs])


def shaken(x: Floats) -> Floats:
    """x, y, z, w of particles and of the rows after them."""
    xw = aligned(len(x) + 8, 4)
    xw[: len(x), :3], xw[: len(x), 3] = x, 1.0
    return xw


def time_distances(n: int) -> tuple[int, int, float]:
    """Constraints, particles, and seconds a sweep of a sheet of n x n particles."""
    x, nodes = lattice(n)
    made = batches(len(x), nodes)
    rest = made.lanes(np.linalg.norm(np.round(x[nodes[:, 1]]) - np.round(x[nodes[:, 0]]), axis=1), 1.0)
    xw, inverse, soft, lam = shaken(x), *(aligned(*rest.shape) for _ in range(3))
    distance.prepare_distances(xw, made.nodes, np.full(rest.shape, 1e-3), 1.0, 0.0, inverse, soft)
    arrays = aligned(distance.N_WORK), xw, made.nodes, rest, inverse, soft, lam
    inner = max(1, 200_000 // len(nodes))
    _distances(1, *arrays)
    return len(nodes), len(x), least(lambda: _distances(inner, *arrays)) / inner


def time_tetrahedra(n: int) -> tuple[int, int, float]:
    """Tetrahedra, particles, and seconds a sweep of a cube of n^3 cubes of six."""
    steps = np.array([1, n + 1, (n + 1) ** 2])
    corner = np.stack(np.meshgrid(*(np.arange(n),) * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ steps
    nodes = (corner[:, None, None] + kuhn() @ steps).reshape(-1, 4).astype(np.int32)
    line = np.arange(n + 1.0)
    x = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    tets = build_tetrahedra(np.ascontiguousarray(x), nodes)
    compliance, gamma = tets.pair(ElasticConstants(1.0, 2.0))
    soft = compliance / 1e-2
    made = tets.batches
    x = x + 1e-2 * np.random.default_rng(0).standard_normal(x.shape)
    lam = np.zeros((len(made.row), 2, 8))
    arrays = aligned(neo_hookean.N_WORK), shaken(x), made.nodes, tets.inverse, soft, gamma, lam
    inner = max(1, 50_000 // len(nodes))
    _pairs(1, *arrays)
    return len(nodes), len(x), least(lambda: _pairs(inner, *arrays)) / inner


def sweep_table(
    console: Console,
    title: str,
    timed: Callable[[int], tuple[int, int, float]],
    sizes: tuple[int, ...],
    bytes_each: int,
    copied: float,
) -> None:
    """bytes_each of a constraint alone; a particle's row is read and written once a tile besides."""
    table = Table(title, "particles", "ns each", "10^6/s", "GB/s", "of a copy")
    counts, times = [], []
    for size in sizes:
        m, n, seconds = timed(size)
        counts.append(m)
        times.append(seconds)
        moved = (bytes_each + 64.0 * n / m) * m / seconds
        table.add_row(
            f"{m:,}", f"{n:,}", f"{1e9 * seconds / m:.2f}", f"{1e-6 * m / seconds:.0f}", f"{1e-9 * moved:.1f}",
            f"{moved / copied:.0%}",
        )  # fmt: skip
    console.print(table)
    console.print(f"time ~ constraints^{np.polyfit(np.log(counts), np.log(times), 1)[0]:.3f}")


def cloth(console: Console) -> None:
    """The cloth case as `softseam run` does it, without frames; and what a step of it allocates."""
    simulation = Simulation(load_scene(CLOTH).bundle, EmbeddedTransport())
    best, worst = np.inf, 0.0
    for _ in range(3):
        simulation.reset()
        began = process_time()
        while not simulation.done:
            report = simulation.step(fields=False)
            worst = max(worst, report.quantities["stretch_violation"])
        best = min(best, process_time() - began)
    time, steps = simulation.time, round(simulation.time / simulation.scene.step)
    simulation.close()
    console.print(
        f"cloth_fold: {time:.2f} s in {best:.2f} s of CPU: {time / best:.2f} x real time on one core, "
        f"{1e3 * best / steps:.2f} ms a step; worst violation {worst:.1%}"
    )
    console.print(f"allocations of a step: {_allocations(10)} with 10 substeps, {_allocations(20)} with 20")


def _allocations(substeps: int) -> int:
    """What numba allocates in a step of a small sheet on the ground."""
    body = {
        "kind": "sheet",
        "size": (0.2, 0.2),
        "divisions": (20, 20),
        "density": 0.3,
        "stretch": 1e3,
        "position": (0.0, 0.0, 0.00375),
    }
    tools = {"ground": {"kind": "plane", "friction": 0.5}}
    run = ParticleRun(particle_scene(body, gravity=(0.0, 0.0, -9.81), tools=tools, pbd={"substeps": substeps}))
    run.run(0.1)
    motion = tool_motion(run.position, run.orientation, run.velocity, run.scene.step)
    request = Advance(Header(SCHEMA_VERSION, "", "far", 0, 0, 0, 0.0), run.scene.step, np.zeros((0, 3)), motion)
    before = int(rtsys.get_allocation_stats().alloc)  # type: ignore[no-untyped-call]
    run.solver.advance(request)
    return int(rtsys.get_allocation_stats().alloc) - before  # type: ignore[no-untyped-call]


def main() -> None:
    console = Console()
    source, to = np.ones(1 << 24), np.ones(1 << 24)
    copied = 2 * source.nbytes / least(lambda: np.copyto(to, source))
    console.print(f"limit of this core: {1e-9 * copied:.1f} GB/s copied")
    # a distance: 2 ids, rest, inverse, soft, and lambda to and fro; a pair: 4 ids, 9 + 2 + 1, and lambda to and fro
    sweep_table(console, "distances", time_distances, (12, 50, 160, 500, 708), 8 + 3 * 8 + 16, copied)
    sweep_table(console, "tet pairs", time_tetrahedra, (5, 10, 20, 40), 16 + 12 * 8 + 2 * 16, copied)
    cloth(console)


if __name__ == "__main__":
    main()
