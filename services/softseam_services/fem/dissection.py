"""Elimination order: nested dissection of the cells of a region.

Cells are bisected along the longest extent of their grid until a group would eliminate few nodes. A group eliminates
the nodes that no cell outside it touches, so its front holds those nodes (own) and the ones it shares with the outside
(boundary). All seam nodes are kept for one last front, also where they belong to disconnected components: its trailing
block is the dynamic Schur complement of the seam, and a stiffness that couples all of them fits into it. Components
without a seam get trees of their own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

LEAF_NODES = 12


class Tree(NamedTuple):
    """Fronts in the order of elimination; children before parents. A plain tuple of arrays for the kernels."""

    meta: Longs
    """per front: first own node (in elimination order), own nodes, all nodes, parent (-1 for a root), offset of its
    values, offset of its rows (n_fronts, 6)"""
    rows: Ints
    """elimination positions of each front's nodes, own nodes first, ascending, one front after the other"""
    to_parent: Ints
    """for each of `rows`: place of the node in the parent's front; -1 for own nodes"""
    position: Ints
    """place of each node in the elimination order, -1 for clamped nodes (n_nodes,)"""
    own_front: Ints
    """front that eliminates the node at each place of the order (n_free,)"""
    cell_front: Ints
    """front that takes each cell's matrix (c,)"""
    cell_place: Ints
    """place of each cell's nodes in that front, -1 for clamped nodes (c, 27)"""
    cell_local: Ints
    """each cell's nodes by their place in that front, clamped nodes last (c, 27)"""
    cell_free: Ints
    """how many of each cell's nodes are not clamped (c,)"""
    seam_front: Ints
    """root fronts that end in seam nodes (g,)"""
    seam_ptr: Ints
    """range of `seam_index` of each of those (g + 1,)"""
    seam_index: Ints
    """positions in the seam of the trailing nodes of those fronts (s,)"""
    n_values: int
    """total size of all fronts' values"""
    widest: int
    """most nodes of a front"""


def dissect(cell_nodes: Ints, cell_grid: Ints, n_nodes: int, fixed: NDArray[np.bool_], seam: Ints) -> Tree:
    """cell_nodes (c, 27) local node ids, cell_grid (c, 3), fixed (n,), seam (s,) local node ids, none of them fixed."""
    return _Dissection(cell_nodes, cell_grid, n_nodes, fixed, seam).tree()


