"""Shape functions of both models at local coordinates, which run from -1 to 1 over a cell."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def quadratic(t, value, slope):
    """The three Lagrange functions on -1, 0, 1 at t, and their slopes; value (3,), slope (3,) updated in place."""
    value[0] = 0.5 * t * (t - 1.0)
    value[1] = (1.0 - t) * (1.0 + t)
    value[2] = 0.5 * t * (t + 1.0)
    slope[0] = t - 0.5
    slope[1] = -2.0 * t
    slope[2] = t + 0.5


@njit(cache=True, error_model="numpy")
def hex27(local, value, gradient):
    """N_a and dN_a/dlocal at local coordinates (3,); value (27,), gradient (27, 3) updated in place."""
    f = np.empty((3, 3))
    d = np.empty((3, 3))
    for axis in range(3):
        quadratic(local[axis], f[axis], d[axis])
    for k in range(3):
        for j in range(3):
            for i in range(3):
                a = i + 3 * j + 9 * k
                value[a] = f[0, i] * f[1, j] * f[2, k]
                gradient[a, 0] = d[0, i] * f[1, j] * f[2, k]
                gradient[a, 1] = f[0, i] * d[1, j] * f[2, k]
                gradient[a, 2] = f[0, i] * f[1, j] * d[2, k]


@njit(cache=True, error_model="numpy")
def hex27_around(local, value):
    """N_a inside the cell; outside it is continued linearly through the two last nodes; value (27,) in place.

    Points just beyond a cell follow it like an overhanging bar; the quadratic itself would have weights 1, -3, 3 at
    local = 2.
    """
    f = np.empty((3, 3))
    slope = np.empty(3)
    for axis in range(3):
        t = local[axis]
        if t > 1.0:
            f[axis, 0], f[axis, 1], f[axis, 2] = 0.0, 1.0 - t, t
        elif t < -1.0:
            f[axis, 0], f[axis, 1], f[axis, 2] = -t, 1.0 + t, 0.0
        else:
            quadratic(t, f[axis], slope)
    for k in range(3):
        for j in range(3):
            for i in range(3):
                value[i + 3 * j + 9 * k] = f[0, i] * f[1, j] * f[2, k]


@njit(cache=True, error_model="numpy")
def octant_trilinear(local, value):
    """Trilinear weights of the octant that holds local (3,), as weights of all 27 nodes; value (27,) in place."""
    value[:] = 0.0
    base = 0
    t = np.empty(3)
    stride = 1
    for axis in range(3):
        upper = local[axis] > 0.0
        t[axis] = local[axis] if upper else local[axis] + 1.0
        base += stride if upper else 0
        stride *= 3
    for k in range(2):
        for j in range(2):
            for i in range(2):
                weight = (t[0] if i else 1.0 - t[0]) * (t[1] if j else 1.0 - t[1]) * (t[2] if k else 1.0 - t[2])
                value[base + i + 3 * j + 9 * k] = weight


@njit(cache=True, error_model="numpy")
def fill_weights(local, point_cell, cell_nodes, quadratic_cells, indptr, node, weight):
    """Fill the rows of the sparse weights, zeros left out; returns the number of entries."""
    value = np.empty(27)
    n_entries = 0
    indptr[0] = 0
    for point in range(len(local)):
        if quadratic_cells:
            hex27_around(local[point], value)
        else:
            octant_trilinear(local[point], value)
        for a in range(27):
            if value[a] != 0.0:
                node[n_entries] = cell_nodes[point_cell[point], a]
                weight[n_entries] = value[a]
                n_entries += 1
        indptr[point + 1] = n_entries
    return n_entries
