"""Energy, stress and local solve of blocks whose stress relaxes; equations are those of `block` but for these.

Over some substeps all branches of a block are one frozen tensor g Q, symmetric and positive definite (`renew`), and its
hourglass modes follow a shifted rest. With mu_inf and lambda_inf of what lasts, g = J^(-2/3), J' the volume ratio as
the substeps begin, and lambda of a quick load, the block stores, but for a constant,
psi = C : T/2 - mu' ln J + lambda/2 ln^2 J + q . (G/2 K q + K r),  q_m -> F^T q_m                              (1)
T = mu_inf + g Q,  mu' = mu_inf + C : g Q/3 + (lambda - lambda_inf) ln J'                                       (2)
where G K is what is left of a quick load's bending stiffness. It is a potential, with
P = F T + s cof F + sum_m q_m t_m^T,  s = (lambda ln J - mu')/J,  t = K (G q + r)                               (3)
which is that of mu_inf and of the branches as the substeps begin, whose pressure is none: there s = s_inf - C : g Q/3J.
At rest it is neo-Hookean of a quick load. Local solve: max T_jj takes the place of mu in D_b of `block`.
"""

import numpy as np

from softseam_services.jit import njit

from .block import (
    gather,
    hoist,
    hourglass,
    load_stress,
    node_softness,
    of_batch,
    of_lane,
    parameters_of,
    residual,
    scatter,
    shape,
    store_stress,
    write_row,
)
from .block_rows import (
    ENERGY,
    FOLD,
    HELD,
    LAM,
    N_FOLD,
    N_SWEPT,
    PRESSED,
    RATIO,
    REST,
    SHARE,
    SOFTNESS,
    STIFF,
    STRESS,
    VOLUME,
    WANTED,
)
from .lanes import LANES, batch_kernel, lane_kernel, move_four
from .neo_hookean import LN_2, cofactors, solve_lane, turned_back, volumetric

ROUNDS = 1.5 * 2.0**52
"""leaves a whole number where it is added"""
LN_2_HIGH = float.fromhex("0x1.62e42fee00000p-1")
LN_2_LOW = float.fromhex("0x1.a39ef35793c76p-33")
"""ln 2 in two parts, the first of which loses nothing times a whole number"""
BIAS = 1023


@lane_kernel
def exponential(x):
    """exp x to 3 units in the last place, |x| < 700, from operations that vectorise.

    x = n ln 2 + r, |r| < .347, and twelve terms of the series of exp r.
    """
    shifted = x * (1.0 / LN_2) + ROUNDS
    n = shifted - ROUNDS
    r = (x - n * LN_2_HIGH) - n * LN_2_LOW
    z = r * r
    y = z * z
    low = (1.0 + r) + z * (0.5 + r * (1.0 / 6.0))
    middle = (1.0 / 24.0 + r * (1.0 / 120.0)) + z * (1.0 / 720.0 + r * (1.0 / 5040.0))
    high = (1.0 / 40320.0 + r * (1.0 / 362880.0)) + z * (1.0 / 3628800.0 + r * (1.0 / 39916800.0))
    bits = (np.float64(shifted).view(np.int64) + np.int64(BIAS)) << np.int64(52)
    power = np.int64(bits).view(np.float64)
    return (low + y * (middle + y * high)) * power


@njit(cache=True, error_model="numpy")
def lasting(constants):
    """mu_inf and lambda of a batch's material [Pa]."""
    parameters = parameters_of(constants)
    return parameters[0], parameters[1]


@njit(cache=True, error_model="numpy")
def bring_fold(ws, constants, batch):
    """What folds the branches of a batch, into the workspace; of blocks that do not relax nothing."""
    if len(constants.fold) == 0:
        return
    for row in range(N_SWEPT + 1):
        move_four(ws, LANES * (FOLD + row), constants.fold, LANES * (N_FOLD * batch + row))


@lane_kernel
def facing(ws, lane):
    """T of a lane (6 values)."""
    a = lane + LANES * FOLD
    return ws[a], ws[a + LANES], ws[a + 2 * LANES], ws[a + 3 * LANES], ws[a + 4 * LANES], ws[a + 5 * LANES]


@lane_kernel
def twelve(ws, lane, row):
    """Twelve rows of a lane."""
    a = lane + LANES * row
    return (
        *(ws[a], ws[a + LANES], ws[a + 2 * LANES], ws[a + 3 * LANES], ws[a + 4 * LANES], ws[a + 5 * LANES]),
        *(ws[a + 6 * LANES], ws[a + 7 * LANES], ws[a + 8 * LANES], ws[a + 9 * LANES]),
        *(ws[a + 10 * LANES], ws[a + 11 * LANES]),
    )