class _Dissection:
    def __init__(self, cell_nodes: Ints, cell_grid: Ints, n_nodes: int, fixed: NDArray[np.bool_], seam: Ints) -> None:
        self.cell_nodes, self.cell_grid, self.n_nodes, self.fixed, self.seam = (
            cell_nodes,
            cell_grid,
            n_nodes,
            fixed,
            seam,
        )
        self.total = np.bincount(cell_nodes.ravel(), minlength=n_nodes)
        self.done = fixed.copy()
        self.late = np.zeros(n_nodes, dtype=np.bool_)
        self.late[seam] = True
        self.own: list[Ints] = []
        self.boundary: list[Ints] = []
        self.parent: list[int] = []
        self.cell_front = np.full(len(cell_nodes), -1, dtype=np.int32)

    def tree(self) -> Tree:
        components = self._components()
        late = [bool(self.late[self.cell_nodes[cells]].any()) for cells in components]
        waiting: list[int] = []
        for cells, seamed in zip(components, late, strict=True):
            left = self._visit(cells, last=not seamed or sum(late) == 1)
            if seamed:
                waiting += left
        if sum(late) > 1:
            seam = np.flatnonzero(self.late & ~self.done)
            self._front(seam, seam, waiting)
        return self._pack()

    def _components(self) -> list[Ints]:
        n_cells = len(self.cell_nodes)
        cell = np.repeat(np.arange(n_cells), 27)
        node = self.cell_nodes.ravel() + n_cells
        size = n_cells + self.n_nodes
        graph = coo_array((np.ones(len(cell), dtype=np.int8), (cell, node)), shape=(size, size))
        n_components, label = connected_components(graph, directed=False)
        label = label[:n_cells]
        return [c for i in range(n_components) if len(c := np.flatnonzero(label == i).astype(np.int32))]

    def _visit(self, cells: Ints, last: bool) -> list[int]:
        """Order the nodes of these cells; returns the fronts that still wait for a parent."""
        count = np.bincount(self.cell_nodes[cells].ravel(), minlength=self.n_nodes)
        touched = np.flatnonzero(count)
        complete = touched[(count[touched] == self.total[touched]) & ~self.done[touched]]
        if not last:
            complete = complete[~self.late[complete]]
        if len(cells) == 1 or len(complete) <= LEAF_NODES:
            rest = touched[~self.done[touched]]
            front = self._front(complete, rest, [])
            self.cell_front[cells] = front
            return [front]
        left, right = self._split(cells)
        children = self._visit(left, False) + self._visit(right, False)
        own = complete[~self.done[complete]]
        if len(own) == 0:
            return children
        rest = np.unique(np.concatenate([self.boundary[child] for child in children]))
        return [self._front(own, rest, children)]

    def _front(self, own: Longs, nodes: Longs, children: list[int]) -> int:
        front = len(self.own)
        self.done[own] = True
        late = self.late[own]
        self.own.append(np.concatenate([own[~late], own[late]]).astype(np.int32))
        self.boundary.append(nodes[~self.done[nodes]].astype(np.int32))
        self.parent.append(-1)
        for child in children:
            self.parent[child] = front
        return front

    def _split(self, cells: Ints) -> tuple[Ints, Ints]:
        grid = self.cell_grid[cells]
        axis = int(np.argmax(np.ptp(grid, axis=0)))
        along = grid[:, axis]
        values, counts = np.unique(along, return_counts=True)
        below = np.cumsum(counts)[:-1]
        cut = values[np.argmin(np.abs(2 * below - len(cells)))]
        lower = along <= cut
        return cells[lower], cells[~lower]

    def _pack(self) -> Tree:
        n_fronts = len(self.own)
        order = np.concatenate(self.own) if n_fronts else np.zeros(0, dtype=np.int32)
        position = np.full(self.n_nodes, -1, dtype=np.int32)
        position[order] = np.arange(len(order), dtype=np.int32)
        meta = np.zeros((n_fronts, 6), dtype=np.int64)
        rows: list[Ints] = []
        first = values = row = 0
        for front in range(n_fronts):
            n_own = len(self.own[front])
            own_rows = np.arange(first, first + n_own, dtype=np.int32)
            rows.append(np.concatenate([own_rows, np.sort(position[self.boundary[front]])]))
            n_all = len(rows[-1])
            meta[front] = first, n_own, n_all, self.parent[front], values, row
            first, values, row = first + n_own, values + 9 * n_all * n_all, row + n_all
        to_parent: list[Ints] = []
        for front in range(n_fronts):
            place = np.full(len(rows[front]), -1, dtype=np.int32)
            n_own, parent = int(meta[front, 1]), int(meta[front, 3])
            if parent >= 0:
                place[n_own:] = np.searchsorted(rows[parent], rows[front][n_own:])
            to_parent.append(place)
        cell_place = np.full(self.cell_nodes.shape, -1, dtype=np.int32)
        cell_position = position[self.cell_nodes]
        for cell, its_front in enumerate(self.cell_front):
            free = cell_position[cell] >= 0
            cell_place[cell, free] = np.searchsorted(rows[its_front], cell_position[cell, free])
        own_front = np.repeat(np.arange(n_fronts, dtype=np.int32), meta[:, 1])
        return Tree(
            meta,
            np.concatenate(rows) if rows else np.zeros(0, dtype=np.int32),
            np.concatenate(to_parent) if to_parent else np.zeros(0, dtype=np.int32),
            position,
            own_front,
            self.cell_front,
            cell_place,
            np.argsort(np.where(cell_place < 0, np.iinfo(np.int32).max, cell_place), axis=1).astype(np.int32),
            np.count_nonzero(cell_place >= 0, axis=1).astype(np.int32),
            *self._seam(position, own_front),
            n_values=values,
            widest=max((len(r) for r in rows), default=0),
        )

    def _seam(self, position: Ints, own_front: Ints) -> tuple[Ints, Ints, Ints]:
        seam_position = position[self.seam]
        fronts = own_front[seam_position]
        by_place = np.argsort(seam_position, kind="stable").astype(np.int32)
        roots, counts = np.unique(fronts, return_counts=True)
        pointer = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        return roots.astype(np.int32), pointer, by_place
