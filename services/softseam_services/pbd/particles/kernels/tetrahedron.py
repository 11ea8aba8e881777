"""Deformation of a tetrahedron: F = D_s D_m^-1 with the edges x_k - x_0 as columns of D_s, those at rest of D_m."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.lanes import lane_kernel
from softseam_services.pbd.kernels.neo_hookean import cofactors

from .corners import three_edges

CRUSHED = 1e-3
"""of the volume at rest"""


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


@njit(cache=True, error_model="numpy")
def soften(compliance, h, soft):
    """alpha/h^2 (b, k, 8) of k constraints a tetrahedron from compliances alpha [1/J]; soft in place."""
    for batch in range(len(compliance)):
        for kind in range(compliance.shape[1]):
            for lane in range(compliance.shape[2]):
                soft[batch, kind, lane] = compliance[batch, kind, lane] / (h * h)


@lane_kernel
def stretched(edges, d):
    """F (9 values), row by row, of three edges (9 values) [m] and D_m^-1 (9 values) [1/m]."""
    ax, ay, az, bx, by, bz, cx, cy, cz = edges
    return (
        *(ax * d[0] + bx * d[3] + cx * d[6], ax * d[1] + bx * d[4] + cx * d[7], ax * d[2] + bx * d[5] + cx * d[8]),
        *(ay * d[0] + by * d[3] + cy * d[6], ay * d[1] + by * d[4] + cy * d[7], ay * d[2] + by * d[5] + cy * d[8]),
        *(az * d[0] + bz * d[3] + cz * d[6], az * d[1] + bz * d[4] + cz * d[7], az * d[2] + bz * d[5] + cz * d[8]),
    )


@lane_kernel
def is_crushed(f):
    """Whether a tetrahedron has lost its shape: less than CRUSHED of its volume is left, or it is inside out."""
    return cofactors(f)[1] < CRUSHED


@lane_kernel
def metric(f):
    """F^T F: xx, yy, zz, xy, xz, yz."""
    return (
        *(f[0] * f[0] + f[3] * f[3] + f[6] * f[6], f[1] * f[1] + f[4] * f[4] + f[7] * f[7]),
        *(f[2] * f[2] + f[5] * f[5] + f[8] * f[8], f[0] * f[1] + f[3] * f[4] + f[6] * f[7]),
        *(f[0] * f[2] + f[3] * f[5] + f[6] * f[8], f[1] * f[2] + f[4] * f[5] + f[7] * f[8]),
    )


@lane_kernel
def deformation(xw, i, j, k, m, inverse, batch, lane):
    """F row by row; inverse (b, 9, 8) holds D_m^-1 row by row."""
    d = (
        *(inverse[batch, 0, lane], inverse[batch, 1, lane], inverse[batch, 2, lane]),
        *(inverse[batch, 3, lane], inverse[batch, 4, lane], inverse[batch, 5, lane]),
        *(inverse[batch, 6, lane], inverse[batch, 7, lane], inverse[batch, 8, lane]),
    )
    return stretched(three_edges(xw, i, j, k, m), d)
