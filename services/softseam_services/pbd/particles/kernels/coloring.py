"""Greedy colouring of constraints that share no particle, tile by tile."""

import numpy as np

from softseam_services.jit import njit

MOST_COLORS = 63


@njit(cache=True, error_model="numpy")
def color_tiles(nodes, tile, used, color):
    """The least colour that no earlier constraint of the same tile has at one of the same particles.

    nodes  (m, k)  particle ids, in the order in which constraints choose
    tile           constraints a tile: the next ones begin anew with colour 0
    used   (n,)    workspace of int64, all zero
    color  (m,)    in place
    Returns whether `MOST_COLORS` were enough.
    """
    for start in range(0, len(nodes), tile):
        stop = min(start + tile, len(nodes))
        for c in range(start, stop):
            taken = np.int64(0)
            for i in nodes[c]:
                taken |= used[i]
            mine = 0
            while mine < MOST_COLORS and taken & (np.int64(1) << np.int64(mine)):
                mine += 1
            if mine == MOST_COLORS:
                return False
            color[c] = mine
            for i in nodes[c]:
                used[i] |= np.int64(1) << np.int64(mine)
        for c in range(start, stop):
            for i in nodes[c]:
                used[i] = 0
    return True
