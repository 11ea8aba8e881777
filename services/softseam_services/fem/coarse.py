"""The coarse grid of kernels/multigrid.py: trilinear functions on the corners of a region's cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.fem.dissection import dissect
from softseam_services.fem.tree import Factoring, Ints, Tree, scratch
from softseam_services.jit import record

_CORNERS = np.array([0, 2, 6, 8, 18, 20, 24, 26])


@record
class Grid(NamedTuple):
    """n_free nodes of the fine grid; P carries a coarse field over to them."""

    tree: Tree
    """of the coarse matrix"""
    values: Floats
    factoring: Factoring
    parents: Ints
    """how many corners a node of a cell depends on (27,)"""
    parent: Ints
    """those corners (27, 8)"""
    share: Floats
    """and the weights (27, 8)"""
    up_ptr: Ints
    """coarse nodes of each fine one, by places of elimination, and weights (n_free + 1,)"""
    up_node: Ints
    up_share: Floats
    seam_ptr: Ints
    """the same of the seam, by places in the coarse seam (s + 1,)"""
    seam_node: Ints
    seam_share: Floats
    seam: Floats
    """stiffness of the far side on the coarse seam"""
    seam_x: Floats
    seam_y: Floats
    inverse: Floats
    """of the diagonal blocks (n_free, 3, 3)"""
    b: Floats
    """coarse unknowns"""
    x: Floats
    r: Floats
    z: Floats
    p: Floats
    q: Floats
    w: Floats
    s: Floats
    e: Floats
    """fine unknowns (3 n_free,)"""


def build_grid(cell_nodes: Ints, cell_grid: Ints, tree: Tree, seam: Ints) -> Grid:
    """cell_nodes (c, 27), cell_grid (c, 3), seam (s,) local node ids; tree of `sparse_tree`."""
    fixed = tree.position < 0
    half = np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])
    weight = np.einsum("kc,jb,ia->kjicba", half, half, half).reshape(27, 8)
    parents = np.count_nonzero(weight, axis=1).astype(np.int32)
    parent = np.argsort(weight == 0.0, axis=1, kind="stable").astype(np.int32)
    share = np.take_along_axis(weight, parent, axis=1)
    corners, flat = np.unique(cell_nodes[:, _CORNERS], return_inverse=True)
    coarse_cells = flat.reshape(-1, 8).astype(np.int32)
    where = np.unique(cell_nodes, return_index=True)[1]
    cell, local = where // 27, where % 27
    above = coarse_cells[cell[:, None], parent[local]]  # (n, 8)
    real = np.arange(8) < parents[local][:, None]
    coarse_fixed = fixed[corners]
    coarse_seam = np.unique(above[seam][real[seam]]) if len(seam) else np.zeros(0, dtype=np.int32)
    coarse_seam = coarse_seam[~coarse_fixed[coarse_seam]].astype(np.int32)
    coarse = dissect(coarse_cells, cell_grid, len(corners), coarse_fixed, coarse_seam)
    real &= ~coarse_fixed[above]
    free = np.flatnonzero(~fixed)
    up = _rows(above[free], share[local[free]], real[free], coarse.position)
    in_seam = np.full(len(corners), -1, dtype=np.int32)
    in_seam[coarse_seam] = np.arange(len(coarse_seam))
    of_seam = _rows(above[seam], share[local[seam]], real[seam], in_seam)
    n, n_seam = 3 * len(free), 3 * len(seam)
    return Grid(
        coarse,
        np.zeros(coarse.n_values),
        scratch(coarse),
        parents,
        parent,
        share,
        *up,
        *of_seam,
        np.zeros((3 * len(coarse_seam), 3 * len(coarse_seam))),
        np.zeros((n_seam, 1)),
        np.zeros((n_seam, 1)),
        np.zeros((len(free), 3, 3)),
        np.zeros(3 * int(np.count_nonzero(coarse.position >= 0))),
        *(np.zeros(n) for _ in range(8)),
    )


def no_grid() -> Grid:
    """Of a region whose matrix is factored itself."""
    cells, grid, none = np.zeros((0, 27)), np.zeros((0, 3)), np.zeros(0)
    empty = dissect(
        cells[:, :8].astype(np.int32), grid.astype(np.int32), 0, none.astype(np.bool_), none.astype(np.int32)
    )
    return build_grid(cells.astype(np.int32), grid.astype(np.int32), empty, none.astype(np.int32))


def _rows(node: Ints, share: Floats, real: NDArray[np.bool_], place: Ints) -> tuple[Ints, Ints, Floats]:
    """Sparse rows of the entries that are `real`, all (n, 8)."""
    pointer = np.concatenate([[0], np.cumsum(np.count_nonzero(real, axis=1))]).astype(np.int32)
    return pointer, place[node[real]].astype(np.int32), share[real]
