"""Stiffness-proportional damping of blocks: stress P + b dP/dt, with the stress of before turned along with its block.

Implicit Euler damps as a b of the length h of its substep would (zeta = omega h/2), so b - h is left to add. With
c = (b - h)/h a substep asks for Lambda = P + c (P - P'_n), P'_n the stress at its start in the frame that the block is
about to have. For y = (Lambda + c P'_n)/(1 + c) that is y = P, and a change of Lambda is 1 + c times one of y: so the
sweeps, given that h^2 is (1 + c) h^2, bring y to P as ever, and

y = (Lambda'_n + c P'_n)/(1 + c)  before them,   Lambda = (1 + c) y - c P'_n  after them                       (1)

Without the turn a free body that is under stress and spins at w would lose its spin at the rate b w^2. Lambda_n is
turned as well, and the nodes move by what that changes of its forces: y lags behind P, and a lag that did not turn
would add to the spin. The turn is the one that fits F_n best to the F of the prediction, with f_a the columns of F_n:

(tr(B) - B) w = sum f_a x df_a,  B = F_n F_n^T,   R = 1 + [w] + (w w^T - w.w)/2                                (2)

What unresolved sweeps do (decision 24). One takes D = 1/(1 + kappa b h k) of what y lacks of P, k the block's stiffness
over mass. Where motion is slow beside h/D, y lags by (1/D - 1) h/(1 + c) dP/dt, and damping is

b - (1/D - 1) h = b (1 - kappa k h^2),                                                                         (3)

less than asked for by a share that b does not change: h need not shrink with b. But no sweep may take too much of what
stiff blocks lack. With rho of y's lag left after a sweep, a mode with b h k >> 1 has lambda^2 - 2 rho lambda + rho = 0:
it is stable for -1/3 < rho < 1. A block whose nodes are as light as its local solve counts with has rho = 1 - 1/kappa:
kappa >= 3/4                                                                                                   (4)
"""

from softseam_services.body.materials.point import LINEAR
from softseam_services.jit import njit

from .block import (
    gather,
    hoist,
    load_stress,
    node_softness,
    of_batch,
    of_lane,
    read_row,
    scatter,
    shape,
    spread,
    store_stress,
    write_row,
)
from .block_rows import N_STRESS, STRESS, VOLUME, WANTED
from .lanes import LANES, batch_kernel, lane_kernel, move_four
from .laws import write_stress

N_FRAME = 9 * LANES
"""numbers of F in a batch"""
TINY = 1e-30
LEAST_KAPPA = 0.75
"""eq. (4)"""


@njit(cache=True, error_model="numpy")
def damping_share(time, lag, h, n_sweeps):
    """c of eq. (1) for a damping of b = time [s], what eq. (3) leaves out added; 0 where implicit Euler damps as much.

    lag: kappa k of eq. (3) [1/s^2]; after n sweeps (1 - D)^n of what y lacks is left.
    """
    if time <= h:
        return 0.0
    one = time * h * lag / max(0.5, 1.0 - lag * h * h)
    left = (one / (1.0 + one)) ** n_sweeps
    return time / h + left / (1.0 - left) - 1.0


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
def _read_nine(ws, lane):
    """The first nine rows of WANTED."""
    row = lane + LANES * WANTED
    return (
        *(ws[row], ws[row + LANES], ws[row + 2 * LANES], ws[row + 3 * LANES], ws[row + 4 * LANES]),
        *(ws[row + 5 * LANES], ws[row + 6 * LANES], ws[row + 7 * LANES], ws[row + 8 * LANES]),
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


@lane_kernel
def _turned(ws, lane, r):
    """The three rows of STRESS (7 values each), turned by R."""
    u, v, w = read_row(ws, lane, STRESS, 0), read_row(ws, lane, STRESS, 1), read_row(ws, lane, STRESS, 2)
    return _mixed(r, 0, u, v, w), _mixed(r, 1, u, v, w), _mixed(r, 2, u, v, w)


@lane_kernel
def _turn_row(ws, lane, a, row, k, move):
    """Row a of STRESS becomes `row` (7 values), and the nodes move by what that adds to their forces."""
    p0, p1, p2, t0, t1, t2, t3 = read_row(ws, lane, STRESS, a)
    write_row(ws, lane, STRESS, a, row)
    q = row
    spread(ws, lane, a, k, move, (q[0] - p0, q[1] - p1, q[2] - p2, q[3] - t0, q[4] - t1, q[5] - t2, q[6] - t3))


@batch_kernel
def _turn_lanes(ws, constants, hh):
    """Rows STRESS of four blocks, turned from the F in the first rows of WANTED to that of their nodes now.

    The nodes move as the stress does; R takes the place of F.
    """
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        g, _ = shape(ws, lane, k)
        r = _turn(_read_nine(ws, lane), g)
        row = lane + LANES * WANTED
        ws[row], ws[row + LANES], ws[row + 2 * LANES] = r[0], r[1], r[2]
        ws[row + 3 * LANES], ws[row + 4 * LANES], ws[row + 5 * LANES] = r[3], r[4], r[5]
        ws[row + 6 * LANES], ws[row + 7 * LANES], ws[row + 8 * LANES] = r[6], r[7], r[8]
        u, v, w = _turned(ws, lane, r)
        move = node_softness(ws, lane, hh)
        _turn_row(ws, lane, 0, u, k, move)
        _turn_row(ws, lane, 1, v, k, move)
        _turn_row(ws, lane, 2, w, k, move)


@batch_kernel
def _turn_also(ws):
    """Rows STRESS of four blocks, turned by the R in the first rows of WANTED; their nodes stay."""
    for lane in range(LANES):
        u, v, w = _turned(ws, lane, _read_nine(ws, lane))
        write_row(ws, lane, STRESS, 0, u)
        write_row(ws, lane, STRESS, 1, v)
        write_row(ws, lane, STRESS, 2, w)


@njit(cache=True, error_model="numpy", aside=())
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


@njit(cache=True, error_model="numpy", aside=())
def begin_damping(ws, xw, nodes, constants, law, share, hh, asked, frame, stress, first, end):
    """Lambda to y of eq. (1), c = share, from the predicted positions in xw, which move by what Lambda's turn adds.

    stress and asked (P_n to P'_n) change in place. Batches first .. end - 1 share no node; hh is h^2 [s^2]. The linear
    law knows no turns, and its stress is not turned.
    """
    per = 1.0 / (1.0 + share)
    for batch in range(first, end):
        if law != LINEAR:
            gather(ws, xw, nodes, batch)
            load_stress(ws, stress, batch)
            for row in range(9):
                move_four(ws, LANES * (WANTED + row), frame, N_FRAME * batch + LANES * row)
            _turn_lanes(ws, of_batch(constants, batch), hh)
            store_stress(ws, STRESS, stress, batch)
            load_stress(ws, asked, batch)
            _turn_also(ws)
            store_stress(ws, STRESS, asked, batch)
            scatter(ws, xw, nodes, batch)
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
