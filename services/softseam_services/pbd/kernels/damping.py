"""Stiffness-proportional damping of blocks: stress P + b dP/dt, with P_n turned along with its block.

Implicit Euler damps as a b of the length h of its substep would (zeta = omega h/2), so b - h is left to add. With
c = (b - h)/h a substep asks for Lambda = P + c (P - P'_n), P'_n the stress at its start in the frame that the block is
about to have. For y = (Lambda + c P'_n)/(1 + c) that is y = P, and a change of Lambda is 1 + c times one of y: so the
sweeps, told that h^2 is (1 + c) h^2, bring y to P as ever, and

y = (Lambda + c P'_n)/(1 + c)  before them,   Lambda = (1 + c) y - c P'_n  after them                          (1)

Without the turn a free body that is under stress and spins at w would lose its spin at the rate b w^2. The turn is the
one that fits F_n best to the F of the prediction, with f_a the columns of F_n:

(tr(B) - B) w = sum f_a x df_a,  B = F_n F_n^T,   R = 1 + [w] + (w w^T - w.w)/2                                (2)
"""

from __future__ import annotations

from softseam_services.body.materials.point import LINEAR
from softseam_services.compiled_once import njit

from .block import (
    N_STRESS,
    STRESS,
    VOLUME,
    WANTED,
    gather,
    hoist,
    load_stress,
    of_batch,
    of_lane,
    read_row,
    shape,
    store_stress,
    write_row,
)
from .lanes import LANES, batch_kernel, lane_kernel, move_four
from .laws import write_stress

N_FRAME = 9 * LANES
"""numbers of F in a batch"""
TINY = 1e-30


@njit(cache=True, error_model="numpy")
def damping_share(time, h):
    """c of eq. (1) for a damping of b = time [s]; 0 where implicit Euler damps as much or more."""
    return max(0.0, time / h - 1.0)


@batch_kernel
def _write_frames(ws, constants):
    """F of four blocks into the first nine rows of STRESS."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, _ = shape(ws, lane, k)
        row = lane + LANES * STRESS
        ws[row], ws[row + LANES], ws[row + 2 * LANES] = f[0], f[1], f[2]
        ws[row + 3 * LANES], ws[row + 4 * LANES], ws[row + 5 * LANES] = f[3], f[4], f[5]
        ws[row + 6 * LANES], ws[row + 7 * LANES], ws[row + 8 * LANES] = f[6], f[7], f[8]


@lane_kernel
def _turn(f, g):
    """R of eq. (2) between F = f and F = g (9 values each), row by row."""
    d = (
        *(g[0] - f[0], g[1] - f[1], g[2] - f[2], g[3] - f[3], g[4] - f[4]),
        *(g[5] - f[5], g[6] - f[6], g[7] - f[7], g[8] - f[8]),
    )
    x = f[3] * d[6] + f[4] * d[7] + f[5] * d[8] - f[6] * d[3] - f[7] * d[4] - f[8] * d[5]
    y = f[6] * d[0] + f[7] * d[1] + f[8] * d[2] - f[0] * d[6] - f[1] * d[7] - f[2] * d[8]
    z = f[0] * d[3] + f[1] * d[4] + f[2] * d[5] - f[3] * d[0] - f[4] * d[1] - f[5] * d[2]
    xx = f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
    yy = f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
    zz = f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
    a, b, c = yy + zz, xx + zz, xx + yy
    e = -(f[0] * f[3] + f[1] * f[4] + f[2] * f[5])
    m = -(f[0] * f[6] + f[1] * f[7] + f[2] * f[8])
    n = -(f[3] * f[6] + f[4] * f[7] + f[5] * f[8])
    # The symmetric system [[a, e, m], [e, b, n], [m, n, c]] w = (x, y, z) by its cofactors.
    i, j, k = b * c - n * n, m * n - e * c, e * n - m * b
    over = 1.0 / (a * i + e * j + m * k + TINY)
    wx = over * (i * x + j * y + k * z)
    wy = over * (j * x + (a * c - m * m) * y + (m * e - a * n) * z)
    wz = over * (k * x + (m * e - a * n) * y + (a * b - e * e) * z)
    half = 0.5 * (wx * wx + wy * wy + wz * wz)
    xy, xz, yz = 0.5 * wx * wy, 0.5 * wx * wz, 0.5 * wy * wz
    return (
        *(1.0 + 0.5 * wx * wx - half, xy - wz, xz + wy),
        *(xy + wz, 1.0 + 0.5 * wy * wy - half, yz - wx),
        *(xz - wy, yz + wx, 1.0 + 0.5 * wz * wz - half),
    )


@lane_kernel
def _mixed(r, a, u, v, w):
    """Row a of R (u, v, w), rows of seven."""
    p, q, s = r[3 * a], r[3 * a + 1], r[3 * a + 2]
    return (
        p * u[0] + q * v[0] + s * w[0],
        p * u[1] + q * v[1] + s * w[1],
        p * u[2] + q * v[2] + s * w[2],
        p * u[3] + q * v[3] + s * w[3],
        p * u[4] + q * v[4] + s * w[4],
        p * u[5] + q * v[5] + s * w[5],
        p * u[6] + q * v[6] + s * w[6],
    )


@batch_kernel
def _turn_lanes(ws, constants):
    """Rows STRESS of four blocks, turned from the F in the first rows of WANTED to that of their nodes now."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        row = lane + LANES * WANTED
        f = (
            *(ws[row], ws[row + LANES], ws[row + 2 * LANES], ws[row + 3 * LANES], ws[row + 4 * LANES]),
            *(ws[row + 5 * LANES], ws[row + 6 * LANES], ws[row + 7 * LANES], ws[row + 8 * LANES]),
        )
        g, _ = shape(ws, lane, k)
        r = _turn(f, g)
        u, v, w = read_row(ws, lane, STRESS, 0), read_row(ws, lane, STRESS, 1), read_row(ws, lane, STRESS, 2)
        write_row(ws, lane, STRESS, 0, _mixed(r, 0, u, v, w))
        write_row(ws, lane, STRESS, 1, _mixed(r, 1, u, v, w))
        write_row(ws, lane, STRESS, 2, _mixed(r, 2, u, v, w))


