"""Whole scenes of `make pbd`: two threads, the released cantilever (A), tofu squeezed and lifted (B)."""

from __future__ import annotations

from time import perf_counter, process_time

import numpy as np
from pbd_run import PbdRun, block_scene, cantilever
from rich.console import Console
from rich.table import Table

from softseam_services.pbd.kernels.lanes import LANES
from softseam_services.pbd.two_threads import TwoThreads
from softseam_studies.study.measure import measure

TIP = -0.1504
"""lowest tip of scene A [m], two independent codes"""
HOLD = 13.1
"""force per plate of scene B at 15 % in the hold [N], three independent codes, +- 0.1 N"""
HELD = (1.2, 1.42)
"""when tofu_grasp's plates have closed and not yet lifted [s]"""
PLATE = {"kind": "box", "size": (0.01, 0.06, 0.06), "friction": 0.6}


def two_threads(console: Console) -> None:
    """A step of 20 substeps of a hanging cube: one thread against two, wall time, the least of six."""
    table = Table("blocks", "bytes a block", "one thread [ms]", "two [ms]", "speed-up", "same bits")
    for n in (6, 10, 16, 24):
        size = 0.025 * n
        scene = block_scene(
            (size, size, size),
            0.025,
            gravity=(0.0, 0.0, -9.81),
            fixed=({"min": (-9.0, -9.0, -9.0), "max": (-size / 2, 9.0, 9.0)},),
            step=0.002,
            pbd={"substeps": 20},
        )
        runs = PbdRun(scene), PbdRun(scene)
        if not runs[1].scratch.pair.possible:
            continue
        least = [np.inf, np.inf]
        for _ in range(7):
            for two, run in enumerate(runs):
                let_step_by(run.scratch.pair, two > 0)
                request = run.request()
                began = perf_counter()
                run.solver.advance(request)
                least[two] = min(least[two], perf_counter() - began)
                run.solver.commit()
        solver = runs[0].solver
        blocks = solver.model.blocks
        arrays = (
            blocks.nodes,
            solver.parameters.blocks.volume,
            blocks.octant,
            solver.parameters.arrays.softness,
        )
        used = sum(each.nbytes for each in arrays) + 2 * runs[0].work.buffer.nbytes
        used += sum(
            each.nbytes
            for record in (runs[0].scratch.arrays, runs[0].scratch.arrays.contacts)
            for each in vars(record).values()
            if isinstance(each, np.ndarray)
        )
        same = solver.snapshot() == runs[1].solver.snapshot()
        table.add_row(
            str(int((blocks.octant >= 0).sum())),
            f"{used / (LANES * blocks.n_batches):.0f}",
            f"{1e3 * least[0]:.2f}",
            f"{1e3 * least[1]:.2f}",
            f"{least[0] / least[1]:.2f}",
            "yes" if same else "NO",
        )
    console.print(table)


def let_step_by(pair: TwoThreads, two: bool) -> None:
    """Let the next step be taken by one thread, or by two."""
    pair.seconds = [1.0, 0.5] if two else [0.5, 1.0]
    pair.n_runs = 0


A_CASES = (
    ((4, 1, 1), "physical", False),
    ((6, 1, 1), "physical", False),
    ((8, 1, 1), "physical", False),
    ((8, 2, 2), "physical", False),
    ((12, 3, 3), "physical", False),
    ((3, 1, 1), "fitted", False),
    ((5, 1, 1), "fitted", False),
    ((6, 1, 1), "fitted", False),
    ((8, 2, 2), "physical", True),
    ((16, 4, 4), "physical", True),
    ((6, 2, 2), "fitted", True),
    ((10, 2, 2), "fitted", True),
)
"""counts of cells, hourglass, and whether each cell is one block, not eight"""


