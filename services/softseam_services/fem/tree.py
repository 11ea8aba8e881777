"""A region's matrix as a tree of fronts, for the kernels that factor it and solve with it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.jit import record

from .kernels.panel import STRIP

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Floats = NDArray[np.float64]


@record
class Tree(NamedTuple):
    """Fronts in the order of elimination; children before parents. A plain tuple of arrays for the kernels."""

    meta: Longs
    """per front (n_fronts, 11): first own node (in elimination order), own nodes (at least one), all nodes, parent (-1
    for a root), offset of its panel, offset of its rows, offset of what it leaves over, first child, next sibling (-1
    for none), range of its runs"""
    rows: Ints
    """elimination positions of each front's nodes, own nodes first, ascending, one front after the other"""
    runs: Ints
    """boundary nodes of a front that follow each other in its parent, too: place of the first among the boundary nodes,
    how many, place of the first in the parent's front (n_runs, 3)"""
    position: Ints
    """place of each node in the elimination order, -1 for clamped nodes (n_nodes,)"""
    own_front: Ints
    """front that eliminates the node at each place of the order (n_free,)"""
    cell_local: Ints
    """each cell's nodes in elimination order, clamped nodes last (c, k)"""
    cell_rank: Ints
    """its inverse: place of each of the cell's nodes in that order (c, k)"""
    cell_free: Ints
    """how many of each cell's nodes are not clamped (c,)"""
    cell_column: Longs
    """where the panel column of each of those nodes begins, in elimination order (c, k)"""
    cell_height: Ints
    """and how many rows that panel has (c, k)"""
    cell_row: Ints
    """row of the second node in the panel that owns the first, both in elimination order (c, k, k)"""
    seam_front: int
    """the front that owns the seam, where it is eliminated last; -1 for none"""
    seam_place: Ints
    """place of each seam node in it (s,)"""
    n_values: int
    """total size of the panels"""
    n_rest: int
    """most room for what fronts leave over"""
    widest: int
    """most nodes of a front"""
    strip: int
    """most scratch for a panel"""


@record
class Factoring(NamedTuple):
    """Scratch of factor and solve."""

    rest: Floats
    """what fronts leave over to their parents"""
    strip: Floats
    tile: Floats
    t: Floats
    """rows of a front"""
    ints: Ints


def scratch(tree: Tree) -> Factoring:
    """Arrays of the right sizes."""
    return Factoring(
        rest=np.empty(tree.n_rest),
        strip=np.empty(tree.strip),
        tile=np.empty(2 * STRIP * STRIP),
        t=np.zeros(3 * tree.widest),
        ints=np.zeros(8, dtype=np.int32),
    )


def cell_places(
    cell_nodes: Ints, position: Ints, own_front: Ints, meta: Longs, key: Longs
) -> tuple[Ints, Ints, Ints, Longs, Ints, Ints]:
    """`Tree.cell_local` to `Tree.cell_row`; key: front * n_free + position of all rows, ascending."""
    n_free = len(own_front)
    cell_position = position[cell_nodes]
    last = np.iinfo(np.int32).max
    local = np.argsort(np.where(cell_position < 0, last, cell_position), axis=1, kind="stable").astype(np.int32)
    n_cell_free = np.count_nonzero(cell_position >= 0, axis=1).astype(np.int32)
    rank = np.argsort(local, axis=1).astype(np.int32)
    column = np.zeros(cell_nodes.shape, dtype=np.int64)
    height = np.zeros(cell_nodes.shape, dtype=np.int32)
    row = np.zeros((*cell_nodes.shape, cell_nodes.shape[1]), dtype=np.int32)
    if n_free == 0:
        return local, rank, n_cell_free, column, height, row
    ordered = np.take_along_axis(cell_position, local, axis=1)
    free = np.arange(ordered.shape[1]) < n_cell_free[:, None]
    front = own_front[np.maximum(ordered, 0)]
    for a in range(ordered.shape[1]):
        place = np.searchsorted(key, front[:, a : a + 1].astype(np.int64) * n_free + ordered)
        row[:, a] = np.where(free & free[:, a : a + 1], 3 * (place - meta[front[:, a], 5][:, None]), 0)
    column[:] = np.where(free, meta[front, 4] + 9 * (ordered - meta[front, 0]) * meta[front, 2], 0)
    height[:] = np.where(free, 3 * meta[front, 2], 0)
    return local, rank, n_cell_free, column, height, row
