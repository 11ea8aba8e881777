"""One XPBD block constraint per hexahedral block, in stress form, for four blocks side by side.

A block is a box with edges l, volume V and node signs xi, eta, zeta = +-1. It stores the stress that it applies,
Lambda_P (3, 3) [N m] and Lambda_m (4, 3) [N], and moves its nodes until that equals the stress that its shape asks for:

b_i = (xi_i/4 l_x, eta_i/4 l_y, zeta_i/4 l_z),  F = sum x_i b_i^T,  q_m = sum h_mi x_i                         (1)
h = (eta zeta, xi zeta, xi eta, xi eta zeta)
U = V (psi(F) + 1/2 q^T K q),  q_m -> F^T q_m for a finite-strain material                                    (2)
P = V (mu F + s cof F + sum_m q_m t_m^T),  t = K F^T q,  T_m = V F t_m,  f_i = -(P b_i + sum_m h_mi T_m)      (3)

Local solve. Moving the nodes by x_i -= h^2 w_i (dL_P b_i + sum_m h_mi dL_m) changes F by about -dL_P diag(G) and q_m
by about -g dL_m, G_b = g/(16 l_b^2), g = kappa h^2 8 max w_i (exact for equal masses, kappa = 1). With
R = P - Lambda_P, D_b = 1/(1 + V (mu + |s| sqrt(I)) G_b), I = max(1, F:F/3), and the worker-one term V ds cof F cof F^T
kept by the Sherman-Morrison formula:
z = V ds sum G_b D_b C_ab R_ab / (1 + V ds sum G_b D_b C_ab^2),  dL_ab = D_b (R_ab - z C_ab)                  (4)
dL_m = (T_m - Lambda_m)/(1 + g V k_m I),  k_m = max_c sum |K_(m,c),.|                                         (5)
Whatever the approximations of (4) and (5), the fixed point is Lambda = (P, T): statics are exact.
Blocks that are no boxes have eq. (1) and K of their own, see `form`; the rest is the same. Which of the two a kernel is
compiled for follows from the constants' number of axes, and costs boxes nothing.

The workspace `ws` is flat, row r of a lane at 4 r + lane, and the only array in the loops over lanes: so the compiler
uses vector instructions. For the same reason constants come as a tuple (`hoist`), and F (row by row) and q (mode by
mode) are tuples of scalars; stress goes by threes of rows, each with row c of P and component c of T (7 values).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.materials.prototype import MAX_PARAMETERS
from softseam_services.jit import record

from .block_rows import INVERSE_MASS, LAM, MU, N_OF_BOX, N_STRESS, PAIR, PARAMETERS, ROWS, SHEAR, STRESS, TWIST, B
from .form import FORM_PARAMETERS, bring_forms, from_sums, hourglass_of_form, of_form, to_sums
from .lanes import LANES, aligned, lane_kernel, move_four, transpose_four


@record
class Constants(NamedTuple):
    """Of the blocks, for the kernels; the blocks of a batch are of one material."""

    table: NDArray[np.float64]
    """of each material of boxes, see `hourglass.block_constants` (m, N_CONSTANTS); of each batch of blocks of any
    shape, see `form` (b, N_FORM, LANES)"""
    number: NDArray[np.int32]
    """of each batch's row in the table (b,)"""
    fold: NDArray[np.float64]
    """of blocks that relax, see `relaxing` (b, N_FOLD, LANES); of others (0, N_FOLD, LANES)"""


def new_workspace() -> NDArray[np.float64]:
    """Workspace of the block kernels (ROWS * LANES,)."""
    return aligned(ROWS * LANES)


@lane_kernel
def of_batch(constants, batch):
    """The constants of a batch's material (N_CONSTANTS,), or of its four blocks (N_FORM, LANES)."""
    return constants.table[constants.number[batch]]


@lane_kernel
def hoist(ws, k):
    """What `hoisted` returns; forms go into the workspace."""
    if k.ndim > 1:
        bring_forms(ws, k)
    return hoisted(k)


@lane_kernel
def hoisted(k):
    """Of boxes the constants before PARAMETERS as a tuple; of forms, which are in the workspace, mu and lambda."""
    if k.ndim == 1:
        return (
            *(k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8], k[9], k[10], k[11], k[12], k[13], k[14]),
            *(k[15], k[16], k[17], k[18], k[19], k[20], k[21], k[22], k[23], k[24], k[25], k[26], k[27], k[28], k[29]),
        )
    return k[MU, 0], k[LAM, 0]


@lane_kernel
def of_lane(ws, lane, k):
    """The constants of one lane from what `hoisted` returned."""
    if len(k) == N_OF_BOX:
        return k
    return of_form(ws, lane)


@lane_kernel
def parameters_of(constants):
    """The parameters of a batch's material (MAX_PARAMETERS,)."""
    if constants.ndim == 1:
        return constants[PARAMETERS:]
    return constants[FORM_PARAMETERS : FORM_PARAMETERS + MAX_PARAMETERS, 0].copy()


