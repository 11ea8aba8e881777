"""LAPACK and BLAS inside compiled kernels.

scipy exports the addresses of its LAPACK routines. Registered under names of our own, they are resolved by symbol when
a kernel is loaded, so that kernels which call them can be cached on disk (a kernel that holds a raw address cannot).
All matrices are column-major blocks of one flat float64 array. With the JIT off, numpy does the same work.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding
import numpy as np
from numba import njit, types
from numba.core import config
from numba.extending import get_cython_function_address

from softseam_services.blas import use_one_thread

_ROUTINES = {
    "dpotrf": ("scipy.linalg.cython_lapack", 5),
    "dtrtri": ("scipy.linalg.cython_lapack", 6),
    "dpotri": ("scipy.linalg.cython_lapack", 5),
    "dtrsv": ("scipy.linalg.cython_blas", 8),
    "dtrsm": ("scipy.linalg.cython_blas", 11),
    "dtrmm": ("scipy.linalg.cython_blas", 11),
    "dsyrk": ("scipy.linalg.cython_blas", 10),
    "dgemv": ("scipy.linalg.cython_blas", 11),
    "dgemm": ("scipy.linalg.cython_blas", 13),
}


def _register(name: str) -> Any:
    module, n_arguments = _ROUTINES[name]
    llvmlite.binding.add_symbol(f"softseam_{name}", get_cython_function_address(module, name))
    return types.ExternalFunction(f"softseam_{name}", types.void(*[types.intp] * n_arguments))


use_one_thread()  # sums must not depend on the number of cores
_dpotrf, _dtrtri = _register("dpotrf"), _register("dtrtri")
_dpotri, _dtrsv = _register("dpotri"), _register("dtrsv")
_dtrsm, _dtrmm = _register("dtrsm"), _register("dtrmm")
_dsyrk, _dgemm, _dgemv = _register("dsyrk"), _register("dgemm"), _register("dgemv")

_CHARACTERS = np.frombuffer(b"LNTR", dtype=np.uint8).copy()
_NUMBERS = np.array([1.0, -1.0, 0.0])

_LARGE = 64
"""columns of a panel beyond which inverting its triangle costs more than the solves gain: it then stays L11, L21"""


@njit(cache=True, error_model="numpy")
def _factor_panel(a, offset, m, k, ints):
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
    below, rest = front + 8 * k, front + 8 * (k * m + k)
    if m > k:
        _dtrsm(right, lower, transposed, plain, pr, pk, one, front, pm, below, pm)
        _dsyrk(lower, plain, pr, pk, one + 8, below, pm, one, rest, pm)
    if k > _LARGE:
        return 0
    for j in range(1, k):
        c = offset + j * m
        for i in range(j):
            a[c + i] = 0.0
    # W = [L11^-1; -L21 L11^-1]
    _dtrtri(lower, plain, pk, front, pm, info)
    if m > k:
        _dtrmm(right, lower, plain, plain, pr, pk, one + 8, front, pm, below, pm)
    return ints[3]


@njit(cache=True, error_model="numpy")
def _apply_panel(a, offset, m, k, b, start, t, ints):
    numbers, plain = _NUMBERS.ctypes.data, _CHARACTERS.ctypes.data + 1
    pk, pm, unit = ints.ctypes.data, ints.ctypes.data + 4, ints.ctypes.data + 8
    ints[0], ints[1], ints[2] = k, m, 1
    front, own = a.ctypes.data + 8 * offset, b.ctypes.data + 8 * start
    if k > _LARGE:
        for i in range(k):
            t[i] = b[start + i]
        _dtrsv(plain - 1, plain, plain, pk, front, pm, t.ctypes.data, unit)
        if m > k:
            ints[3] = m - k
            _dgemv(plain, unit + 4, pk, numbers + 8, front + 8 * k, pm, t.ctypes.data, unit, numbers + 16,
                   t.ctypes.data + 8 * k, unit)  # fmt: skip
        return
    _dgemv(plain, pm, pk, numbers, front, pm, own, unit, numbers + 16, t.ctypes.data, unit)


@njit(cache=True, error_model="numpy")
def _apply_panel_transposed(a, offset, m, k, t, b, start, ints):
    numbers, transposed = _NUMBERS.ctypes.data, _CHARACTERS.ctypes.data + 2
    pk, pm, unit = ints.ctypes.data, ints.ctypes.data + 4, ints.ctypes.data + 8
    ints[0], ints[1], ints[2] = k, m, 1
    front, own = a.ctypes.data + 8 * offset, b.ctypes.data + 8 * start
    if k > _LARGE:
        for i in range(k):
            b[start + i] = t[i]
        if m > k:
            ints[3] = m - k
            _dgemv(transposed, unit + 4, pk, numbers + 8, front + 8 * k, pm, t.ctypes.data + 8 * k, unit, numbers, own,
                   unit)  # fmt: skip
        _dtrsv(transposed - 2, transposed, transposed - 1, pk, front, pm, own, unit)
        return
    _dgemv(transposed, pm, pk, numbers, front, pm, t.ctypes.data, unit, numbers + 16, own, unit)


@njit(cache=True, error_model="numpy")
def _inverse_from_panel(a, offset, m, first, n, out, ints):
    numbers, lower = _NUMBERS.ctypes.data, _CHARACTERS.ctypes.data
    pn, pm = ints.ctypes.data, ints.ctypes.data + 4
    ints[0], ints[1] = n, m
    start = offset + first * m + first
    corner = a.ctypes.data + 8 * start
    if first + n > _LARGE:
        for j in range(n):
            for i in range(j, n):
                out[j * n + i] = a[start + j * m + i]
        _dpotri(lower, pn, out.ctypes.data, pn, pm)
    else:
        _dsyrk(lower, lower + 2, pn, pn, numbers, corner, pm, numbers + 16, out.ctypes.data, pn)
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


def _factor_panel_plain(a, offset, m, k, ints):
    front = _view(a, offset, m)
    try:
        lower = np.linalg.cholesky(np.tril(front[:k, :k]) + np.tril(front[:k, :k], -1).T)
    except np.linalg.LinAlgError:
        return 1
    below = np.linalg.solve(lower, front[k:, :k].T).T
    front[k:, k:] -= below @ below.T
    front[:k, :k] = np.tril(np.linalg.inv(lower))
    front[k:, :k] = -below @ front[:k, :k]
    return 0


def _apply_panel_plain(a, offset, m, k, b, start, t, ints):
    t[:m] = _view(a, offset, m)[:, :k] @ b[start : start + k]


def _apply_panel_transposed_plain(a, offset, m, k, t, b, start, ints):
    b[start : start + k] = _view(a, offset, m)[:, :k].T @ t[:m]


def _inverse_from_panel_plain(a, offset, m, first, n, out, ints):
    inverse = np.tril(_view(a, offset, m)[first : first + n, first : first + n])
    out[: n * n] = (inverse.T @ inverse).ravel()


def _multiply_plain(a, b, c, m, n, k, add, ints):
    product = a.reshape(-1)[: m * k].reshape(m, k) @ b.reshape(k, n)
    target = c.reshape(-1)[: m * n].reshape(m, n)
    target[:] = target + product if add else product


_OFF = bool(config.DISABLE_JIT)  # type: ignore[attr-defined]

factor_panel = _factor_panel_plain if _OFF else _factor_panel
"""(a, offset, m, k, ints) -> info. Factor the first k columns of the m x m front at `offset`, lower triangle:
F11 = L11 L11^T, L21 = F21 L11^-T, F22 <- F22 - L21 L21^T; the columns then are W = [L11^-1; -L21 L11^-1], or, where k
is large, [L11; L21], which the routines below take for W. The front must be a root where `inverse_from_panel` looks.
info > 0: not positive definite. ints (4,) int32 scratch, here and below."""
apply_panel = _apply_panel_plain if _OFF else _apply_panel
"""(a, offset, m, k, b, start, t, ints). t[:m] <- W b[start:start+k]."""
apply_panel_transposed = _apply_panel_transposed_plain if _OFF else _apply_panel_transposed
"""(a, offset, m, k, t, b, start, ints). b[start:start+k] <- W^T t[:m]."""
inverse_from_panel = _inverse_from_panel_plain if _OFF else _inverse_from_panel
"""(a, offset, m, first, n, out, ints). out (n*n,) <- (L L^T)^-1 of the diagonal block of L at first .. first + n."""
multiply = _multiply_plain if _OFF else _multiply
"""(a, b, c, m, n, k, add, ints). c (m, n) <- a (m, k) b (k, n) [+ c where add], all row-major."""
