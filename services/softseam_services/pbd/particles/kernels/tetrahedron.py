"""Deformation of a tetrahedron: F = D_s D_m^-1 with the edges x_k - x_0 as columns of D_s, those at rest of D_m."""

from __future__ import annotations

import numpy as np

from softseam_services.compiled_once import njit

from .corners import three_edges


@njit(cache=True, error_model="numpy")
def rest_shapes(x, nodes, inverse, volume):
    """D_m^-1 (m, 3, 3) [1/m] and volume (m,) [m^3] of tetrahedra nodes (m, 4) at rest x (n, 3), both in place."""
    edges = np.empty((3, 3))
    for tet in range(len(nodes)):
        for k in range(3):
            for axis in range(3):
                edges[axis, k] = x[nodes[tet, k + 1], axis] - x[nodes[tet, 0], axis]
        inverse[tet] = np.linalg.inv(edges)
        volume[tet] = np.linalg.det(edges) / 6.0


@njit(cache=True, error_model="numpy", forceinline=True)
def deformation(xw, i, j, k, m, inverse, batch, lane):
    """F row by row; inverse (b, 9, 8) holds D_m^-1 row by row."""
    ax, ay, az, bx, by, bz, cx, cy, cz = three_edges(xw, i, j, k, m)
    d0, d1, d2 = inverse[batch, 0, lane], inverse[batch, 1, lane], inverse[batch, 2, lane]
    d3, d4, d5 = inverse[batch, 3, lane], inverse[batch, 4, lane], inverse[batch, 5, lane]
    d6, d7, d8 = inverse[batch, 6, lane], inverse[batch, 7, lane], inverse[batch, 8, lane]
    return (
        *(ax * d0 + bx * d3 + cx * d6, ax * d1 + bx * d4 + cx * d7, ax * d2 + bx * d5 + cx * d8),
        *(ay * d0 + by * d3 + cy * d6, ay * d1 + by * d4 + cy * d7, ay * d2 + by * d5 + cy * d8),
        *(az * d0 + bz * d3 + cz * d6, az * d1 + bz * d4 + cz * d7, az * d2 + bz * d5 + cz * d8),
    )