@lane_kernel
def gather(ws, xw, nodes, batch):
    """Positions and inverse masses of a batch's nodes, from xw (n + 8, 4)."""
    for node in range(8):
        row = 3 * LANES * node
        transpose_four(
            ws,
            row,
            row + LANES,
            row + 2 * LANES,
            LANES * (INVERSE_MASS + node),
            xw,
            4 * nodes[batch, node, 0],
            4 * nodes[batch, node, 1],
            4 * nodes[batch, node, 2],
            4 * nodes[batch, node, 3],
        )


@lane_kernel
def scatter(ws, xw, nodes, batch):
    """The way back of `gather`."""
    for node in range(8):
        row = 3 * LANES * node
        transpose_four(
            xw,
            4 * nodes[batch, node, 0],
            4 * nodes[batch, node, 1],
            4 * nodes[batch, node, 2],
            4 * nodes[batch, node, 3],
            ws,
            row,
            row + LANES,
            row + 2 * LANES,
            LANES * (INVERSE_MASS + node),
        )


@lane_kernel
def load_stress(ws, stress, batch):
    """Lambda of a batch, from stress (b, N_STRESS)."""
    for row in range(21):
        move_four(ws, LANES * (STRESS + row), stress, N_STRESS * batch + LANES * row)


@lane_kernel
def store_stress(ws, row_start, stress, batch):
    """The rows from row_start on become Lambda of a batch."""
    for row in range(21):
        move_four(stress, N_STRESS * batch + LANES * row, ws, LANES * (row_start + row))


@lane_kernel
def _transform(ws, lane, c, k):
    """Row c of F and component c of q: the 8-point Walsh-Hadamard transform of the nodes, eq. (1)."""
    u0, u1 = ws[lane + LANES * c], ws[lane + LANES * (3 + c)]
    u2, u3 = ws[lane + LANES * (6 + c)], ws[lane + LANES * (9 + c)]
    u4, u5 = ws[lane + LANES * (12 + c)], ws[lane + LANES * (15 + c)]
    u6, u7 = ws[lane + LANES * (18 + c)], ws[lane + LANES * (21 + c)]
    s0, d0 = u0 + u1, u1 - u0
    s1, d1 = u2 + u3, u3 - u2
    s2, d2 = u4 + u5, u5 - u4
    s3, d3 = u6 + u7, u7 - u6
    sa, sb, sc, sd = s0 + s1, s1 - s0, s2 + s3, s3 - s2
    da, db, dc, dd = d0 + d1, d1 - d0, d2 + d3, d3 - d2
    if len(k) == N_OF_BOX:
        return (
            ((da + dc) * k[B], (sb + sd) * k[B + 1], (sc - sa) * k[B + 2]),
            (sd - sb, dc - da, db + dd, dd - db),
        )
    return from_sums(ws, lane, (da + dc, sb + sd, sc - sa), (sd - sb, dc - da, db + dd, dd - db))


@lane_kernel
def shape(ws, lane, k):
    """F (9 values) and q (12 values) of one lane, eq. (1)."""
    f0, x = _transform(ws, lane, 0, k)
    f1, y = _transform(ws, lane, 1, k)
    f2, z = _transform(ws, lane, 2, k)
    return (*f0, *f1, *f2), (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2], x[3], y[3], z[3])


@lane_kernel
def hourglass(k, q):
    """t = K q (12 values), per volume."""
    if len(k) > N_OF_BOX:
        return hourglass_of_form(k, q)
    x0, y0, z0, x1, y1, z1, x2, y2, z2, x3, y3, z3 = q
    return (
        k[SHEAR] * x0 + k[SHEAR + 3] * y1 + k[SHEAR + 4] * z2,
        k[PAIR + 1] * y0 + k[PAIR + 2] * x1,
        k[PAIR + 4] * z0 + k[PAIR + 5] * x2,
        k[PAIR] * x1 + k[PAIR + 2] * y0,
        k[SHEAR + 3] * x0 + k[SHEAR + 1] * y1 + k[SHEAR + 5] * z2,
        k[PAIR + 7] * z1 + k[PAIR + 8] * y2,
        k[PAIR + 3] * x2 + k[PAIR + 5] * z0,
        k[PAIR + 6] * y2 + k[PAIR + 8] * z1,
        k[SHEAR + 4] * x0 + k[SHEAR + 5] * y1 + k[SHEAR + 2] * z2,
        k[TWIST] * x3,
        k[TWIST + 1] * y3,
        k[TWIST + 2] * z3,
    )


