"""Energy, stress and local solve of the block constraint for the neo-Hookean energy; equations are those of `block`."""

import math

import numpy as np

from softseam_services.body.materials.neo_hookean import J_MIN

from .block import answer, bending_energy, hoist, hourglass, node_softness, of_lane, residual, shape, write_row
from .block_rows import BOUND, ENERGY, LAM, MU, RATIO, SOFTNESS, STRESS, VOLUME, WANTED, G
from .lanes import LANES, batch_kernel, lane_kernel

LN_2 = math.log(2.0)
ROOT_HALF = 0x3FE6A09E667F3BCD
"""the bits of sqrt(1/2)"""


@lane_kernel
def logarithm(x):
    """ln x of a normal positive number to 2 units in the last place, from operations that vectorise.

    The library's is called number by number.

    x = m 2^e with m in sqrt(1/2) .. sqrt(2), s = (m - 1)/(m + 1), ln x = e ln 2 + 2 artanh s, and |s| < 0.172 needs ten
    terms of artanh s = s + s^3/3 + s^5/5 + ...
    """
    bits = np.float64(x).view(np.int64)
    e = (bits - np.int64(ROOT_HALF)) >> np.int64(52)
    m = np.int64(bits - (e << np.int64(52))).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    y = z * z
    u = y * y
    low = z * (1.0 / 3.0) + y * (1.0 / 5.0 + z * (1.0 / 7.0))
    high = (1.0 / 9.0 + z * (1.0 / 11.0)) + y * (1.0 / 13.0 + z * (1.0 / 15.0)) + u * (1.0 / 17.0 + z * (1.0 / 19.0))
    return e * LN_2 + (2.0 * s + 2.0 * s * (low + u * high))


@lane_kernel
def cofactors(f):
    """cof F (9 values) and J = det F of F (9 values)."""
    f00, f01, f02, f10, f11, f12, f20, f21, f22 = f
    c00, c01, c02 = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
    c10, c11, c12 = f02 * f21 - f01 * f22, f00 * f22 - f02 * f20, f01 * f20 - f00 * f21
    c20, c21, c22 = f01 * f12 - f02 * f11, f02 * f10 - f00 * f12, f00 * f11 - f01 * f10
    return (c00, c01, c02, c10, c11, c12, c20, c21, c22), f00 * c00 + f01 * c01 + f02 * c02


@lane_kernel
def volumetric(J, mu, lam):
    """psi_J, s and ds at J: `body.materials.neo_hookean.volumetric` without branches, so that it vectorises."""
    inside = J if J > J_MIN else J_MIN
    log = logarithm(inside)
    over = 1.0 / inside
    below = J - inside
    slope = (lam * log - mu) * over
    ds = (lam * (1.0 - log) + mu) * (over * over)
    return log * (0.5 * lam * log - mu) + below * (slope + 0.5 * below * ds), slope + below * ds, ds


@lane_kernel
def turned_back(f, q):
    """F^T q_m of the four modes (12 values)."""
    f00, f01, f02, f10, f11, f12, f20, f21, f22 = f
    x0, y0, z0, x1, y1, z1, x2, y2, z2, x3, y3, z3 = q
    return (
        f00 * x0 + f10 * y0 + f20 * z0,
        f01 * x0 + f11 * y0 + f21 * z0,
        f02 * x0 + f12 * y0 + f22 * z0,
        f00 * x1 + f10 * y1 + f20 * z1,
        f01 * x1 + f11 * y1 + f21 * z1,
        f02 * x1 + f12 * y1 + f22 * z1,
        f00 * x2 + f10 * y2 + f20 * z2,
        f01 * x2 + f11 * y2 + f21 * z2,
        f02 * x2 + f12 * y2 + f22 * z2,
        f00 * x3 + f10 * y3 + f20 * z3,
        f01 * x3 + f11 * y3 + f21 * z3,
        f02 * x3 + f12 * y3 + f22 * z3,
    )


