"""LAPACK and BLAS inside compiled kernels.

scipy exports the addresses of its LAPACK routines. Registered under names of our own, they are resolved by symbol when
a kernel is loaded, so that kernels which call them can be cached on disk (a kernel that holds a raw address cannot).
All matrices are column-major blocks of one flat float64 array. With the JIT off, numpy does the same work.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import llvmlite.binding
import numpy as np
import scipy
from numba import config, njit, types
from numba.extending import get_cython_function_address

_ROUTINES = {
    "dpotrf": ("scipy.linalg.cython_lapack", 5),
    "dpotri": ("scipy.linalg.cython_lapack", 5),
    "dtrsm": ("scipy.linalg.cython_blas", 11),
    "dsyrk": ("scipy.linalg.cython_blas", 10),
    "dgemm": ("scipy.linalg.cython_blas", 13),
}


def _register(name: str):
    module, n_arguments = _ROUTINES[name]
    llvmlite.binding.add_symbol(f"softseam_{name}", get_cython_function_address(module, name))
    return types.ExternalFunction(f"softseam_{name}", types.void(*[types.intp] * n_arguments))


def _single_thread() -> None:
    """One BLAS thread: the fronts are small, and sums must not depend on the number of cores."""
    for library in Path(scipy.__file__).parent.parent.glob("scipy.libs/*openblas*"):
        handle = ctypes.CDLL(str(library))
        for symbol in ("scipy_openblas_set_num_threads", "openblas_set_num_threads"):
            if hasattr(handle, symbol):
                getattr(handle, symbol)(1)


_single_thread()
_dpotrf, _dpotri, _dtrsm = _register("dpotrf"), _register("dpotri"), _register("dtrsm")
_dsyrk, _dgemm = _register("dsyrk"), _register("dgemm")

_CHARACTERS = np.frombuffer(b"LNTR", dtype=np.uint8).copy()
_NUMBERS = np.array([1.0, -1.0, 0.0])


@njit(cache=True, error_model="numpy")
def _cholesky_panel(a, offset, m, k, ints):
    lower = _CHARACTERS.ctypes.data
    plain, transposed, right = lower + 1, lower + 2, lower + 3
    one = _NUMBERS.ctypes.data
    front = a.ctypes.data + 8 * offset
    pk, pm, pr, info = ints.ctypes.data, ints.ctypes.data + 4, ints.ctypes.data + 8, ints.ctypes.data + 12
    ints[0], ints[1], ints[2], ints[3] = k, m, m - k, 0
    if k == 0:
        return 0
    _dpotrf(lower, pk, front, pm, info)
    if ints[3] != 0:
        return ints[3]
    if m > k:
        below, rest = front + 8 * k, front + 8 * (k * m + k)
        _dtrsm(right, lower, transposed, plain, pr, pk, one, front, pm, below, pm)
        _dsyrk(lower, plain, pr, pk, one + 8, below, pm, one, rest, pm)
    return 0


@njit(cache=True, error_model="numpy")
def _inverse_from_factor(a, offset, m, first, n, out, ints):
    for j in range(n):
        for i in range(j, n):
            out[j * n + i] = a[offset + (first + j) * m + first + i]
    ints[0], ints[1] = n, 0
    pointer = ints.ctypes.data
    _dpotri(_CHARACTERS.ctypes.data, pointer, out.ctypes.data, pointer, pointer + 4)
    for j in range(n):
        for i in range(j + 1, n):
            out[i * n + j] = out[j * n + i]


@njit(cache=True, error_model="numpy")
def _multiply(a, b, c, m, n, k, add, ints):
    numbers = _NUMBERS.ctypes.data
    plain = _CHARACTERS.ctypes.data + 1
    pm, pn, pk = ints.ctypes.data, ints.ctypes.data + 4, ints.ctypes.data + 8
    ints[0], ints[1], ints[2] = m, n, k
    beta = numbers if add else numbers + 16
    _dgemm(plain, plain, pn, pm, pk, numbers, b.ctypes.data, pn, a.ctypes.data, pk, beta, c.ctypes.data, pn)


def _view(a, offset, m):
    return a[offset : offset + m * m].reshape(m, m).T


def _cholesky_panel_plain(a, offset, m, k, ints):
    front = _view(a, offset, m)
    try:
        lower = np.linalg.cholesky(np.tril(front[:k, :k]) + np.tril(front[:k, :k], -1).T)
    except np.linalg.LinAlgError:
        return 1
    front[:k, :k] = lower
    front[k:, :k] = np.linalg.solve(lower, front[k:, :k].T).T
    front[k:, k:] -= front[k:, :k] @ front[k:, :k].T
    return 0


def _inverse_from_factor_plain(a, offset, m, first, n, out, ints):
    lower = np.tril(_view(a, offset, m)[first : first + n, first : first + n])
    out[: n * n] = np.linalg.inv(lower @ lower.T).ravel()


def _multiply_plain(a, b, c, m, n, k, add, ints):
    product = a.reshape(-1)[: m * k].reshape(m, k) @ b.reshape(k, n)
    target = c.reshape(-1)[: m * n].reshape(m, n)
    target[:] = target + product if add else product


_OFF = bool(config.DISABLE_JIT)

cholesky_panel = _cholesky_panel_plain if _OFF else _cholesky_panel
"""(a, offset, m, k, ints) -> info. Factor the first k columns of the m x m front at `offset`, lower triangle in place:
F11 = L11 L11^T, L21 = F21 L11^-T, F22 <- F22 - L21 L21^T. info > 0: not positive definite. ints (4,) int32 scratch."""
inverse_from_factor = _inverse_from_factor_plain if _OFF else _inverse_from_factor
"""(a, offset, m, first, n, out, ints). out (n*n,) <- (L L^T)^-1 of the diagonal block of L at first .. first + n."""
multiply = _multiply_plain if _OFF else _multiply
"""(a, b, c, m, n, k, add, ints). c (m, n) <- a (m, k) b (k, n) [+ c where add], all row-major."""
