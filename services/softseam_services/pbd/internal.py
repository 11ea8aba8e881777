"""What blocks remember, and what octants do: the numbers of a law with internal state, as they are handed over."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats

from .blocks import Blocks

Mask = NDArray[np.bool_]


def to_blocks(blocks: Blocks, coarse: Mask, internal: Floats, memory: Floats) -> None:
    """memory (b, n, 4) of the batches' blocks <- the octants' internal (c, 8, n); of a cell that is one block, which
    coarse (c,) says, their mean."""
    if memory.size:
        internal = np.where(coarse[:, None, None], internal.mean(axis=1, keepdims=True), internal)
        real = blocks.octant >= 0
        memory.transpose(0, 2, 1)[real] = internal[blocks.octant[real] // 8, blocks.octant[real] % 8]


def to_octants(blocks: Blocks, coarse: Mask, memory: Floats) -> Floats:
    """The way back (c, 8, n): each octant has what its block remembers, an empty one zeros."""
    if not memory.size:
        return np.zeros((0, 8, 0))
    internal = np.zeros((len(coarse), 8, memory.shape[1]))
    real = blocks.octant >= 0
    internal[blocks.octant[real] // 8, blocks.octant[real] % 8] = memory.transpose(0, 2, 1)[real]
    internal[coarse] = internal[coarse, :1]
    return internal
