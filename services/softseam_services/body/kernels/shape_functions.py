"""Shape functions of both models at local coordinates, which run from -1 to 1 over a cell."""

import numpy as np

from softseam_services.jit import njit


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
def _along_path(t, order):
    """order (3,) <- axes by descending t (3,): the edges of Kuhn's tetrahedron that holds t."""
    order[0], order[1], order[2] = 0, 1, 2
    for first, second in ((0, 1), (1, 2), (0, 1)):
        if t[order[second]] > t[order[first]]:
            order[first], order[second] = order[second], order[first]


@njit(cache=True, error_model="numpy")
def octant_tetrahedral(local, value):
    """Linear weights in the octant's tetrahedron that holds local (3,), of all 27 nodes; value (27,) in place.

    Octants are divided from the cell's centre outwards, see fem/elements/tetrahedra.py.
    """
    value[:] = 0.0
    order = np.empty(3, dtype=np.int64)
    t = np.abs(local)
    _along_path(t, order)
    node, stride = 13, (1, 3, 9)
    value[node] = 1.0 - t[order[0]]
    for corner in range(3):
        axis = order[corner]
        node += stride[axis] if local[axis] > 0.0 else -stride[axis]
        value[node] = t[axis] - (t[order[corner + 1]] if corner < 2 else 0.0)


@njit(cache=True, error_model="numpy")
def cell_tetrahedral(local, value):
    """Quadratic weights in the cell's tetrahedron that holds local (3,), linear beyond; value (27,) in place."""
    if np.abs(local).max() > 1.0:
        octant_tetrahedral(local, value)
        return
    value[:] = 0.0
    order = np.empty(3, dtype=np.int64)
    t = 0.5 * (local + 1.0)
    _along_path(t, order)
    barycentric = np.empty(4)
    node = np.zeros(4, dtype=np.int64)
    barycentric[0] = 1.0 - t[order[0]]
    for corner in range(3):
        axis = order[corner]
        node[corner + 1] = node[corner] + 2 * (1, 3, 9)[axis]
        barycentric[corner + 1] = t[axis] - (t[order[corner + 1]] if corner < 2 else 0.0)
    for a in range(4):
        value[node[a]] = barycentric[a] * (2.0 * barycentric[a] - 1.0)
        for b in range(a):
            value[(node[a] + node[b]) // 2] = 4.0 * barycentric[a] * barycentric[b]


QUADRATIC, TRILINEAR, TETRAHEDRAL, QUADRATIC_TETRAHEDRAL = 0, 1, 2, 3


@njit(cache=True, error_model="numpy")
def fill_weights(local, point_cell, cell_nodes, functions, indptr, node, weight):
    """Fill the rows of the sparse weights, zeros left out; returns the number of entries."""
    value = np.empty(27)
    n_entries = 0
    indptr[0] = 0
    for point in range(len(local)):
        if functions == QUADRATIC:
            hex27_around(local[point], value)
        elif functions == TRILINEAR:
            octant_trilinear(local[point], value)
        elif functions == TETRAHEDRAL:
            octant_tetrahedral(local[point], value)
        else:
            cell_tetrahedral(local[point], value)
        for a in range(27):
            if value[a] != 0.0:
                node[n_entries] = cell_nodes[point_cell[point], a]
                weight[n_entries] = value[a]
                n_entries += 1
        indptr[point + 1] = n_entries
    return n_entries
