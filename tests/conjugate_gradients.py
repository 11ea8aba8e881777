"""Conjugate gradients with preconditioners, on rows of a symmetric matrix: what FEM's factor is compared with."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csr_array

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
MOST = 2000
"""iterations"""


class Sparse(NamedTuple):
    """Compressed rows."""

    start: Ints
    column: Ints
    value: Floats


@njit(cache=True, error_model="numpy")
def multiply(a, x, y):  # type: ignore[no-untyped-def]
    """y = A x."""
    for i in range(len(x)):
        total = 0.0
        for k in range(a.start[i], a.start[i + 1]):
            total += a.value[k] * x[a.column[k]]
        y[i] = total


@njit(cache=True, error_model="numpy")
def incomplete_cholesky(a, shift):  # type: ignore[no-untyped-def]
    """L of the lower rows a, their diagonal last and raised by 1 + shift; in place. False where it does not exist."""
    for i in range(len(a.start) - 1):
        for k in range(a.start[i], a.start[i + 1]):
            j = a.column[k]
            total = a.value[k] * (1.0 + shift if i == j else 1.0)
            p, q = a.start[i], a.start[j]
            while p < k and q < a.start[j + 1] - 1:
                if a.column[p] == a.column[q]:
                    total -= a.value[p] * a.value[q]
                    p, q = p + 1, q + 1
                elif a.column[p] < a.column[q]:
                    p += 1
                else:
                    q += 1
            if i == j:
                if total <= 0.0:
                    return False
                a.value[k] = np.sqrt(total)
            else:
                a.value[k] = total / a.value[a.start[j + 1] - 1]
    return True


@njit(cache=True, error_model="numpy")
def substitute(a, x):  # type: ignore[no-untyped-def]
    """x becomes L^-T L^-1 x."""
    n = len(x)
    for i in range(n):
        last = a.start[i + 1] - 1
        total = x[i]
        for k in range(a.start[i], last):
            total -= a.value[k] * x[a.column[k]]
        x[i] = total / a.value[last]
    for back in range(n):
        i = n - 1 - back
        last = a.start[i + 1] - 1
        x[i] /= a.value[last]
        for k in range(a.start[i], last):
            x[a.column[k]] -= a.value[k] * x[i]


def compressed(matrix: csr_array) -> Sparse:
    matrix.sort_indices()
    return Sparse(matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data.copy())


def conjugate_gradients(
    a: Sparse, b: Floats, precondition: Callable[[Floats], Floats], tolerance: float
) -> tuple[Floats, int]:
    """x of A x = b, and iterations (Hestenes and Stiefel 1952)."""
    x, r, product = np.zeros_like(b), b.copy(), np.empty_like(b)
    z = precondition(r)
    p, rz, end = z.copy(), float(r @ z), tolerance * float(np.linalg.norm(b))
    for k in range(MOST):
        multiply(a, p, product)
        alpha = rz / float(p @ product)
        x += alpha * p
        r -= alpha * product
        if float(np.linalg.norm(r)) <= end:
            return x, k + 1
        z = precondition(r)
        rz, before = float(r @ z), rz
        p = z + rz / before * p
    return x, MOST
