"""Two branches of an elimination tree at a time, the second in a thread of its own.

The thread is the operating system's (POSIX), started from compiled code: it needs no interpreter and no pool. A front's
sums do not depend on who makes them, so a factor is the same to the bit as that of one thread.
"""

import ctypes
import os
import sys
from typing import Any

import numpy as np
from numba import cfunc, types
from numba.core import cgutils, config
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from softseam_services.jit import njit

from .fronts import factor_fronts

_N_ARGUMENTS = 16
_create: Any = types.ExternalFunction("pthread_create", types.int32(*[types.intp] * 4))
_join: Any = types.ExternalFunction("pthread_join", types.int32(types.intp, types.intp))


def _as_pointer(typing: Any, address: Any) -> Any:
    """The integer as a pointer."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), code


_pointer: Any = intrinsic(_as_pointer)


def _branch(argument):
    """Entry of the thread: `factor_fronts` of the arrays at the addresses in `argument`, its result into the first."""
    a = carray(argument, _N_ARGUMENTS, np.int64)
    a[0] = factor_fronts(
        carray(_pointer(a[1]), (a[2], 11), np.int64),
        carray(_pointer(a[3]), (a[4], 3), np.int32),
        carray(_pointer(a[5]), a[6], np.float64),
        carray(_pointer(a[7]), a[8], np.float64),
        a[9],
        a[10],
        carray(_pointer(a[11]), a[12], np.float64),
        carray(_pointer(a[13]), a[14], np.float64),
        carray(_pointer(a[15]), 8, np.int32),
    )
    return argument


def start_address() -> int:
    """Where a second thread begins; 0 where there is no second core, or no POSIX threads."""
    if config.DISABLE_JIT or sys.platform == "win32":  # type: ignore[attr-defined]
        return 0
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores < 2 or not hasattr(ctypes.CDLL(None), "pthread_create"):
        return 0
    global _started
    if _started is None:
        _started = cfunc(types.voidptr(types.voidptr), cache=True, error_model="numpy")(_branch)
    return int(_started.address)


_started: Any = None


@njit(cache=True, error_model="numpy")
def factor(tree, values, scratch):
    """Factor all fronts in place; returns 0, or 1 + a front where the matrix is not positive definite."""
    meta, runs, rest = tree.meta, tree.runs, scratch.rest
    middle, end = tree.second[0], tree.second[1]
    tile, strip, ints = scratch.tile, scratch.strip, scratch.ints
    if end > middle and scratch.start[0] != 0:
        arguments, thread = np.empty(_N_ARGUMENTS, np.int64), np.empty(1, np.int64)
        arguments[0] = 0
        arguments[1], arguments[2] = meta.ctypes.data, len(meta)
        arguments[3], arguments[4] = runs.ctypes.data, len(runs)
        arguments[5], arguments[6] = values.ctypes.data, len(values)
        arguments[7], arguments[8] = rest.ctypes.data, len(rest)
        arguments[9], arguments[10] = middle, end
        arguments[11], arguments[12] = tile[1].ctypes.data, tile.shape[1]
        arguments[13], arguments[14] = strip[1].ctypes.data, strip.shape[1]
        arguments[15] = ints[1].ctypes.data
        apart = _create(thread.ctypes.data, 0, scratch.start[0], arguments.ctypes.data) == 0
        bad = factor_fronts(meta, runs, values, rest, 0, middle, tile[0], strip[0], ints[0])
        if apart:
            _join(thread[0], 0)
        else:
            arguments[0] = factor_fronts(meta, runs, values, rest, middle, end, tile[0], strip[0], ints[0])
        if bad == 0:
            bad = arguments[0]
    else:
        bad = factor_fronts(meta, runs, values, rest, 0, end, tile[0], strip[0], ints[0])
    if bad != 0:
        return bad
    return factor_fronts(meta, runs, values, rest, end, len(meta), tile[0], strip[0], ints[0])