@lane_kernel
def bending_energy(k, q):
    """1/2 q^T K q, per volume."""
    t = hourglass(k, q)
    low = q[0] * t[0] + q[1] * t[1] + q[2] * t[2] + q[3] * t[3] + q[4] * t[4] + q[5] * t[5]
    return 0.5 * (low + q[6] * t[6] + q[7] * t[7] + q[8] * t[8] + q[9] * t[9] + q[10] * t[10] + q[11] * t[11])


@lane_kernel
def node_softness(ws, lane, hh):
    """g_i = h^2 w_i of the eight nodes."""
    return (
        hh * ws[lane + LANES * INVERSE_MASS],
        hh * ws[lane + LANES * (INVERSE_MASS + 1)],
        hh * ws[lane + LANES * (INVERSE_MASS + 2)],
        hh * ws[lane + LANES * (INVERSE_MASS + 3)],
        hh * ws[lane + LANES * (INVERSE_MASS + 4)],
        hh * ws[lane + LANES * (INVERSE_MASS + 5)],
        hh * ws[lane + LANES * (INVERSE_MASS + 6)],
        hh * ws[lane + LANES * (INVERSE_MASS + 7)],
    )


@lane_kernel
def read_row(ws, lane, start, c):
    """Row c of P and component c of T (7 values) among the 21 rows from start on."""
    return (
        ws[lane + LANES * (start + 3 * c)],
        ws[lane + LANES * (start + 1 + 3 * c)],
        ws[lane + LANES * (start + 2 + 3 * c)],
        ws[lane + LANES * (start + 9 + c)],
        ws[lane + LANES * (start + 12 + c)],
        ws[lane + LANES * (start + 15 + c)],
        ws[lane + LANES * (start + 18 + c)],
    )


@lane_kernel
def write_row(ws, lane, start, c, row):
    """The way back of `read_row`."""
    ws[lane + LANES * (start + 3 * c)] = row[0]
    ws[lane + LANES * (start + 1 + 3 * c)] = row[1]
    ws[lane + LANES * (start + 2 + 3 * c)] = row[2]
    ws[lane + LANES * (start + 9 + c)] = row[3]
    ws[lane + LANES * (start + 12 + c)] = row[4]
    ws[lane + LANES * (start + 15 + c)] = row[5]
    ws[lane + LANES * (start + 18 + c)] = row[6]


@lane_kernel
def residual(stress, at, c, wanted):
    """Row c of P - Lambda_P and component c of T - Lambda_m (7 values); a lane's Lambda begins at stress[at]."""
    p0, p1, p2, t0, t1, t2, t3 = read_row(stress, at, 0, c)
    w = wanted
    return w[0] - p0, w[1] - p1, w[2] - p2, w[3] - t0, w[4] - t1, w[5] - t2, w[6] - t3


@lane_kernel
def _to_sums(ws, lane, k, change):
    """What dL_P and dL_m (7 values) do along the nodes' signs (3 values) and modes (4 values)."""
    if len(k) == N_OF_BOX:
        return (
            *(change[0] * k[B], change[1] * k[B + 1], change[2] * k[B + 2]),
            *(change[3], change[4], change[5], change[6]),
        )
    return to_sums(ws, lane, change)


@lane_kernel
def spread(ws, lane, c, k, g, change):
    """Move component c of the nodes: x_i -= g_i (dL_P b_i + sum_m h_mi dL_m), with g of the nodes (8 values).

    change (7 values) is row c of dL_P and component c of dL_m.
    """
    cx, cy, cz, m0, m1, m2, m3 = _to_sums(ws, lane, k, change)
    c0, c1, c2, c3 = m0 - cy - cz, cy - cz - m0, cz - cy - m0, cy + cz + m0
    e0, e1, e2, e3 = cx - m2 - m1 + m3, cx + m2 - m1 - m3, cx - m2 + m1 - m3, cx + m2 + m1 + m3
    ws[lane + LANES * c] -= g[0] * (c0 - e0)
    ws[lane + LANES * (3 + c)] -= g[1] * (c0 + e0)
    ws[lane + LANES * (6 + c)] -= g[2] * (c1 - e1)
    ws[lane + LANES * (9 + c)] -= g[3] * (c1 + e1)
    ws[lane + LANES * (12 + c)] -= g[4] * (c2 - e2)
    ws[lane + LANES * (15 + c)] -= g[5] * (c2 + e2)
    ws[lane + LANES * (18 + c)] -= g[6] * (c3 - e3)
    ws[lane + LANES * (21 + c)] -= g[7] * (c3 + e3)


@lane_kernel
def answer(ws, lane, stress, at, c, k, g, change):
    """Lambda += dL and the motion that follows, for row and component c (7 values)."""
    p0, p1, p2, t0, t1, t2, t3 = read_row(stress, at, 0, c)
    d = change
    total = p0 + d[0], p1 + d[1], p2 + d[2], t0 + d[3], t1 + d[4], t2 + d[5], t3 + d[6]
    write_row(stress, at, 0, c, total)
    spread(ws, lane, c, k, g, change)
