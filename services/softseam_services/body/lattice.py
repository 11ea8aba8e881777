"""Cells of a uniform grid and the nodes of their half-edge lattice."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints

LOCAL = np.array([(i, j, k) for k in range(3) for j in range(3) for i in range(3)], dtype=np.int32)
"""lattice offsets of a cell's 27 nodes in local order (27, 3)"""

OCTANT_NODES = np.array(
    [
        [(i + a) + 3 * (j + b) + 9 * (k + c) for c in range(2) for b in range(2) for a in range(2)]
        for k in range(2)
        for j in range(2)
        for i in range(2)
    ],
    dtype=np.int32,
)
"""local ids of each octant's 8 corner nodes, x fastest (8, 8)"""

SIMPSON = np.array([np.prod([(1.0, 4.0, 1.0)[c] / 6.0 for c in offset]) for offset in LOCAL])
"""integral of each hex27 shape function over a cell of unit volume (27,); all positive, sum 1"""


def divide(size: Floats, cell: Floats) -> tuple[Ints, Floats]:
    """Cells per axis and edges (3,) that fit `size` (3,) [m] exactly, close to `cell` (3,) [m]."""
    counts = np.maximum(1, np.rint(size / cell)).astype(np.int32)
    return counts, size / counts


def number_nodes(kept: NDArray[np.bool_]) -> tuple[Ints, Ints, Ints]:
    """Number the cells that are kept, and the lattice nodes that they use, x fastest.

    kept (nx, ny, nz); returns cell_grid (C, 3), cell_nodes (C, 27), node_grid (N, 3)
    """
    k, j, i = np.nonzero(kept.transpose(2, 1, 0))
    cell_grid = np.stack([i, j, k], axis=1).astype(np.int32)
    lattice = 2 * np.array(kept.shape, dtype=np.int64) + 1
    nodes = 2 * cell_grid[:, None, :].astype(np.int64) + LOCAL[None, :, :]
    flat = nodes[..., 0] + lattice[0] * (nodes[..., 1] + lattice[1] * nodes[..., 2])
    used, cell_nodes = np.unique(flat, return_inverse=True)
    node_grid = np.stack(
        [used % lattice[0], used // lattice[0] % lattice[1], used // (lattice[0] * lattice[1])], axis=1
    )
    return cell_grid, cell_nodes.reshape(-1, 27).astype(np.int32), node_grid.astype(np.int32)


def octants_around(cell_grid: Ints) -> NDArray[np.int64]:
    """The octants of each one's 3 x 3 x 3 in the grid, its own among them, -1 for none (8 C, 27); cell_grid (C, 3)."""
    octant = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)], dtype=np.int32)
    at = (2 * cell_grid[:, None] + octant).reshape(-1, 3)
    at = at - at.min(axis=0) + 1
    number = np.full(at.max(axis=0) + 2, -1, dtype=np.int64)
    number[tuple(at.T)] = np.arange(len(at))
    around = at[:, None] + np.array(list(np.ndindex(3, 3, 3))) - 1
    return np.asarray(number[around[..., 0], around[..., 1], around[..., 2]])
