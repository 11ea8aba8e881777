"""The assembled matrix without elimination: products with it, and Gauss-Seidel sweeps of 3 x 3 blocks.

A sparse symmetric matrix is a tree whose fronts own one node each (sparse.py of the package): the panel of a node holds
its diagonal block, then the blocks below it, so whatever assembles into fronts assembles into it. Every pass reads each
number once. With A = L + D + L^T:
  forward   z = (D + L)^-1 r, column by column
  backward  z = (D + L^T)^-1 r, from the last node to the first
"""

from __future__ import annotations

from numba import njit

from softseam_services.fem.kernels.fronts import ALL, ROW, VALUES


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _pass(values, at, m, x0, x1, x2, u, t):
    """t[3:m] <- the panel's rows below the diagonal block times x; returns their transpose times u[3:m]."""
    a, b, c = values[at : at + m], values[at + m : at + 2 * m], values[at + 2 * m : at + 3 * m]
    s0 = s1 = s2 = 0.0
    for i in range(3, m):
        t[i] = a[i] * x0 + b[i] * x1 + c[i] * x2
        s0 += a[i] * u[i]
        s1 += b[i] * u[i]
        s2 += c[i] * u[i]
    return s0, s1, s2


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _dot_below(values, at, m, u):
    """Transpose of the panel's rows below the diagonal block times u[3:m]."""
    a, b, c = values[at : at + m], values[at + m : at + 2 * m], values[at + 2 * m : at + 3 * m]
    s0 = s1 = s2 = 0.0
    for i in range(3, m):
        s0 += a[i] * u[i]
        s1 += b[i] * u[i]
        s2 += c[i] * u[i]
    return s0, s1, s2


@njit(cache=True, error_model="numpy")
def product(tree, values, x, y, u, t):
    """y <- A x (3 n_free,); u, t (3 widest,) scratch."""
    y[:] = 0.0
    for node in range(len(tree.meta)):
        m, at, row = 3 * tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        for e in range(1, m // 3):
            other = 3 * tree.rows[row + e]
            u[3 * e], u[3 * e + 1], u[3 * e + 2] = x[other], x[other + 1], x[other + 2]
        i = 3 * node
        s0, s1, s2 = _pass(values, at, m, x[i], x[i + 1], x[i + 2], u, t)
        for k in range(3):
            y[i + k] += values[at + k] * x[i] + values[at + m + k] * x[i + 1] + values[at + 2 * m + k] * x[i + 2]
        y[i] += s0
        y[i + 1] += s1
        y[i + 2] += s2
        for e in range(1, m // 3):
            other = 3 * tree.rows[row + e]
            y[other] += t[3 * e]
            y[other + 1] += t[3 * e + 1]
            y[other + 2] += t[3 * e + 2]


@njit(cache=True, error_model="numpy")
def forward(tree, values, inverse, r, z, t):
    """z <- (D + L)^-1 r; r, whose content is lost, and z (3 n_free,)."""
    for node in range(len(tree.meta)):
        m, at, row = 3 * tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        i = 3 * node
        d = inverse[node]
        z0 = d[0, 0] * r[i] + d[0, 1] * r[i + 1] + d[0, 2] * r[i + 2]
        z1 = d[1, 0] * r[i] + d[1, 1] * r[i + 1] + d[1, 2] * r[i + 2]
        z2 = d[2, 0] * r[i] + d[2, 1] * r[i + 1] + d[2, 2] * r[i + 2]
        z[i], z[i + 1], z[i + 2] = z0, z1, z2
        a, b, c = values[at : at + m], values[at + m : at + 2 * m], values[at + 2 * m : at + 3 * m]
        for j in range(3, m):
            t[j] = a[j] * z0 + b[j] * z1 + c[j] * z2
        for e in range(1, m // 3):
            other = 3 * tree.rows[row + e]
            r[other] -= t[3 * e]
            r[other + 1] -= t[3 * e + 1]
            r[other + 2] -= t[3 * e + 2]


@njit(cache=True, error_model="numpy")
def backward(tree, values, inverse, r, z, u):
    """z <- (D + L^T)^-1 r (3 n_free,)."""
    for node in range(len(tree.meta) - 1, -1, -1):
        m, at, row = 3 * tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        for e in range(1, m // 3):
            other = 3 * tree.rows[row + e]
            u[3 * e], u[3 * e + 1], u[3 * e + 2] = z[other], z[other + 1], z[other + 2]
        s0, s1, s2 = _dot_below(values, at, m, u)
        i = 3 * node
        d = inverse[node]
        r0, r1, r2 = r[i] - s0, r[i + 1] - s1, r[i + 2] - s2
        z[i] = d[0, 0] * r0 + d[0, 1] * r1 + d[0, 2] * r2
        z[i + 1] = d[1, 0] * r0 + d[1, 1] * r1 + d[1, 2] * r2
        z[i + 2] = d[2, 0] * r0 + d[2, 1] * r1 + d[2, 2] * r2


@njit(cache=True, error_model="numpy")
def above(tree, values, z, y, u):
    """y <- L^T z (3 n_free,): what is left of r, up to its sign, after z = (D + L)^-1 r."""
    for node in range(len(tree.meta)):
        m, at, row = 3 * tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        for e in range(1, m // 3):
            other = 3 * tree.rows[row + e]
            u[3 * e], u[3 * e + 1], u[3 * e + 2] = z[other], z[other + 1], z[other + 2]
        y[3 * node], y[3 * node + 1], y[3 * node + 2] = _dot_below(values, at, m, u)


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


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def dot(a, b):
    """Sum of a[i] b[i]."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total
