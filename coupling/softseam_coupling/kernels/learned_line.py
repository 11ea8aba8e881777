"""The products and choices behind `learned_line`: many vectors at a time, sums in a fixed order."""

from __future__ import annotations

import numpy as np

from softseam_coupling.kept_kernels import njit

NEW = 0.05
"""share of a pair's energy that no newer pair has, below which it says nothing new [1]"""
LEAST_PIVOT = 1e-3
"""of a small system of equations whose entries are of the order of one [1]"""


@njit(cache=True, error_model="numpy")
def multiply_rows(matrix, vectors, out):
    """out[r] = matrix @ vectors[r], (n, n) by (k, n), in place; a row of the matrix is read once for all vectors."""
    n = matrix.shape[0]
    whole = n - n % 4
    for i in range(n):
        row = matrix[i]
        for r in range(len(vectors)):
            vector = vectors[r]
            a = b = c = d = 0.0
            for j in range(0, whole, 4):
                a += row[j] * vector[j]
                b += row[j + 1] * vector[j + 1]
                c += row[j + 2] * vector[j + 2]
                d += row[j + 3] * vector[j + 3]
            for j in range(whole, n):
                a += row[j] * vector[j]
            out[r, i] = (a + b) + (c + d)


@njit(cache=True, error_model="numpy")
def multiply_symmetric(matrix, vectors, out):
    """out[r] = matrix @ vectors[r] for a symmetric matrix (n, n), vectors (k, n), in place.

    Sums of multiples of its rows: twice to four times as quick as products with them, as no sum waits for itself.
    """
    k, n = vectors.shape
    out[:] = 0.0
    for i in range(n):
        row = matrix[i]
        for r in range(k):
            factor, total = vectors[r, i], out[r]
            for j in range(n):
                total[j] += factor * row[j]


@njit(cache=True, error_model="numpy")
def multiply_one(matrix, vector, out):
    """out = matrix @ vector for a symmetric matrix (n, n) and (n,), in place."""
    n = len(vector)
    multiply_symmetric(matrix, vector.reshape(1, n), out.reshape(1, n))


@njit(cache=True, error_model="numpy")
def yield_to(y, rooted, forces, moves):
    """moves[r] = Y forces[r], both (k, n), in place; y is Y or, rooted, R with Y = R R^T."""
    if not rooted:
        multiply_symmetric(y, forces, moves)
        return
    half = np.zeros_like(forces)
    for i in range(len(y)):
        row = y[i]
        for r in range(len(forces)):
            f, out = forces[r, i], half[r]
            for j in range(len(row)):
                out[j] += f * row[j]
    multiply_rows(y, half, moves)


@njit(cache=True, error_model="numpy")
def dot(one, other):
    """Sum of products of (n,) and (n,), in order."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * other[i]
    return total


@njit(cache=True, error_model="numpy")
def keep_new(changes, along, count, kept):
    """kept[:k] <- those of the first `count` pairs that say something new; returns k.

    changes, along (K, n)  d and H d of each pair, newest first, d . H d = 1
    """
    k = 0
    factor = np.zeros((count, count))
    for pair in range(count):
        left = 1.0
        for j in range(k):
            entry = dot(changes[pair], along[kept[j]])
            for i in range(j):
                entry -= factor[k, i] * factor[j, i]
            factor[k, j] = entry / factor[j, j]
            left -= factor[k, j] ** 2
        if left > NEW:
            factor[k, k] = np.sqrt(left)
            kept[k] = pair
            k += 1
    return k


@njit(cache=True, error_model="numpy")
def solve_small(matrix, b):
    """b (k,) <- matrix^-1 b by elimination with the largest pivots; False where the matrix (k, k) has no inverse.

    Both are updated in place.
    """
    k = len(b)
    for c in range(k):
        best = c
        for r in range(c + 1, k):
            if abs(matrix[r, c]) > abs(matrix[best, c]):
                best = r
        if not abs(matrix[best, c]) > LEAST_PIVOT:
            return False
        for j in range(c, k):
            matrix[c, j], matrix[best, j] = matrix[best, j], matrix[c, j]
        b[c], b[best] = b[best], b[c]
        for r in range(c + 1, k):
            factor = matrix[r, c] / matrix[c, c]
            for j in range(c, k):
                matrix[r, j] -= factor * matrix[c, j]
            b[r] -= factor * b[c]
    for c in range(k - 1, -1, -1):
        for j in range(c + 1, k):
            b[c] -= matrix[c, j] * b[j]
        b[c] /= matrix[c, c]
    return True
