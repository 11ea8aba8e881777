"""BLAS inside compiled kernels.

scipy exports the addresses of its BLAS routines. Registered under names of our own, they are resolved by symbol when
a kernel is loaded, so that kernels which call them can be cached on disk (a kernel that holds a raw address cannot).
All matrices are column-major blocks of one flat float64 array. With the JIT off, numpy does the same work.
"""

from typing import Any

import llvmlite.binding
import numpy as np
from numba import types
from numba.core import config
from numba.extending import get_cython_function_address

from softseam_services.blas import use_one_thread
from softseam_services.jit import njit

_ROUTINES = {
    "dsyrk": ("scipy.linalg.cython_blas", 10),
    "dgemv": ("scipy.linalg.cython_blas", 11),
    "dgemm": ("scipy.linalg.cython_blas", 13),
}


def _register(name: str) -> Any:
    module, n_arguments = _ROUTINES[name]
    llvmlite.binding.add_symbol(f"softseam_{name}", get_cython_function_address(module, name))
    return types.ExternalFunction(f"softseam_{name}", types.void(*[types.intp] * n_arguments))


use_one_thread()  # sums must not depend on the number of cores
_dsyrk, _dgemm, _dgemv = _register("dsyrk"), _register("dgemm"), _register("dgemv")

_CHARACTERS = np.frombuffer(b"LNT", dtype=np.uint8).copy()
_NUMBERS = np.array([1.0, -1.0, 0.0])


@njit(cache=True, error_model="numpy")
def _product(m, n, k, sign, a, at_a, ld_a, b, at_b, ld_b, transposed, add, c, at_c, ld_c, ints):
    plain, numbers = _CHARACTERS.ctypes.data + 1, _NUMBERS.ctypes.data
    ints[0], ints[1], ints[2], ints[3], ints[4], ints[5] = m, n, k, ld_a, ld_b, ld_c
    p = ints.ctypes.data
    _dgemm(plain, plain + 1 if transposed else plain, p, p + 4, p + 8, numbers if sign > 0 else numbers + 8,
           a.ctypes.data + 8 * at_a, p + 12, b.ctypes.data + 8 * at_b, p + 16, numbers if add else numbers + 16,
           c.ctypes.data + 8 * at_c, p + 20)  # fmt: skip


@njit(cache=True, error_model="numpy")
def _minus_square(n, k, a, at_a, ld_a, c, at_c, ints):
    lower, numbers = _CHARACTERS.ctypes.data, _NUMBERS.ctypes.data
    ints[0], ints[1], ints[2] = n, k, ld_a
    p = ints.ctypes.data
    _dsyrk(lower, lower + 1, p, p + 4, numbers + 8, a.ctypes.data + 8 * at_a, p + 8, numbers + 16,
           c.ctypes.data + 8 * at_c, p)  # fmt: skip


@njit(cache=True, error_model="numpy")
def _apply(m, k, sign, a, at_a, ld, transposed, x, at_x, add, y, at_y, ints):
    plain, numbers = _CHARACTERS.ctypes.data + 1, _NUMBERS.ctypes.data
    ints[0], ints[1], ints[2], ints[3] = m, k, ld, 1
    p = ints.ctypes.data
    _dgemv(plain + 1 if transposed else plain, p, p + 4, numbers if sign > 0 else numbers + 8,
           a.ctypes.data + 8 * at_a, p + 8, x.ctypes.data + 8 * at_x, p + 12, numbers if add else numbers + 16,
           y.ctypes.data + 8 * at_y, p + 12)  # fmt: skip


def _view(a, at, ld, rows, columns):
    step = a.itemsize
    return np.lib.stride_tricks.as_strided(a[at:], (rows, columns), (step, step * ld))


def _product_plain(m, n, k, sign, a, at_a, ld_a, b, at_b, ld_b, transposed, add, c, at_c, ld_c, ints):
    right = _view(b, at_b, ld_b, n, k).T if transposed else _view(b, at_b, ld_b, k, n)
    target = _view(c, at_c, ld_c, m, n)
    target[:] = sign * (_view(a, at_a, ld_a, m, k) @ right) + (target if add else 0.0)


def _minus_square_plain(n, k, a, at_a, ld_a, c, at_c, ints):
    left = _view(a, at_a, ld_a, n, k)
    target = _view(c, at_c, n, n, n)
    lower = np.tril_indices(n)
    target[lower] = -(left @ left.T)[lower]


def _apply_plain(m, k, sign, a, at_a, ld, transposed, x, at_x, add, y, at_y, ints):
    matrix = _view(a, at_a, ld, m, k)
    matrix = matrix.T if transposed else matrix
    rows, columns = matrix.shape
    target = y[at_y : at_y + rows]
    target[:] = sign * (matrix @ x[at_x : at_x + columns]) + (target if add else 0.0)


_OFF = bool(config.DISABLE_JIT)  # type: ignore[attr-defined]

product = _product_plain if _OFF else _product
"""(m, n, k, sign, a, at_a, ld_a, b, at_b, ld_b, transposed, add, c, at_c, ld_c, ints)
C <- [C +] sign A B, or A B^T where transposed; A (m, k), B (k, n) or (n, k), C (m, n) column-major at places of flat
arrays, sign +-1. ints (6,) int32 scratch, here and below."""
minus_square = _minus_square_plain if _OFF else _minus_square
"""(n, k, a, at_a, ld_a, c, at_c, ints). Lower triangle of C (n, n) <- -A A^T; A (n, k)."""
apply = _apply_plain if _OFF else _apply
"""(m, k, sign, a, at_a, ld, transposed, x, at_x, add, y, at_y, ints). y <- [y +] sign A x, or A^T x; A (m, k)."""


@njit(cache=True, error_model="numpy")
def multiply(a, b, c, m, n, k, add, ints):
    """c (m, n) <- a (m, k) b (k, n) [+ c where add], all row-major, of any shapes with as many numbers."""
    product(n, m, k, 1, b.reshape(-1), 0, n, a.reshape(-1), 0, k, False, add, c.reshape(-1), 0, n, ints)
