"""Loops over surface points that find how far a body reaches."""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def bound_points(count, indptr, node, weight, x, bounds):
    """Lowest and highest coordinates of the first `count` points, which follow nodes at x (n, 3), into bounds (6,) [m].

    A point's entries indptr[p] .. indptr[p + 1] of node and weight say which nodes it follows. Where there is no point,
    the lowest is inf and the highest -inf.
    """
    low_x, low_y, low_z, high_x, high_y, high_z = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    for point in range(count):
        px, py, pz = 0.0, 0.0, 0.0
        for entry in range(indptr[point], indptr[point + 1]):
            i, share = node[entry], weight[entry]
            px += share * x[i, 0]
            py += share * x[i, 1]
            pz += share * x[i, 2]
        low_x, low_y, low_z = min(low_x, px), min(low_y, py), min(low_z, pz)
        high_x, high_y, high_z = max(high_x, px), max(high_y, py), max(high_z, pz)
    bounds[0], bounds[1], bounds[2] = low_x, low_y, low_z
    bounds[3], bounds[4], bounds[5] = high_x, high_y, high_z
