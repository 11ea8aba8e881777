"""The slowest oscillation of a body at rest, from the forces of its elements: what a participant should show."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import eigsh

from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.lattice import LOCAL
from softseam_services.body.region import build_region
from softseam_services.fem.kernels.elements import subtract_forces
from softseam_services.fem.structures import build_tables
from softseam_services.fem.work import build_work
from softseam_services.pbd.kernels.block import new_workspace
from softseam_services.pbd.kernels.block_rows import N_STRESS
from softseam_services.pbd.kernels.sweep import block_forces, exact_stress
from softseam_services.pbd.solver import PbdSolver

Force = Callable[[Floats], Floats]
"""positions (n, 3) to forces of the elements on the nodes (n, 3)"""

BLOCK_REACH, CELL_REACH = 1, 2
"""how far on the lattice a node of a block, and of a hex27 cell, is felt"""
RIGID = 1e-6
"""least (omega L/c_p)^2 of an oscillation; below, a body moves without being strained"""
SHIFT = 0.01
"""(omega L/c_p)^2 about which modes are sought, below zero"""
RIGID_MODES = 6


def node_grid(body: Body) -> Ints:
    """Place of each node on the lattice (N, 3); ValueError where cells do not lie on one."""
    grid = np.empty((body.n_nodes, 3), dtype=np.int32)
    places = 2 * body.cell_grid[:, None, :] + LOCAL
    grid[body.cell_nodes] = places
    if not np.array_equal(grid[body.cell_nodes], places) or len(np.unique(body.cell_grid, axis=0)) < body.n_cells:
        raise ValueError(
            "calibrating takes cells that lie on a lattice, which those of a file, and those around a sphere, need "
            "not: calibrate a block of about its size, or leave out `shape.cells`, or `borders`"
        )
    return grid


def block_force(solver: PbdSolver) -> Force:
    """Forces of a region's blocks."""
    blocks, numbers, n = solver.model.blocks, solver.parameters.blocks, solver.model.n_nodes
    xw, ws = np.zeros((n + 8, 4)), new_workspace()
    xw[n:, :3] = numbers.padding_x
    stress = np.zeros((blocks.n_batches, N_STRESS))

    def force(x: Floats) -> Floats:
        xw[:n, :3] = x
        exact_stress(ws, xw, blocks.nodes, numbers.volume, stress, numbers.constants, numbers.law)
        f = np.zeros((n + 8, 4))
        block_forces(ws, blocks.nodes, stress, numbers.constants, f, 0, blocks.n_batches)
        return f[:n, :3]

    return force


def cell_force(body: Body) -> Force:
    """Forces of the whole body's hex27 cells."""
    everything = np.arange(body.n_cells, dtype=np.int32)
    model, parameters = build_tables(body, build_region(body, everything, np.zeros(0, dtype=np.int32)))
    work = build_work(model, parameters, 0)

    def force(x: Floats) -> Floats:
        r = np.zeros_like(work.r)
        subtract_forces(x, model, parameters, work, r)
        return np.ascontiguousarray(r.reshape(-1, 3)[model.order])

    return force


def stiffness(force: Force, x: Floats, grid: Ints, reach: int, step: float) -> csc_array:
    """K = -df/dx (3n, 3n) by central differences of `step` [m].

    Nodes whose places agree modulo 2 reach + 1 share no neighbour, so all of them move at once: 3 (2 reach + 1)^3 pairs
    of forces give the whole matrix.
    """
    period, n = 2 * reach + 1, len(x)
    low = grid.min(axis=0) - reach
    number = np.full(tuple(grid.max(axis=0) - low + reach + 1), -1, dtype=np.int64)
    number[tuple((grid - low).T)] = np.arange(n)
    rows, columns, values = [], [], []
    for colour in np.ndindex(period, period, period):
        away = (np.array(colour) - grid + reach) % period - reach
        moved = number[tuple((grid + away - low).T)]
        felt = np.flatnonzero(moved >= 0)
        chosen = (away == 0).all(axis=1)
        if not chosen.any():
            continue
        for axis in range(3):
            shift = np.zeros_like(x)
            shift[chosen, axis] = step
            change = (force(x + shift) - force(x - shift))[felt] / (-2.0 * step)
            rows.append((3 * felt[:, None] + np.arange(3)).ravel())
            columns.append(np.repeat(3 * moved[felt] + axis, 3))
            values.append(change.ravel())
    found = csc_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(3 * n, 3 * n))
    return csc_array(0.5 * (found + found.T))


def slowest_mode(matrix: csc_array, mass: Floats, free: NDArray[np.bool_], wave_rate: float) -> tuple[float, Floats]:
    """omega [rad/s] and mode (n, 3), largest displacement 1, of K u = omega^2 M u; wave_rate is c_p/L [1/s]."""
    kept = np.flatnonzero(np.repeat(free, 3))
    weight = 1.0 / np.sqrt(np.repeat(mass, 3)[kept])
    scaled = csc_array(diags_array(weight) @ matrix[kept][:, kept] @ diags_array(weight))
    start = np.cos(np.arange(len(kept)) ** 2)
    count = 1 + RIGID_MODES
    squares, vectors = eigsh(scaled, k=count, sigma=-SHIFT * wave_rate**2, v0=start)
    elastic = np.flatnonzero(squares > RIGID * wave_rate**2)
    first = elastic[np.argmin(squares[elastic])]
    mode = np.zeros(3 * len(free))
    mode[kept] = weight * vectors[:, first]
    return float(np.sqrt(squares[first])), mode.reshape(-1, 3) / np.abs(mode).max()
