"""A region's matrix without elimination, as a `Tree` of fronts that own one node each (kernels/sparse.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_services.fem.tree import Ints, Tree, cell_places


def sparse_tree(kind: int, cell_nodes: Ints, fixed: NDArray[np.bool_]) -> Tree:
    """cell_nodes (c, k), fixed (n,). Nodes keep the order of their numbers; kind: see kernels/multigrid.py."""
    position = np.where(fixed, -1, np.cumsum(~fixed) - 1).astype(np.int32)
    n_free, width = int(np.count_nonzero(~fixed)), cell_nodes.shape[1]
    at = position[cell_nodes].astype(np.int64)
    keys, wheres = [], []
    cell = np.arange(len(cell_nodes), dtype=np.int64)
    for a in range(width):
        first = np.where(at[:, a : a + 1] >= 0, at[:, a : a + 1], n_free)
        below = (at >= first) & (first < n_free)
        keys.append((first * n_free + at)[below])
        wheres.append(((cell[:, None] * width + a) * width + np.arange(width))[below])
    key, index = np.unique(np.concatenate(keys), return_index=True)
    where = np.concatenate(wheres)[index]
    pair = np.stack([where // width**2, where // width % width, where % width], axis=1).astype(np.int32)
    owner = key // max(n_free, 1)
    n_all = np.bincount(owner, minlength=n_free).astype(np.int64)
    row = np.cumsum(n_all) - n_all
    meta = np.full((n_free, 11), -1, dtype=np.int64)
    meta[:, :6] = np.stack([np.arange(n_free), np.ones(n_free), n_all, -np.ones(n_free), 9 * row, row], axis=1)
    own_front = np.arange(n_free, dtype=np.int32)
    return Tree(
        meta,
        (key % max(n_free, 1)).astype(np.int32),
        np.zeros((0, 3), dtype=np.int32),
        position,
        own_front,
        *cell_places(cell_nodes, position, own_front, meta, key),
        seam_front=-1,
        seam_place=np.zeros(0, dtype=np.int32),
        n_values=9 * len(key),
        n_rest=0,
        widest=int(n_all.max(initial=0)),
        strip=0,
        second=np.zeros(2, dtype=np.int64),
        kind=kind,
        pair=pair,
    )
