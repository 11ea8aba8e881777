"""Elimination order: nested dissection of the cells of a region.

Cells are bisected along the longest extent of their grid until a group would eliminate few nodes. A group eliminates
the nodes that no cell outside it touches, so its front holds those nodes (own) and the ones it shares with the outside
(boundary). All seam nodes are kept for one last front of their own, also where they belong to disconnected components:
it becomes the dynamic Schur complement of the seam, and a stiffness that couples all of them fits into it. Components
without a seam get trees of their own.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .kernels.panel import NARROW, STRIP
from .tree import Ints, Longs, Tree, cell_places

LEAF_NODES = 12


def dissect(
    cell_nodes: Ints,
    cell_grid: Ints,
    n_nodes: int,
    fixed: NDArray[np.bool_],
    seam: Ints,
    together: Ints | None = None,
) -> Tree:
    """cell_nodes (c, 27) local node ids, cell_grid (c, 3), fixed (n,), seam (s,) local node ids, none of them fixed.

    together (c,): cells of one number have entries with each other's nodes, and are not parted; None where none have
    """
    together = np.arange(len(cell_nodes), dtype=np.int32) if together is None else together
    return _Dissection(cell_nodes, cell_grid[together], n_nodes, fixed, seam, together).tree()


class _Dissection:
    def __init__(
        self,
        cell_nodes: Ints,
        cell_grid: Ints,
        n_nodes: int,
        fixed: NDArray[np.bool_],
        seam: Ints,
        together: Ints,
    ) -> None:
        self.cell_nodes, self.cell_grid, self.n_nodes, self.fixed, self.seam = (
            cell_nodes,
            cell_grid,
            n_nodes,
            fixed,
            seam,
        )
        self.together = together
        self.total = np.bincount(cell_nodes.ravel(), minlength=n_nodes)
        self.done = fixed.copy()
        self.late = np.zeros(n_nodes, dtype=np.bool_)
        self.late[seam] = True
        # first and last group of cells that touches a node: nodes that a child hands on together stay together
        self.groups = np.full((n_nodes, 2), -1, dtype=np.int64)
        self.n_groups = 0
        self.own: list[Ints] = []
        self.boundary: list[Ints] = []
        self.parent: list[int] = []

    def tree(self) -> Tree:
        waiting: list[int] = []
        for cells in self._components():
            left = self._visit(cells)
            if self.late[self.cell_nodes[cells]].any():
                waiting += left
        if len(self.seam):
            seam = np.flatnonzero(self.late)
            self._front(seam, seam, waiting)
        return self._pack()

    def _components(self) -> list[Ints]:
        n_cells = len(self.cell_nodes)
        cell = np.repeat(np.arange(n_cells), self.cell_nodes.shape[1])
        node = self.cell_nodes.ravel() + n_cells
        size = n_cells + self.n_nodes
        graph = coo_array((np.ones(len(cell), dtype=np.int8), (cell, node)), shape=(size, size))
        n_components, label = connected_components(graph, directed=False)
        label = label[:n_cells]
        return [c for i in range(n_components) if len(c := np.flatnonzero(label == i).astype(np.int32))]

    def _visit(self, cells: Ints) -> list[int]:
        """Order the nodes of these cells, but for the seam's; returns the fronts that still wait for a parent."""
        touched, count = np.unique(self.cell_nodes[cells], return_counts=True)
        complete = touched[(count == self.total[touched]) & ~self.done[touched] & ~self.late[touched]]
        children: list[int] = []
        if len(complete) > LEAF_NODES and (self.together[cells] != self.together[cells[0]]).any():
            left, right = self._split(cells)
            children = self._visit(left) + self._visit(right)
            complete = complete[~self.done[complete]]
        else:
            self.groups[touched, 0] = np.where(self.groups[touched, 0] < 0, self.n_groups, self.groups[touched, 0])
            self.groups[touched, 1] = self.n_groups
            self.n_groups += 1
        if len(complete) == 0:
            return children
        return [self._front(complete, touched[~self.done[touched]], children)]

    def _front(self, own: Ints | Longs, nodes: Ints | Longs, children: list[int]) -> int:
        front = len(self.own)
        self.done[own] = True
        self.own.append(own[np.lexsort(self.groups[own].T[::-1])].astype(np.int32))
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
        if len(values) == 1:
            return cells[: len(cells) // 2], cells[len(cells) // 2 :]
        below = np.cumsum(counts)[:-1]
        cut = values[np.argmin(np.abs(2 * below - len(cells)))]
        lower = along <= cut
        return cells[lower], cells[~lower]

    def _pack(self) -> Tree:
        n_fronts = len(self.own)
        order = np.concatenate(self.own) if n_fronts else np.zeros(0, dtype=np.int32)
        n_free = len(order)
        position = np.full(self.n_nodes, -1, dtype=np.int32)
        position[order] = np.arange(n_free, dtype=np.int32)
        own = np.array([len(o) for o in self.own], dtype=np.int64)
        parent = np.array(self.parent, dtype=np.int64)
        boundary = [np.sort(position[b]) for b in self.boundary]
        n_all = own + np.array([len(b) for b in boundary], dtype=np.int64)
        first = np.cumsum(own) - own
        rows = [np.concatenate([np.arange(f, f + k), b]) for f, k, b in zip(first, own, boundary, strict=True)]
        row = np.cumsum(n_all) - n_all
        sizes = 9 * own * n_all
        meta = np.full((n_fronts, 11), -1, dtype=np.int64)
        meta[:, :6] = np.stack([first, own, n_all, parent, np.cumsum(sizes) - sizes, row], axis=1)
        flat = np.concatenate(rows).astype(np.int32) if rows else np.zeros(0, dtype=np.int32)
        # rows ascend within each front: one sorted list of (front, position) finds all places at once
        key = np.repeat(np.arange(n_fronts), n_all) * max(n_free, 1) + flat
        _link_children(meta)
        n_rest = _leftovers(meta)
        runs = _runs(meta, boundary, key, n_free)
        own_front = np.repeat(np.arange(n_fronts, dtype=np.int32), own)
        cells = cell_places(self.cell_nodes, position, own_front, meta, key)
        seamed = len(self.seam) > 0
        narrow = np.where(3 * own <= NARROW, 3 * own, STRIP)
        return Tree(
            meta,
            flat,
            runs,
            position,
            own_front,
            *cells,
            n_fronts - 1 if seamed else -1,
            (position[self.seam] - (first[-1] if seamed else 0)).astype(np.int32),
            n_values=int(sizes.sum()),
            n_rest=n_rest,
            widest=int(n_all.max(initial=0)),
            strip=int((3 * n_all * np.maximum(narrow, STRIP)).max(initial=0)),
        )


def _link_children(meta: Longs) -> None:
    """Link children to parents in `meta`."""
    for front in range(len(meta) - 1, -1, -1):
        parent = meta[front, 3]
        if parent >= 0:
            meta[front, 8], meta[parent, 7] = meta[parent, 7], front


def _leftovers(meta: Longs) -> int:
    """Give what fronts leave over its place; returns the room that takes.

    Fronts of even and of odd depth have a stack each: when a front pushes, its children are on top of the other.
    """
    n_fronts = len(meta)
    stack = np.zeros(n_fronts, dtype=np.int64)
    for front in range(n_fronts - 1, -1, -1):
        if meta[front, 3] >= 0:
            stack[front] = 1 - stack[meta[front, 3]]
    top, most = [0, 0], [0, 0]
    for front in range(n_fronts):
        for child in reversed(_children(meta, front)):
            top[stack[child]] = int(meta[child, 6])
        mine = stack[front]
        meta[front, 6] = top[mine]
        top[mine] += int(9 * (meta[front, 2] - meta[front, 1]) ** 2)
        most[mine] = max(most[mine], top[mine])
    meta[:, 6] += most[0] * stack
    return sum(most)


def _children(meta: Longs, front: int) -> list[int]:
    found = []
    child = int(meta[front, 7])
    while child >= 0:
        found.append(child)
        child = int(meta[child, 8])
    return found


def _runs(meta: Longs, boundary: list[Ints], key: Longs, n_free: int) -> Ints:
    """`Tree.runs`; their ranges into the last columns of meta."""
    counts = np.array([len(b) for b in boundary], dtype=np.int64)
    if counts.sum() == 0:
        meta[:, 9:] = 0
        return np.zeros((0, 3), dtype=np.int32)
    parent = np.repeat(meta[:, 3], counts)
    place = np.searchsorted(key, parent * n_free + np.concatenate(boundary)) - meta[parent, 5]
    of = np.repeat(np.arange(len(counts)), counts)
    starts = np.flatnonzero(np.append(True, (np.diff(place) != 1) | (np.diff(of) != 0)))
    first = np.cumsum(counts) - counts
    length = np.diff(starts, append=len(place))
    per_front = np.bincount(of[starts], minlength=len(counts))
    meta[:, 10] = np.cumsum(per_front)
    meta[:, 9] = meta[:, 10] - per_front
    return np.stack([starts - first[of[starts]], length, place[starts]], axis=1).astype(np.int32)