@lane_kernel
def put_twelve(ws, lane, row, a):
    """The way back of `twelve`."""
    at = lane + LANES * row
    ws[at], ws[at + LANES], ws[at + 2 * LANES], ws[at + 3 * LANES] = a[0], a[1], a[2], a[3]
    ws[at + 4 * LANES], ws[at + 5 * LANES], ws[at + 6 * LANES], ws[at + 7 * LANES] = a[4], a[5], a[6], a[7]
    ws[at + 8 * LANES], ws[at + 9 * LANES], ws[at + 10 * LANES], ws[at + 11 * LANES] = a[8], a[9], a[10], a[11]


@lane_kernel
def turned_by(f, s):
    """F S of a symmetric S = s (6 values), row by row (9 values)."""
    f0, f1, f2, f3, f4, f5, f6, f7, f8 = f
    return (
        *(f0 * s[0] + f1 * s[5] + f2 * s[4], f0 * s[5] + f1 * s[1] + f2 * s[3], f0 * s[4] + f1 * s[3] + f2 * s[2]),
        *(f3 * s[0] + f4 * s[5] + f5 * s[4], f3 * s[5] + f4 * s[1] + f5 * s[3], f3 * s[4] + f4 * s[3] + f5 * s[2]),
        *(f6 * s[0] + f7 * s[5] + f8 * s[4], f6 * s[5] + f7 * s[1] + f8 * s[3], f6 * s[4] + f7 * s[3] + f8 * s[2]),
    )


@lane_kernel
def _inner(a, b):
    """Of nine values."""
    low = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4]
    return low + (a[5] * b[5] + a[6] * b[6] + a[7] * b[7] + a[8] * b[8])


@lane_kernel
def inner_twelve(a, b):
    """Of twelve values."""
    low = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
    return low + (a[6] * b[6] + a[7] * b[7] + a[8] * b[8] + a[9] * b[9] + a[10] * b[10] + a[11] * b[11])


@lane_kernel
def _shifted(ws, lane, k, q):
    """t = K (G q + r) (12 values), per volume."""
    share, r = ws[lane + LANES * SHARE], twelve(ws, lane, REST)
    return hourglass(
        k,
        (
            *(share * q[0] + r[0], share * q[1] + r[1], share * q[2] + r[2], share * q[3] + r[3]),
            *(share * q[4] + r[4], share * q[5] + r[5], share * q[6] + r[6], share * q[7] + r[7]),
            *(share * q[8] + r[8], share * q[9] + r[9], share * q[10] + r[10], share * q[11] + r[11]),
        ),
    )


@lane_kernel
def _row(a, f, e, c, q, t, s, V):
    """Row a of P and component a of T (7 values), eq. (3); e is F T."""
    f0, f1, f2 = f[3 * a], f[3 * a + 1], f[3 * a + 2]
    q0, q1, q2, q3 = q[a], q[3 + a], q[6 + a], q[9 + a]
    return (
        V * (e[3 * a] + s * c[3 * a] + q0 * t[0] + q1 * t[3] + q2 * t[6] + q3 * t[9]),
        V * (e[3 * a + 1] + s * c[3 * a + 1] + q0 * t[1] + q1 * t[4] + q2 * t[7] + q3 * t[10]),
        V * (e[3 * a + 2] + s * c[3 * a + 2] + q0 * t[2] + q1 * t[5] + q2 * t[8] + q3 * t[11]),
        V * (f0 * t[0] + f1 * t[1] + f2 * t[2]),
        V * (f0 * t[3] + f1 * t[4] + f2 * t[5]),
        V * (f0 * t[6] + f1 * t[7] + f2 * t[8]),
        V * (f0 * t[9] + f1 * t[10] + f2 * t[11]),
    )


