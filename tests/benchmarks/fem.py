"""Time, memory and limits of the FEM participant by size: `python tests/benchmarks/fem.py [most unknowns]`.

A cube of tofu between plates, full hex27 cells, one thread. Times are CPU times, the least of a few repeats, in ms;
flops and bytes are counted and compared with a matrix product of 96 x 96 and a triad that are measured in the same run.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fem_run import CLOSE, FemRun, tofu
from timing import least

from softseam_services.fem.inputs import moved
from softseam_services.fem.kernels.candidates import find_candidates
from softseam_services.fem.kernels.contact import add_contact_forces, evaluate_contacts
from softseam_services.fem.kernels.elements import add_cell_tangents
from softseam_services.fem.kernels.fronts import ALL, OWN, add_diagonal, factor, solve
from softseam_services.fem.kernels.newton import residual

SIZES = ((4, 1, 1), (2, 2, 2), (3, 3, 3), (4, 4, 4), (5, 5, 5), (7, 7, 7), (12, 12, 12), (15, 15, 15))
STEP = 0.005
# of a cell: 378 pairs of nodes, 8 points, 15 products and sums
TANGENT_FLOPS = 378 * 8 * 15 * 2


@njit(cache=True)
def _triad(a, b, c):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        a[i] = b[i] + 3.0 * c[i]


def limits() -> tuple[float, float]:
    """Flops of a small product and bytes of a triad, a second."""
    a = np.asfortranarray(np.random.default_rng(0).random((96, 96)))
    out = np.empty_like(a)
    flops = 100 * 2 * 96**3 / least(lambda: [np.matmul(a, a, out=out) for _ in range(100)])
    x, y, z = (np.ones(4_000_000) for _ in range(3))
    _triad(x, y, z)
    return flops, 24 * len(x) / least(lambda: _triad(x, y, z))


@dataclass
class Row:
    """Seconds a call."""

    unknowns: int
    build: float
    assemble: float
    prepare: float
    solve: float
    residual: float
    contact: float
    megabytes: float
    flops: float = 0.0
    bytes: float = 0.0
    cells: int = 0
    newton: dict[str, float] = field(default_factory=dict)


def measure(counts: tuple[int, int, int]) -> Row:
    began = time.process_time()
    run = FemRun(tofu(cell=(0.05 / counts[0], 0.05 / counts[1], 0.05 / counts[2])))
    build = time.process_time() - began
    solver = run.solver
    model, parameters, work = run.model, run.parameters, run.work
    tree = model.tree
    tools = moved(solver._tools, run.request().tools)
    x = parameters.x_rest.copy()
    n = 3 * int(np.count_nonzero(tree.position >= 0))
    contact = solver.committed.contact
    reach = 0.25 * parameters.edge

    def assemble() -> None:
        work.values[:] = 0.0
        add_diagonal(tree, work.values, parameters.mass, 1.0 / STEP**2)
        add_cell_tangents(x, model, parameters, tree, work, False)

    def ready() -> None:
        assert factor(tree, work.values, work.factoring) == 0

    def both() -> None:
        assemble()
        ready()

    def touch() -> None:
        count = find_candidates(x, np.zeros_like(x), 0.0, model, parameters, tools, contact, reach, 1.0, 1.0, work)
        evaluate_contacts(x, model, parameters, tools, count, work)
        add_contact_forces(model, parameters, count, work, work.r)

    b = np.random.default_rng(1).standard_normal(n)

    def answer() -> None:
        work.d[:] = b
        solve(tree, work.values, work.d, work.factoring)

    both()
    row = Row(n, build, least(assemble), 0.0, 0.0, 0.0, 0.0, 0.0)
    row.prepare = least(both) - row.assemble
    both()
    row.solve = least(answer)
    k, m = 3.0 * tree.meta[:, OWN], 3.0 * tree.meta[:, ALL]
    row.flops = float((k**3 / 3 + k**2 * (m - k) + k * (m - k) ** 2).sum())
    row.bytes = 16.0 * len(work.values) / row.solve
    row.residual = least(lambda: residual(x, x, model, parameters, tools, 0, 1.0 / STEP**2, 1.0, work))
    row.contact = least(touch)
    row.megabytes = 1e-6 * _size((model, parameters, work))
    row.cells = len(model.cell_nodes)
    if n < 20_000:
        row.newton = steps(run)
    return row


def steps(run: FemRun) -> dict[str, float]:
    """Newton iterations of a squeeze: how many and how many factors a step, ms an iteration, share of Python."""
    solver = run.solver
    inner = [0.0]
    stepper = solver.stepper
    advance = stepper._advance

    def timed(*args: Any, **keys: Any) -> int:
        began = time.process_time()
        status = advance(*args, **keys)
        inner[0] += time.process_time() - began
        return status

    run.step(CLOSE)
    stepper._advance = timed  # type: ignore[method-assign]
    factors, began = solver.factorisations, time.process_time()
    n_steps = 40 if len(run.region.nodes) < 1000 else 12
    iterations = sum(run.step(CLOSE).extras["iterations"] for _ in range(n_steps))
    spent = time.process_time() - began
    return {
        "iterations": iterations / n_steps,
        "factors": (solver.factorisations - factors) / n_steps,
        "ms": 1e3 * spent / iterations,
        "python": 1e3 * (spent - inner[0]) / n_steps,
    }


def _size(arrays: object) -> float:
    if isinstance(arrays, np.ndarray):
        return float(arrays.nbytes)
    if hasattr(arrays, "_declared"):  # a record, see record.py
        return sum(_size(getattr(arrays, name)) for name in arrays._declared._fields)
    return sum(_size(part) for part in arrays) if isinstance(arrays, tuple) else 0.0


def exponent(rows: list[Row], what: Callable[[Row], float]) -> float:
    """Slope of log time over log unknowns, of the larger half of the sizes."""
    rows = rows[len(rows) // 2 - 1 :]
    return float(np.polyfit(np.log([r.unknowns for r in rows]), np.log([what(r) for r in rows]), 1)[0])


def main(most: int) -> None:
    flops, rate = limits()
    print(f"limits: {1e-9 * flops:.0f} GFLOP/s (product of 96 x 96), {1e-9 * rate:.1f} GB/s (triad)\n")
    print("| unknowns | build s | assemble | factor | solve | residual | contact | MB | of the limits |")
    print("|---|---|---|---|---|---|---|---|---|")
    rows: list[Row] = []
    for counts in SIZES:
        if 3 * int(np.prod(2 * np.array(counts) + 1)) > most:
            continue
        row = measure(counts)
        rows.append(row)
        ratio = f"assemble {TANGENT_FLOPS * row.cells / row.assemble / flops:.2f}, "
        ratio += f"factor {row.flops / row.prepare / flops:.2f}, solve {row.bytes / rate:.2f}"
        print(
            f"| {row.unknowns} | {row.build:.2f} | {1e3 * row.assemble:.3g} | {1e3 * row.prepare:.3g} | "
            f"{1e3 * row.solve:.3g} | {1e3 * row.residual:.3g} | {1e3 * row.contact:.3g} | {row.megabytes:.0f} | "
            f"{ratio} |",
            flush=True,
        )
    print("\n| unknowns | iterations a step | factors a step | ms an iteration, all told | ms of Python a step |")
    print("|---|---|---|---|---|")
    for row in rows:
        if row.newton:
            values = (row.newton[key] for key in ("iterations", "factors", "ms", "python"))
            print(f"| {row.unknowns} | " + " | ".join(f"{v:.3g}" for v in values) + " |")
    if len(rows) > 2:
        parts = {"assemble": lambda r: r.assemble, "factor": lambda r: r.prepare, "solve": lambda r: r.solve,
                 "memory": lambda r: r.megabytes}  # fmt: skip
        print(
            "\ngrowth with unknowns: " + ", ".join(f"{name} {exponent(rows, what):.2f}" for name, what in parts.items())
        )
    print(f"\npeak memory of the process {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10**6)
