"""Constraints in batches of `WIDTH` that share no particle: canonical order, tiles, colours.

The order of a Gauss-Seidel sweep decides its result, so it must not be the order in which a file or a loop happened to
list the constraints: they are sorted by their particles first. Colours are chosen greedily in that order within tiles
of neighbours, so that a tile's particles stay in the cache while all its colours pass; with more than one tile the
sweep goes through the body once, not once a colour. A batch is filled up with lanes that hold nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints

from .kernels.coloring import MOST_COLORS, color_tiles

WIDTH = 8
"""constraints in a batch: two vectors of four, so that one waits for memory while the other computes"""
TILE = 4096
"""constraints in a tile; their particles fit the second cache"""


@dataclass(frozen=True)
class Batches:
    """b batches of constraints between k particles each; m constraints."""

    nodes: Ints
    """(b, k, WIDTH); empty lanes name the rows after the particles"""
    row: NDArray[np.int64]
    """constraint in each lane, -1 in empty ones (b, WIDTH)"""

    def lanes(self, values: Floats, empty: float = 0.0) -> Floats:
        """Values of the constraints (m, ...) laid out for kernels (b, ..., WIDTH)."""
        found = np.where(
            (self.row >= 0).reshape(self.row.shape + (1,) * (values.ndim - 1)),
            values[np.maximum(self.row, 0)] if len(values) else np.full((*self.row.shape, *values.shape[1:]), empty),
            empty,
        )
        return np.ascontiguousarray(np.moveaxis(found, 1, -1))

    def back(self, lanes: Floats) -> Floats:
        """What kernels left in lanes (b, ..., WIDTH), by constraint (m, ...)."""
        real = self.row >= 0
        rows = np.moveaxis(lanes, -1, 1)[real]
        found = np.empty_like(rows)
        found[self.row[real]] = rows
        return found


def batches(n: int, nodes: Ints, tile: int = TILE) -> Batches:
    """Batches of constraints `nodes` (m, k) between n particles; the order of the constraints' list does not matter."""
    m, k = nodes.shape
    order = np.lexsort((*np.asarray(nodes).T[::-1], nodes.min(axis=1))) if m else np.zeros(0, dtype=np.int64)
    color = np.zeros(m, dtype=np.int64)
    if not color_tiles(np.ascontiguousarray(nodes[order]), tile, np.zeros(n, dtype=np.int64), color):
        raise ValueError(
            f"a particle takes part in more than {MOST_COLORS} constraints of a kind: refine the mesh there"
        )
    turn = np.lexsort((color, np.arange(m) // tile))
    group = (np.arange(m) // tile * (MOST_COLORS + 1) + color)[turn]
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    sizes = np.diff(starts, append=m)
    first = np.cumsum(-(-sizes // WIDTH)) - -(-sizes // WIDTH)
    place = np.arange(m) - np.repeat(starts, sizes)
    n_batches = int((-(-sizes // WIDTH)).sum())
    row = np.full((n_batches, WIDTH), -1, dtype=np.int64)
    row.reshape(-1)[np.repeat(first * WIDTH, sizes) + place] = order[turn]
    ids = (
        np.broadcast_to(n + np.arange(WIDTH), (k, n_batches, WIDTH)).copy() if m else np.zeros((k, 0, WIDTH), np.int64)
    )
    ids[:, row >= 0] = nodes[row[row >= 0]].T
    return Batches(np.ascontiguousarray(ids.transpose(1, 0, 2), dtype=np.int32), row)