@batch_kernel
def project_lanes_relaxing(ws, constants, kappa, hh):
    """Solve four blocks once."""
    hoisted = hoist(ws, constants)
    lam = hoisted[LAM]
    for lane in range(LANES):
        k, by = of_lane(ws, lane, hoisted), kappa * hh * ws[lane + LANES * SOFTNESS]
        V, at = ws[lane + LANES * VOLUME], lane + LANES * STRESS
        f, q = shape(ws, lane, k)
        c, J = cofactors(f)
        e = turned_by(f, facing(ws, lane))
        _, s, ds = volumetric(J, ws[lane + LANES * PRESSED], lam)
        t = _shifted(ws, lane, k, turned_back(f, q))
        r0 = residual(ws, at, 0, _row(0, f, e, c, q, t, s, V))
        r1 = residual(ws, at, 1, _row(1, f, e, c, q, t, s, V))
        r2 = residual(ws, at, 2, _row(2, f, e, c, q, t, s, V))
        bound = max(1.0, _inner(f, f) * (1.0 / 3.0))
        stiffness = V * (ws[lane + LANES * STIFF] + abs(s) * np.sqrt(bound))
        move = node_softness(ws, lane, hh)
        by_bending = by * V * bound * ws[lane + LANES * SHARE]
        solve_lane(ws, lane, ws, at, k, f, c, (r0, r1, r2), V, by, stiffness, ds, by_bending, move)


@njit(cache=True, error_model="numpy", aside=())
def sweep_relaxing(ws, xw, nodes, volume, softness, stress, constants, kappa, hh, first, end):
    """As `sweep.sweep`."""
    for batch in range(first, end):
        gather(ws, xw, nodes, batch)
        load_stress(ws, stress, batch)
        move_four(ws, LANES * SOFTNESS, softness, LANES * batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        for row in range(N_SWEPT):
            move_four(ws, LANES * (FOLD + row), constants.fold, LANES * (N_FOLD * batch + row))
        project_lanes_relaxing(ws, of_batch(constants, batch), kappa, hh)
        store_stress(ws, STRESS, stress, batch)
        scatter(ws, xw, nodes, batch)


@njit(cache=True, error_model="numpy", fastmath={"contract"}, aside=())
def stress_lanes_relaxing(ws, constants):
    """Rows WANTED of four blocks: P and T that their shapes ask for, eq. (3)."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k, V = of_lane(ws, lane, hoisted), ws[lane + LANES * VOLUME]
        f, q = shape(ws, lane, k)
        c, J = cofactors(f)
        e = turned_by(f, facing(ws, lane))
        _, s, _ = volumetric(J, ws[lane + LANES * PRESSED], hoisted[LAM])
        t = _shifted(ws, lane, k, turned_back(f, q))
        write_row(ws, lane, WANTED, 0, _row(0, f, e, c, q, t, s, V))
        write_row(ws, lane, WANTED, 1, _row(1, f, e, c, q, t, s, V))
        write_row(ws, lane, WANTED, 2, _row(2, f, e, c, q, t, s, V))


@njit(cache=True, error_model="numpy", fastmath={"contract"}, aside=())
def energy_lanes_relaxing(ws, constants):
    """Rows RATIO, ENERGY of four blocks: J and U, eq. (1)."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, q = shape(ws, lane, k)
        _, J = cofactors(f)
        energy, _, _ = volumetric(J, ws[lane + LANES * PRESSED], hoisted[LAM])
        energy += 0.5 * _inner(f, turned_by(f, facing(ws, lane))) + ws[lane + LANES * HELD]
        back = turned_back(f, q)
        t = hourglass(k, back)
        energy += 0.5 * ws[lane + LANES * SHARE] * inner_twelve(t, back) + inner_twelve(t, twelve(ws, lane, REST))
        ws[lane + LANES * RATIO] = J
        ws[lane + LANES * ENERGY] = ws[lane + LANES * VOLUME] * energy


@njit(cache=True, error_model="numpy", fastmath={"contract"}, aside=())
def cauchy_lanes_relaxing(ws, constants):
    """The first six rows of WANTED: the Cauchy stress at the centres of four blocks, xx yy zz yz xz xy [Pa]."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        f, _ = shape(ws, lane, of_lane(ws, lane, hoisted))
        _, J = cofactors(f)
        e, over = turned_by(f, facing(ws, lane)), 1.0 / J
        _, s, _ = volumetric(J, ws[lane + LANES * PRESSED], hoisted[LAM])
        at = lane + LANES * WANTED
        ws[at] = s + over * (e[0] * f[0] + e[1] * f[1] + e[2] * f[2])
        ws[at + LANES] = s + over * (e[3] * f[3] + e[4] * f[4] + e[5] * f[5])
        ws[at + 2 * LANES] = s + over * (e[6] * f[6] + e[7] * f[7] + e[8] * f[8])
        ws[at + 3 * LANES] = over * (e[3] * f[6] + e[4] * f[7] + e[5] * f[8])
        ws[at + 4 * LANES] = over * (e[0] * f[6] + e[1] * f[7] + e[2] * f[8])
        ws[at + 5 * LANES] = over * (e[0] * f[3] + e[1] * f[4] + e[2] * f[5])