@lane_kernel
def stress_row(a, f, c, q, t, mu, s, V):
    """Row a of P and component a of T (7 values), eq. (3)."""
    f0, f1, f2 = f[3 * a], f[3 * a + 1], f[3 * a + 2]
    q0, q1, q2, q3 = q[a], q[3 + a], q[6 + a], q[9 + a]
    return (
        V * (mu * f0 + s * c[3 * a] + q0 * t[0] + q1 * t[3] + q2 * t[6] + q3 * t[9]),
        V * (mu * f1 + s * c[3 * a + 1] + q0 * t[1] + q1 * t[4] + q2 * t[7] + q3 * t[10]),
        V * (mu * f2 + s * c[3 * a + 2] + q0 * t[2] + q1 * t[5] + q2 * t[8] + q3 * t[11]),
        V * (f0 * t[0] + f1 * t[1] + f2 * t[2]),
        V * (f0 * t[3] + f1 * t[4] + f2 * t[5]),
        V * (f0 * t[6] + f1 * t[7] + f2 * t[8]),
        V * (f0 * t[9] + f1 * t[10] + f2 * t[11]),
    )


@lane_kernel
def _change(a, c, r, z, d, n):
    """Row a of dL_P and component a of dL_m (7 values) from the residuals r, eq. (4) and (5)."""
    return (
        d[0] * (r[0] - z * c[3 * a]),
        d[1] * (r[1] - z * c[3 * a + 1]),
        d[2] * (r[2] - z * c[3 * a + 2]),
        n[0] * r[3],
        n[1] * r[4],
        n[2] * r[5],
        n[3] * r[6],
    )


@lane_kernel
def solve_lane(ws, lane, stress, at, k, f, c, r, V, g, stiffness, ds, by_bending, move):
    """Lambda += dLambda of eq. (4) and (5) from the residuals r (3 rows), and the nodes move.

    stiffness is what G_b counts with in eq. (4), by_bending what k_m does in eq. (5)
    """
    r0, r1, r2 = r
    g0, g1, g2 = g * k[G], g * k[G + 1], g * k[G + 2]
    # One division for three numbers, and for four: a vector's division takes as long as ten products.
    v0, v1, v2 = 1.0 + stiffness * g0, 1.0 + stiffness * g1, 1.0 + stiffness * g2
    over = 1.0 / (v0 * v1 * v2)
    d = over * (v1 * v2), over * (v0 * v2), over * (v0 * v1)
    e0, e1, e2 = g0 * d[0], g1 * d[1], g2 * d[2]
    along = (
        e0 * (c[0] * r0[0] + c[3] * r1[0] + c[6] * r2[0])
        + e1 * (c[1] * r0[1] + c[4] * r1[1] + c[7] * r2[1])
        + e2 * (c[2] * r0[2] + c[5] * r1[2] + c[8] * r2[2])
    )
    length = (
        e0 * (c[0] * c[0] + c[3] * c[3] + c[6] * c[6])
        + e1 * (c[1] * c[1] + c[4] * c[4] + c[7] * c[7])
        + e2 * (c[2] * c[2] + c[5] * c[5] + c[8] * c[8])
    )
    # Past J = exp(1 + mu/lambda) psi_J is concave; the local solve stays definite without its negative curvature.
    bulk = V * max(ds, 0.0)
    z = bulk * along / (1.0 + bulk * length)
    b = by_bending
    v0, v1, v2, v3 = 1.0 + b * k[BOUND], 1.0 + b * k[BOUND + 1], 1.0 + b * k[BOUND + 2], 1.0 + b * k[BOUND + 3]
    v01, v23 = v0 * v1, v2 * v3
    over = 1.0 / (v01 * v23)
    over01, over23 = over * v23, over * v01
    n = over01 * v1, over01 * v0, over23 * v3, over23 * v2
    answer(ws, lane, stress, at, 0, k, move, _change(0, c, r0, z, d, n))
    answer(ws, lane, stress, at, 1, k, move, _change(1, c, r1, z, d, n))
    answer(ws, lane, stress, at, 2, k, move, _change(2, c, r2, z, d, n))


