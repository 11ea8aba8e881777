"""GMRES for any matrix A: the caller multiplies a vector with it, and what is here finds the nearest solution.

With V (k, n) orthonormal, V_0 = b/|b|, and h (k, k - 1) of Arnoldi's process A V_n = V_(n+1) h, the y least in
| |b| e_0 - h y | makes x = V^T y (Saad and Schultz, SIAM J. Sci. Stat. Comput. 7, 1986). Givens' rotations make h
triangular column by column, so that what is left of b is known without x. The array h is (k, k + 2): its last three
columns are the right side, the rotations' cosines and their sines.
"""

import numpy as np

from softseam_services.jit import njit

from .anderson import add_scaled, dot


@njit(cache=True, error_model="numpy")
def begin_krylov(b, length, basis, h):
    """basis[0] <- b of this length; h <- its right side."""
    h[0, len(basis) - 1] = length
    for i in range(len(b)):
        basis[0, i] = b[i] / length


@njit(cache=True, error_model="numpy")
def extend_krylov(n, w, basis, h):
    """Take up w = A basis[n], which is lost, as basis[n + 1]; returns the length of what is left of b."""
    for k in range(n + 1):
        h[k, n] = along = dot(w, basis[k])
        add_scaled(w, -along, basis[k])
    beyond = np.sqrt(dot(w, w))
    for i in range(len(w)):
        basis[n + 1, i] = w[i] / beyond if beyond > 0.0 else 0.0
    return _rotate(n, beyond, h)


@njit(cache=True, error_model="numpy")
def _rotate(n, beyond, h):
    """Column n of h, and `beyond` under it, become triangular; returns the length of what is left of the right side."""
    right, cosine, sine = len(h) - 1, len(h), len(h) + 1
    for k in range(n):
        above = h[k, cosine] * h[k, n] + h[k, sine] * h[k + 1, n]
        h[k + 1, n] = h[k, cosine] * h[k + 1, n] - h[k, sine] * h[k, n]
        h[k, n] = above
    size = np.sqrt(h[n, n] ** 2 + beyond**2)
    h[n, cosine], h[n, sine] = h[n, n] / size, beyond / size
    h[n + 1, right] = -h[n, sine] * h[n, right]
    h[n, right] *= h[n, cosine]
    h[n, n] = size
    return abs(h[n + 1, right])


@njit(cache=True, error_model="numpy")
def add_solution(n, basis, h, x):
    """x += the solution of n iterations; the right side of h becomes y."""
    right = len(h) - 1
    for k in range(n - 1, -1, -1):
        for m in range(k + 1, n):
            h[k, right] -= h[k, m] * h[m, right]
        h[k, right] /= h[k, k]
    for k in range(n):
        add_scaled(x, h[k, right], basis[k])