def _let_go(
    counts: tuple[int, int, int], hourglass: str, coarse: bool, method: str, step: float
) -> tuple[PbdRun, float, float]:
    """Scene A over 0.6 s: the run, its lowest tip [m], and its real time over CPU time."""
    pbd = {"method": method, "hourglass": hourglass, "coarse": {"beyond": 0.0} if coarse else None}
    cell = (0.2 / counts[0], 0.05 / counts[1], 0.05 / counts[2])
    scene = cantilever((0.2, 0.05, 0.05), cell, 1e5, 0.4, pbd=pbd)
    run = PbdRun(scene.model_copy(update={"step": step}))
    tip = np.argmin(np.linalg.norm(run.body.x_rest - np.array([0.2, 0.0, 0.0]), axis=1))
    lowest, spent = 0.0, []
    for _ in range(round(0.6 / step)):
        request = run.request()
        began = process_time()
        run.solver.advance(request)
        spent.append(process_time() - began)
        run.solver.commit()
        run.n_steps += 1
        lowest = min(lowest, run.solver.positions[tip, 2] - run.body.x_rest[tip, 2])
    return run, lowest, step / float(np.median(spent))


def scene_a(console: Console) -> None:
    """Error of the lowest tip, and speed with steps of 10 ms and of 50 ms, by sweeps and by leapfrog."""
    table = Table("scene A, cells", "blocks", "hourglass", "method", "substeps", "lowest tip", "RTF", "steps of 50 ms")
    for counts, hourglass, coarse in A_CASES:
        for method in ("xpbd", "leapfrog"):
            run, lowest, speed = _let_go(counts, hourglass, coarse, method, 0.01)
            long = _let_go(counts, hourglass, coarse, method, 0.05)[2]
            table.add_row(
                "{} x {} x {}".format(*counts) + (" coarse" if coarse else ""),
                str(int((run.solver.model.blocks.octant >= 0).sum())),
                hourglass,
                method,
                str(run.solver.substeps),
                f"{lowest / TIP - 1.0:+.1%}",
                f"{speed:.0f}",
                f"{long:.0f}",
            )
    console.print(table)


def scene_b(console: Console) -> None:
    """Grip force of the hold, and speed over settling, squeeze and hold."""
    table = Table("scene B, cells", "substeps", "hold [N]", "error", "RTF")
    for n, step in ((2, 0.01), (3, 0.01), (4, 0.01), (3, 0.005)):
        tools = {
            "ground": {"kind": "plane", "friction": 0.6},
            "left": {**PLATE, "position": (-0.0305, 0.0, 0.025)},
            "right": {**PLATE, "position": (0.0305, 0.0, 0.025)},
        }
        scene = block_scene(cell=0.05 / n, gravity=(0.0, 0.0, -9.81), tools=tools, moved=("left", "right"), step=step)
        run = PbdRun(scene)
        spent = 0.0
        # 0.5 mm to go on either side, then 7.5 % of the cube from each: 21.25 steps of 10 ms at 20 mm/s
        for speed, seconds in ((0.0, 0.4), (0.02125, 0.2), (0.0, 0.4)):
            run.velocity[1:, 0] = speed, -speed
            for _ in range(round(seconds / step)):
                began = process_time()
                reply = run.step()
                spent += process_time() - began
        hold = float(reply.wrench[2, 0] - reply.wrench[1, 0]) / 2.0
        table.add_row(
            f"{n}^3, {1e3 * step:.0f} ms",
            str(run.solver.substeps),
            f"{hold:.2f}",
            f"{hold / HOLD - 1.0:+.1%}",
            f"{1.0 / spent:.0f}",
        )
    console.print(table)


def scene_b_in_the_product(console: Console) -> None:
    """The whole motion of scene tofu_grasp by XPBD alone, embedded: grip force of the hold, and processor time."""
    table = Table("tofu_grasp, cells", "blocks", "step [ms]", "hold [N]", "error", "RTF")
    for counts, step in (((2, 2, 2), 0.06), ((3, 2, 2), 0.06), ((4, 2, 2), 0.04), ((4, 2, 2), 0.01)):
        cell = [0.05 / n for n in counts]
        settings = (f"body.cell={cell}", f"step={step}", "models.pbd={hourglass: fitted}", "regions={default: pbd}")
        found = measure("tofu_grasp", settings, ("grip_force",), runs=5)
        assert found.series is not None, found.reason
        held = float(np.median(found.series.at("grip_force", np.linspace(*HELD, 9))))
        table.add_row(
            "{} x {} x {}".format(*counts),
            str(8 * found.n_cells),
            f"{1e3 * step:.0f}",
            f"{held:.2f}",
            f"{held / HOLD - 1.0:+.1%}",
            f"{found.simulated / found.cpu:.0f}",
        )
    console.print(table)