@lane_kernel
def project_lane(ws, lane, stress, at, k, V, g, move):
    """Solve one block once: Lambda += dLambda of eq. (4) and (5), and its nodes, the first rows of ws, move.

    Lambda begins at stress[at]; k are the block's constants, V its volume, g = kappa h^2 8 max w_i, move = h^2 w_i
    """
    mu, lam = k[MU], k[LAM]
    f, q = shape(ws, lane, k)
    c, J = cofactors(f)
    _, s, ds = volumetric(J, mu, lam)
    t = hourglass(k, turned_back(f, q))
    r0 = residual(stress, at, 0, stress_row(0, f, c, q, t, mu, s, V))
    r1 = residual(stress, at, 1, stress_row(1, f, c, q, t, mu, s, V))
    r2 = residual(stress, at, 2, stress_row(2, f, c, q, t, mu, s, V))
    square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] + f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
    square += f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
    bound = max(1.0, square * (1.0 / 3.0))
    stiffness = V * (mu + abs(s) * np.sqrt(bound))
    solve_lane(ws, lane, stress, at, k, f, c, (r0, r1, r2), V, g, stiffness, ds, g * V * bound, move)


@batch_kernel
def project_lanes(ws, constants, kappa, hh):
    """Solve four blocks once."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k, g = of_lane(ws, lane, hoisted), kappa * hh * ws[lane + LANES * SOFTNESS]
        move = node_softness(ws, lane, hh)
        project_lane(ws, lane, ws, lane + LANES * STRESS, k, ws[lane + LANES * VOLUME], g, move)


@batch_kernel
def stress_lanes(ws, constants):
    """Rows WANTED of four blocks: P and T that their shapes ask for, eq. (3)."""
    hoisted = hoist(ws, constants)
    mu, lam = hoisted[MU], hoisted[LAM]
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        V = ws[lane + LANES * VOLUME]
        f, q = shape(ws, lane, k)
        c, J = cofactors(f)
        _, s, _ = volumetric(J, mu, lam)
        t = hourglass(k, turned_back(f, q))
        write_row(ws, lane, WANTED, 0, stress_row(0, f, c, q, t, mu, s, V))
        write_row(ws, lane, WANTED, 1, stress_row(1, f, c, q, t, mu, s, V))
        write_row(ws, lane, WANTED, 2, stress_row(2, f, c, q, t, mu, s, V))


@batch_kernel
def energy_lanes(ws, constants):
    """Rows RATIO, ENERGY of four blocks: J and U, eq. (2)."""
    hoisted = hoist(ws, constants)
    mu, lam = hoisted[MU], hoisted[LAM]
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, q = shape(ws, lane, k)
        _, J = cofactors(f)
        energy, _, _ = volumetric(J, mu, lam)
        square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] + f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
        square += f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
        energy += 0.5 * mu * (square - 3.0) + bending_energy(k, turned_back(f, q))
        ws[lane + LANES * RATIO] = J
        ws[lane + LANES * ENERGY] = ws[lane + LANES * VOLUME] * energy


@lane_kernel
def cauchy(f, mu, lam):
    """sigma = mu/J F F^T + s I of F (9 values): xx yy zz yz xz xy [Pa]."""
    _, J = cofactors(f)
    _, s, _ = volumetric(J, mu, lam)
    scale = mu / J
    return (
        scale * (f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) + s,
        scale * (f[3] * f[3] + f[4] * f[4] + f[5] * f[5]) + s,
        scale * (f[6] * f[6] + f[7] * f[7] + f[8] * f[8]) + s,
        scale * (f[3] * f[6] + f[4] * f[7] + f[5] * f[8]),
        scale * (f[0] * f[6] + f[1] * f[7] + f[2] * f[8]),
        scale * (f[0] * f[3] + f[1] * f[4] + f[2] * f[5]),
    )


@batch_kernel
def cauchy_lanes(ws, constants):
    """The first six rows of WANTED: `cauchy` at the centres of four blocks."""
    hoisted = hoist(ws, constants)
    mu, lam = hoisted[MU], hoisted[LAM]
    for lane in range(LANES):
        f, _ = shape(ws, lane, of_lane(ws, lane, hoisted))
        sigma = cauchy(f, mu, lam)
        ws[lane + LANES * WANTED], ws[lane + LANES * (WANTED + 1)] = sigma[0], sigma[1]
        ws[lane + LANES * (WANTED + 2)], ws[lane + LANES * (WANTED + 3)] = sigma[2], sigma[3]
        ws[lane + LANES * (WANTED + 4)], ws[lane + LANES * (WANTED + 5)] = sigma[4], sigma[5]
