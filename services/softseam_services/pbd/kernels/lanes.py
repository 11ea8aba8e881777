"""Four lanes side by side: moves between nodes, which lie one by one, and rows, which hold one number of four blocks.

A node is x, y, z, w; four nodes are a 4 x 4 matrix whose transpose is four rows. Written number by number, the moves
cost more than the arithmetic between them, because a vector cannot be read while the numbers that it is made of are
still on their way to the cache; so they are given to the compiler as the vectors that they are. Arrays are float64,
C-contiguous, and indexed as if flat; nothing checks the bounds.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from softseam_services.jit import njit

LANES = 4
LINE = 8
"""numbers in a line of the cache"""

batch_kernel = njit(cache=True, error_model="numpy", fastmath={"contract"})
rare_kernel = njit(cache=True, error_model="numpy", fastmath={"contract"}, aside=())
"""a batch_kernel that few scenes need, compiled when it is called"""
lane_kernel = njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
"""Decorate a loop over lanes, and what runs inside it. Of fastmath only that a product and a sum may be rounded once:
nothing is assumed about NaN, nothing is reordered."""


def aligned(*shape: int) -> NDArray[np.float64]:
    """Zeros that begin at a line of the cache: no vector straddles two."""
    size = int(np.prod(shape))
    block = np.zeros(size + LINE)
    start = (-block.ctypes.data % (8 * LINE)) // 8
    return block[start : start + size].reshape(shape)


_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


def _shuffle(builder, a, b, *order):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), LANES), list(order)))


def _transpose(builder, r):
    even_low, odd_low = _shuffle(builder, r[0], r[1], 0, 4, 2, 6), _shuffle(builder, r[0], r[1], 1, 5, 3, 7)
    even_high, odd_high = _shuffle(builder, r[2], r[3], 0, 4, 2, 6), _shuffle(builder, r[2], r[3], 1, 5, 3, 7)
    return [
        _shuffle(builder, even_low, even_high, 0, 1, 4, 5),
        _shuffle(builder, odd_low, odd_high, 0, 1, 4, 5),
        _shuffle(builder, even_low, even_high, 2, 3, 6, 7),
        _shuffle(builder, odd_low, odd_high, 2, 3, 6, 7),
    ]


def _place(context, builder, kind, array, index):
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _transposed(to, t0, t1, t2, t3, source, s0, s1, s2, s3):
    """The intrinsic that reads four vectors at s0 .. s3 and writes the transpose at t0 .. t3."""

    def generate(context, builder, signature, arguments):
        source_kind, to_kind = signature.args[5], signature.args[0]
        rows = [
            builder.load(_place(context, builder, source_kind, arguments[5], index), align=8)
            for index in arguments[6:10]
        ]
        for row, index in zip(_transpose(builder, rows), arguments[1:5], strict=True):
            builder.store(row, _place(context, builder, to_kind, arguments[0], index), align=8)
        return context.get_dummy_value()

    return types.void(to, t0, t1, t2, t3, source, s0, s1, s2, s3), generate


@intrinsic
def _transpose_four(typing, to, t0, t1, t2, t3, source, s0, s1, s2, s3):
    return _transposed(to, t0, t1, t2, t3, source, s0, s1, s2, s3)


@intrinsic
def _move_four(typing, to, t, source, s):
    def generate(context, builder, signature, arguments):
        vector = builder.load(_place(context, builder, signature.args[2], arguments[2], arguments[3]), align=8)
        builder.store(vector, _place(context, builder, signature.args[0], arguments[0], arguments[1]), align=8)
        return context.get_dummy_value()

    return types.void(to, t, source, s), generate


def _transpose_plain(to, t0, t1, t2, t3, source, s0, s1, s2, s3):
    source, to = source.reshape(-1), to.reshape(-1)
    rows = np.array([source[s : s + LANES] for s in (s0, s1, s2, s3)])
    for row, t in zip(rows.T, (t0, t1, t2, t3), strict=True):
        to[t : t + LANES] = row


def _move_plain(to, t, source, s):
    to.reshape(-1)[t : t + LANES] = source.reshape(-1)[s : s + LANES]


_PLAIN: bool = vars(config)["DISABLE_JIT"]
transpose_four: Any = _transpose_plain if _PLAIN else _transpose_four
"""transpose_four(to, t0, t1, t2, t3, source, s0, s1, s2, s3): to[t_i + j] = source[s_j + i], i and j = 0 .. 3"""
move_four: Any = _move_plain if _PLAIN else _move_four
"""move_four(to, t, source, s): to[t + j] = source[s + j], j = 0 .. 3"""


@njit(cache=True, error_model="numpy", forceinline=True)
def three(x, i):
    """The first three numbers of row i as a tuple: a view of the row would cost as much as what is done with it."""
    return x[i, 0], x[i, 1], x[i, 2]


@njit(cache=True, error_model="numpy", forceinline=True)
def four(q, i):
    """Row i of q (n, 4) as a tuple."""
    return q[i, 0], q[i, 1], q[i, 2], q[i, 3]


@njit(cache=True, error_model="numpy")
def copy_rows(to, source):
    """to[i, j] <- source[i, j] for all rows and columns of source (n, m); `to` may have more. Without numba's checks of
    shapes, whose messages compile for seconds."""
    for i in range(len(source)):
        for j in range(source.shape[1]):
            to[i, j] = source[i, j]
