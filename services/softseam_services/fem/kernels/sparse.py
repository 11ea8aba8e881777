"""The assembled matrix without elimination: products with it, and Gauss-Seidel sweeps of 3 x 3 blocks.

A sparse symmetric matrix is a tree whose fronts own one node each (sparse.py of the package): the panel of a node holds
its diagonal block, then the blocks below it, so whatever assembles into fronts assembles into it. Every pass reads each
number once. With A = L + D + L^T:
  forward   z = (D + L)^-1 r, column by column
  backward  z = (D + L^T)^-1 r, from the last node to the first
"""

from __future__ import annotations

import numpy as np

from softseam_services.fem.kernels.fronts import ALL, ROW, VALUES
from softseam_services.jit import njit


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def product(tree, values, x, y):
    """y <- A x (3 n_free,)."""
    y[:] = 0.0
    for node in range(len(tree.meta)):
        n, at, row = tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        m, i = 3 * n, 3 * node
        a, b, c = values[at : at + m], values[at + m : at + 2 * m], values[at + 2 * m : at + 3 * m]
        x0, x1, x2 = x[i], x[i + 1], x[i + 2]
        s0 = a[0] * x0 + b[0] * x1 + c[0] * x2
        s1 = a[1] * x0 + b[1] * x1 + c[1] * x2
        s2 = a[2] * x0 + b[2] * x1 + c[2] * x2
        for e in range(1, n):
            j, o = 3 * e, 3 * np.uint64(tree.rows[row + e])
            u0, u1, u2 = x[o], x[o + 1], x[o + 2]
            y[o] += a[j] * x0 + b[j] * x1 + c[j] * x2
            y[o + 1] += a[j + 1] * x0 + b[j + 1] * x1 + c[j + 1] * x2
            y[o + 2] += a[j + 2] * x0 + b[j + 2] * x1 + c[j + 2] * x2
            s0 += a[j] * u0 + a[j + 1] * u1 + a[j + 2] * u2
            s1 += b[j] * u0 + b[j + 1] * u1 + b[j + 2] * u2
            s2 += c[j] * u0 + c[j + 1] * u1 + c[j + 2] * u2
        y[i] += s0
        y[i + 1] += s1
        y[i + 2] += s2


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def forward(tree, values, inverse, r, z):
    """z <- (D + L)^-1 r; r, whose content is lost, and z (3 n_free,)."""
    for node in range(len(tree.meta)):
        n, at, row = tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        m, i = 3 * n, 3 * node
        a, b, c = values[at : at + m], values[at + m : at + 2 * m], values[at + 2 * m : at + 3 * m]
        d = inverse[node]
        z0 = d[0, 0] * r[i] + d[0, 1] * r[i + 1] + d[0, 2] * r[i + 2]
        z1 = d[1, 0] * r[i] + d[1, 1] * r[i + 1] + d[1, 2] * r[i + 2]
        z2 = d[2, 0] * r[i] + d[2, 1] * r[i + 1] + d[2, 2] * r[i + 2]
        z[i], z[i + 1], z[i + 2] = z0, z1, z2
        for e in range(1, n):
            j, o = 3 * e, 3 * np.uint64(tree.rows[row + e])
            r[o] -= a[j] * z0 + b[j] * z1 + c[j] * z2
            r[o + 1] -= a[j + 1] * z0 + b[j + 1] * z1 + c[j + 1] * z2
            r[o + 2] -= a[j + 2] * z0 + b[j + 2] * z1 + c[j + 2] * z2


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _above(tree, values, node, z):
    """Rows of L^T z of one node."""
    n, at, row = tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
    m = 3 * n
    a, b, c = values[at : at + m], values[at + m : at + 2 * m], values[at + 2 * m : at + 3 * m]
    s0 = s1 = s2 = 0.0
    for e in range(1, n):
        j, o = 3 * e, 3 * np.uint64(tree.rows[row + e])
        u0, u1, u2 = z[o], z[o + 1], z[o + 2]
        s0 += a[j] * u0 + a[j + 1] * u1 + a[j + 2] * u2
        s1 += b[j] * u0 + b[j + 1] * u1 + b[j + 2] * u2
        s2 += c[j] * u0 + c[j + 1] * u1 + c[j + 2] * u2
    return s0, s1, s2


@njit(cache=True, error_model="numpy")
def backward(tree, values, inverse, r, z):
    """z <- (D + L^T)^-1 r (3 n_free,)."""
    for node in range(len(tree.meta) - 1, -1, -1):
        s0, s1, s2 = _above(tree, values, node, z)
        i = 3 * node
        d = inverse[node]
        r0, r1, r2 = r[i] - s0, r[i + 1] - s1, r[i + 2] - s2
        z[i] = d[0, 0] * r0 + d[0, 1] * r1 + d[0, 2] * r2
        z[i + 1] = d[1, 0] * r0 + d[1, 1] * r1 + d[1, 2] * r2
        z[i + 2] = d[2, 0] * r0 + d[2, 1] * r1 + d[2, 2] * r2


@njit(cache=True, error_model="numpy")
def above(tree, values, z, y):
    """y <- L^T z (3 n_free,): what is left of r, up to its sign, after z = (D + L)^-1 r."""
    for node in range(len(tree.meta)):
        y[3 * node], y[3 * node + 1], y[3 * node + 2] = _above(tree, values, node, z)


@njit(cache=True, error_model="numpy")
def invert_diagonal(tree, values, inverse):
    """inverse (n_free, 3, 3) <- D^-1; False where a block is not positive definite."""
    for node in range(len(tree.meta)):
        m, at = 3 * tree.meta[node, ALL], tree.meta[node, VALUES]
        a, b, c = values[at], values[at + 1], values[at + 2]
        d, e, f = values[at + m + 1], values[at + m + 2], values[at + 2 * m + 2]
        c0, c1, c2 = d * f - e * e, c * e - b * f, b * e - c * d
        det = a * c0 + b * c1 + c * c2
        if not (a > 0.0 and a * d - b * b > 0.0 and det > 0.0):
            return False
        q = inverse[node]
        q[0, 0], q[0, 1], q[0, 2] = c0 / det, c1 / det, c2 / det
        q[1, 0], q[1, 1], q[1, 2] = c1 / det, (a * f - c * c) / det, (b * c - a * e) / det
        q[2, 0], q[2, 1], q[2, 2] = c2 / det, (b * c - a * e) / det, (a * d - b * b) / det
    return True


@njit(cache=True, error_model="numpy")
def dot(a, b):
    """Sum of a[i] b[i], in four sums."""
    s0 = s1 = s2 = s3 = 0.0
    whole = len(a) - len(a) % 4
    for i in range(0, whole, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(whole, len(a)):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)
