"""Cases for PBD with values of independent codes and closed forms, for tests and benchmarks.

The codes (felupe, CalculiX, dolfinx; uncertainties below 0.1 % unless said) solved
a beam of 0.1 x 0.02 x 0.02 m, E 100 kPa, rho 1000, nu 0.3, under gravity, at rest and let go; a cube of 4 cm, E 50 kPa,
nu 0.45, bonded between plates; a bar of 1 m, E 100 kPa, rho 1000, nu 0, with a pulse of pressure at one end.
Statics are solved on the blocks by Newton's method: where PBD comes to rest, whatever its substeps (tests see to it).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pbd_run import PbdRun, block_scene, cantilever
from scipy.sparse.linalg import splu

from softseam_services.calibration.modes import BLOCK_REACH, block_force, node_grid, stiffness

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
BEAM = (0.1, 0.02, 0.02)
BEAM_RESTS, BEAM_FALLS = -0.0345404, -0.0630516
"""lowest tip at rest and first lowest tip when let go [m]"""
BONDED = {0.05: 4.91716, 0.15: 16.2662}
"""force on a plate at these squeezes [N], the second within 0.4 %"""


def newton(
    run: PbdRun,
    x: Floats,
    free: NDArray[np.bool_],
    load: Floats | float,
    grid: Ints | None = None,
    reach: int = BLOCK_REACH,
) -> Floats:
    """Where the blocks' forces balance `load` on the free coordinates (n, 3); grid and reach as in `stiffness`."""
    force, grid = block_force(run.solver), node_grid(run.body) if grid is None else grid
    step, kept = 1e-6 * float(run.body.edges.min()), np.flatnonzero(free.ravel())
    for n in range(30):
        share = min(1.0, 0.25 * (n + 1))
        residual = (force(x) + share * np.broadcast_to(load, x.shape)).ravel()[kept]
        matrix = stiffness(force, x, grid, reach, step)[kept][:, kept].tocsc()
        move = splu(matrix).solve(residual)
        x.reshape(-1)[kept] += move
        if share == 1.0 and np.abs(move).max() < 1e-9:
            return x
    raise RuntimeError("no equilibrium in thirty steps")


def beam_at_rest(across: int) -> float:
    run = PbdRun(cantilever(BEAM, 0.04 / across, 1e5, 0.3))
    free = np.repeat(~run.region.fixed[:, None], 3, axis=1)
    load = run.region.mass[:, None] * run.body.gravity
    x = newton(run, run.body.x_rest.copy(), free, load)
    tip = np.argmin(np.linalg.norm(run.body.x_rest - np.array([0.1, 0.0, 0.0]), axis=1))
    return float((x - run.body.x_rest)[tip, 2]) / BEAM_RESTS - 1.0


def beam_falls(across: int, substeps: int | str) -> tuple[float, int]:
    """Error of the first lowest tip, and substeps a step of 10 ms."""
    run = PbdRun(cantilever(BEAM, 0.04 / across, 1e5, 0.3, pbd={"substeps": substeps}))
    tip = np.argmin(np.linalg.norm(run.body.x_rest - np.array([0.1, 0.0, 0.0]), axis=1))
    path = [0.0]
    for _ in range(20):
        run.step()
        path.append(float(run.solver.positions[tip, 2] - run.body.x_rest[tip, 2]))
    low = int(np.argmin(path))
    a, b, c = np.polyfit([-1.0, 0.0, 1.0], path[low - 1 : low + 2], 2)
    return (c - b * b / (4.0 * a)) / BEAM_FALLS - 1.0, run.solver.substeps


def bonded_cube(across: int, squeeze: float) -> float:
    run = PbdRun(block_scene((0.04, 0.04, 0.04), 0.08 / across, young=5e4, poisson=0.45))
    rest = run.body.x_rest
    z = rest[:, 2] - rest[:, 2].mean()
    held = np.abs(z) > 0.02 - 1e-9
    free = np.repeat(~held[:, None], 3, axis=1)
    x = rest.copy()
    for part in (0.5, 1.0):
        x[:, 2] = rest[:, 2].mean() + z * (1.0 - part * squeeze)
        x = newton(run, x, free, 0.0)
    pressed = block_force(run.solver)(x)[held & (z > 0.0), 2].sum()
    return float(pressed) / BONDED[squeeze] - 1.0


def bar_wave(n: int, substeps: int | str) -> tuple[float, float]:
    """n blocks along the bar: error of the peak velocity at L/4 as the pulse goes by, and the worst tail after it."""
    cell = 2.0 / n
    scene = block_scene(
        (1.0, 0.05, 0.05), cell, young=1e5, poisson=0.0, density=1000.0, step=0.0005, pbd={"substeps": substeps}
    )
    everything = PbdRun(scene)
    face = np.flatnonzero(everything.body.x_rest[:, 0] < -0.5 + 1e-9).astype(np.int32)
    run = PbdRun(scene, seam=face)
    # uniform traction on the blocks: a quarter of each block's face to each of its nodes
    blocks = run.solver.model.blocks
    weight = np.bincount(blocks.nodes.transpose(0, 2, 1).reshape(-1, 8)[blocks.octant.ravel() >= 0].ravel())[face]
    weight = weight / weight.sum()
    at = np.flatnonzero(np.abs(run.body.x_rest[:, 0] + 0.25) < 0.51 * cell / 2.0)
    history = []
    for step in range(150):
        t = (step + 0.5) * scene.step
        pressure = 10.0 * np.sin(np.pi * t / 0.02) ** 2 if t < 0.02 else 0.0
        force = np.zeros((len(face), 3))
        force[:, 0] = pressure * 0.05 * 0.05 * weight
        run.step(force)
        history.append(float(run.committed.v[at, 0].mean()))
    peak, after = max(history), history[round(0.06 / scene.step) :]
    return peak / 1e-3 - 1.0, float(np.abs(after).max()) / 1e-3


def order(sizes: list[float], errors: list[float]) -> float:
    """Slope of the error over the size of cells or substeps."""
    return float(np.polyfit(np.log(sizes), np.log(np.abs(errors)), 1)[0])