@njit(cache=True, error_model="numpy")
def note_shapes(ws, xw, nodes, volume, constants, law, asked, frame, first, end):
    """P_n and F_n of the blocks in batches first .. end - 1 into asked (b, N_STRESS) and frame (b, N_FRAME)."""
    for batch in range(first, end):
        gather(ws, xw, nodes, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        own = of_batch(constants, batch)
        write_stress(ws, own, law)
        store_stress(ws, WANTED, asked, batch)
        _write_frames(ws, own)
        for row in range(9):
            move_four(frame, N_FRAME * batch + LANES * row, ws, LANES * (STRESS + row))


@njit(cache=True, error_model="numpy")
def begin_damping(ws, xw, nodes, constants, law, share, asked, frame, stress, first, end):
    """Lambda to y of eq. (1), c = share, from the predicted positions; stress and asked (P_n to P'_n) in place.

    The linear law knows no turns, and its stress is not turned.
    """
    per = 1.0 / (1.0 + share)
    for batch in range(first, end):
        if law != LINEAR:
            gather(ws, xw, nodes, batch)
            load_stress(ws, asked, batch)
            for row in range(9):
                move_four(ws, LANES * (WANTED + row), frame, N_FRAME * batch + LANES * row)
            _turn_lanes(ws, of_batch(constants, batch))
            store_stress(ws, STRESS, asked, batch)
        for i in range(N_STRESS):
            stress[batch, i] = per * (stress[batch, i] + share * asked[batch, i])


@njit(cache=True, error_model="numpy")
def end_damping(share, asked, stress, first, end):
    """y back to Lambda of eq. (1), c = share; asked becomes y, which is what lags behind P. Both in place."""
    for batch in range(first, end):
        for i in range(N_STRESS):
            y = stress[batch, i]
            stress[batch, i] = (1.0 + share) * y - share * asked[batch, i]
            asked[batch, i] = y
