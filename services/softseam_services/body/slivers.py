"""Slivers: octants that the body fills by little beside a fuller one, and the root that each is joined to.

An octant with little of the body in it has a deformation gradient of its own, and with it a constraint on its volume
and next to no stiffness. FEM lets its volume count with the gradient of a fuller octant, its root (`fem.joints`).

Whether an octant is a sliver goes by its 26 neighbours of its own material, all over the body: it is filled by less
than `THIN` of the fullest of them. Its root lies in its own cell, where that has an octant that is no sliver. A cell of
slivers alone, a sliver cell, is joined to one root cell, the nearest that is none: then all its nodes can follow it.
"""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.lattice import octants_around

THIN = 0.3
"""of the fullest octant around; more joins more and is coarser, less leaves octants that are soft and stiff at once"""
_RINGS = 2
"""sliver cells that are farther from a root cell than so many cells stay alone: they do not follow its functions"""
_OCTANT = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)], dtype=np.int32)


def true_fill(body: Body, cells: Ints) -> Floats:
    """What the shape itself fills of each octant of these cells (c, 8) [1], without the floor of empty ones."""
    return np.asarray(body.moments[cells, :, 0] if len(body.moments) else body.fill[cells])


def root_octants(body: Body, cells: Ints) -> Ints:
    """The root of each octant of these cells (c, 8), as 8 times the place of its cell in `cells` plus the octant.

    An octant that is no sliver, or has no root among these cells, is its own.
    """
    n_cells = len(cells)
    root = np.arange(8 * n_cells, dtype=np.int32).reshape(-1, 8)
    if not body.boxes or body.fill.min() == 1.0:
        return root
    sliver = _slivers(body)[cells]
    fill, material = true_fill(body, cells), body.octant_material[cells]
    thin: NDArray[np.bool_] = np.asarray(sliver.all(axis=1))
    _join(np.flatnonzero(sliver.any(axis=1) & ~thin), None, root, sliver, fill, material, body.cell_grid[cells])
    of_cell = _root_cells(body.cell_grid[cells], thin, fill.sum(axis=1))
    _join(np.flatnonzero(thin & (of_cell >= 0)), of_cell, root, sliver, fill, material, body.cell_grid[cells])
    return root


def _slivers(body: Body) -> NDArray[np.bool_]:
    """(C, 8)"""
    fill = true_fill(body, np.arange(body.n_cells, dtype=np.int32)).reshape(-1)
    material, around = body.octant_material.reshape(-1), octants_around(body.cell_grid)
    alike = (around >= 0) & (material[around] == material[:, None])
    fullest = np.where(alike, fill[around], 0.0).max(axis=1)
    return np.asarray((fill < THIN * fullest) | (fill == 0.0)).reshape(-1, 8)


def _join(
    cells: NDArray[np.int64],
    of_cell: Ints | None,
    root: Ints,
    sliver: NDArray[np.bool_],
    fill: Floats,
    material: Ints,
    grid: Ints,
) -> None:
    """Give the slivers of these cells the nearest octant of their material in their root cell, root (c, 8) in place.

    of_cell (c,): root cells, None for each cell's own. Of equally near ones the fullest, then the first
    """
    for cell in cells:
        other = cell if of_cell is None else of_cell[cell]
        kept = np.flatnonzero(~sliver[other])
        for octant in np.flatnonzero(sliver[cell]):
            choices = kept[material[other, kept] == material[cell, octant]]
            if len(choices):
                away = np.abs(2 * (grid[other] - grid[cell]) + _OCTANT[choices] - _OCTANT[octant]).sum(axis=1)
                root[cell, octant] = 8 * other + choices[np.lexsort((-fill[other, choices], away))[0]]


def _root_cells(grid: Ints, thin: NDArray[np.bool_], volume: Floats) -> Ints:
    """Root cell of each sliver cell (c,), -1 where none is near, and of other cells.

    grid (c, 3); thin (c,): sliver cells; volume (c,): of equally near cells the fullest is taken
    """
    number = np.full(grid.max(axis=0) + 3, -1, dtype=np.int32)
    number[tuple((grid + 1).T)] = np.arange(len(grid))
    steps = np.array(list(np.ndindex(3, 3, 3)), dtype=np.int32) - 1
    steps = steps[np.argsort(np.abs(steps).sum(axis=1), kind="stable")[1:]]
    far = np.abs(steps).sum(axis=1)
    of_cell = np.where(thin, -1, np.arange(len(grid))).astype(np.int32)
    for _ in range(_RINGS):
        found = of_cell.copy()
        for cell in np.flatnonzero(of_cell < 0):
            beside = number[tuple((grid[cell] + 1 + steps).T)]
            there = (beside >= 0) & (of_cell[beside] >= 0)
            if there.any():
                choices = beside[there]
                found[cell] = of_cell[choices[np.lexsort((-volume[choices], far[there]))[0]]]
        of_cell = found
    return np.where(thin, of_cell, -1).astype(np.int32)
