"""Energy, stress and local solve of the block constraint for small strain; rows as in `block`."""

from .block import answer, bending_energy, hoist, hourglass, node_softness, of_lane, residual, shape, write_row
from .block_rows import BOUND, ENERGY, LAM, MU, RATIO, SOFTNESS, STRESS, VOLUME, WANTED, G
from .lanes import LANES, batch_kernel, lane_kernel
from .neo_hookean import cofactors


@lane_kernel
def _stress(k, f):
    """sigma = mu (F + F^T - 2 I) + lambda tr(F - I) I: xx yy zz yz xz xy."""
    mu = k[MU]
    bulk = k[LAM] * (f[0] + f[4] + f[8] - 3.0) - 2.0 * mu
    return (
        2.0 * mu * f[0] + bulk,
        2.0 * mu * f[4] + bulk,
        2.0 * mu * f[8] + bulk,
        mu * (f[5] + f[7]),
        mu * (f[2] + f[6]),
        mu * (f[1] + f[3]),
    )


@lane_kernel
def _rows(k, f, q, V):
    """The three rows of P = V sigma and T = V K q (7 values each)."""
    xx, yy, zz, yz, xz, xy = _stress(k, f)
    t = hourglass(k, q)
    return (
        (V * xx, V * xy, V * xz, V * t[0], V * t[3], V * t[6], V * t[9]),
        (V * xy, V * yy, V * yz, V * t[1], V * t[4], V * t[7], V * t[10]),
        (V * xz, V * yz, V * zz, V * t[2], V * t[5], V * t[8], V * t[11]),
    )


@batch_kernel
def project_lanes_linear(ws, constants, kappa, hh):
    """Solve four blocks once.

    P is linear, so dL_P solves (1 + V C G) dL_P = R exactly: 2 x 2 for shear, worker one for the trace.
    """
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        V, g = ws[lane + LANES * VOLUME], kappa * hh * ws[lane + LANES * SOFTNESS]
        at = lane + LANES * STRESS
        f, q = shape(ws, lane, k)
        w0, w1, w2 = _rows(k, f, q, V)
        r0, r1, r2 = residual(ws, at, 0, w0), residual(ws, at, 1, w1), residual(ws, at, 2, w2)
        mu, bulk = V * k[MU], V * k[LAM]
        g0, g1, g2 = g * k[G], g * k[G + 1], g * k[G + 2]
        d0, d1, d2 = 1.0 / (1.0 + 2.0 * mu * g0), 1.0 / (1.0 + 2.0 * mu * g1), 1.0 / (1.0 + 2.0 * mu * g2)
        z = bulk * (g0 * d0 * r0[0] + g1 * d1 * r1[1] + g2 * d2 * r2[2])
        z = z / (1.0 + bulk * (g0 * d0 + g1 * d1 + g2 * d2))
        z01 = mu * (g1 * r0[1] + g0 * r1[0]) / (1.0 + mu * (g0 + g1))
        z02 = mu * (g2 * r0[2] + g0 * r2[0]) / (1.0 + mu * (g0 + g2))
        z12 = mu * (g2 * r1[2] + g1 * r2[1]) / (1.0 + mu * (g1 + g2))
        g = g * V
        n0, n1 = 1.0 / (1.0 + g * k[BOUND]), 1.0 / (1.0 + g * k[BOUND + 1])
        n2, n3 = 1.0 / (1.0 + g * k[BOUND + 2]), 1.0 / (1.0 + g * k[BOUND + 3])
        move = node_softness(ws, lane, hh)
        p = d0 * (r0[0] - z), r0[1] - z01, r0[2] - z02
        answer(ws, lane, ws, at, 0, k, move, (p[0], p[1], p[2], n0 * r0[3], n1 * r0[4], n2 * r0[5], n3 * r0[6]))
        p = r1[0] - z01, d1 * (r1[1] - z), r1[2] - z12
        answer(ws, lane, ws, at, 1, k, move, (p[0], p[1], p[2], n0 * r1[3], n1 * r1[4], n2 * r1[5], n3 * r1[6]))
        p = r2[0] - z02, r2[1] - z12, d2 * (r2[2] - z)
        answer(ws, lane, ws, at, 2, k, move, (p[0], p[1], p[2], n0 * r2[3], n1 * r2[4], n2 * r2[5], n3 * r2[6]))


@batch_kernel
def stress_lanes_linear(ws, constants):
    """Rows WANTED of four blocks: P and T that their shapes ask for."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, q = shape(ws, lane, k)
        w0, w1, w2 = _rows(k, f, q, ws[lane + LANES * VOLUME])
        write_row(ws, lane, WANTED, 0, w0)
        write_row(ws, lane, WANTED, 1, w1)
        write_row(ws, lane, WANTED, 2, w2)


@batch_kernel
def energy_lanes_linear(ws, constants):
    """Rows RATIO, ENERGY of four blocks: J and U = V (mu e:e + lambda/2 tr(e)^2 + 1/2 q^T K q)."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, q = shape(ws, lane, k)
        _, J = cofactors(f)
        xx, yy, zz = f[0] - 1.0, f[4] - 1.0, f[8] - 1.0
        yz, xz, xy = f[5] + f[7], f[2] + f[6], f[1] + f[3]
        trace = xx + yy + zz
        shear = xx * xx + yy * yy + zz * zz + 0.5 * (yz * yz + xz * xz + xy * xy)
        energy = k[MU] * shear + 0.5 * k[LAM] * trace * trace + bending_energy(k, q)
        ws[lane + LANES * RATIO] = J
        ws[lane + LANES * ENERGY] = ws[lane + LANES * VOLUME] * energy


@batch_kernel
def cauchy_lanes_linear(ws, constants):
    """The first six rows of WANTED: the stress at the centres of four blocks, xx yy zz yz xz xy [Pa]."""
    hoisted = hoist(ws, constants)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, _ = shape(ws, lane, k)
        xx, yy, zz, yz, xz, xy = _stress(k, f)
        ws[lane + LANES * WANTED] = xx
        ws[lane + LANES * (WANTED + 1)] = yy
        ws[lane + LANES * (WANTED + 2)] = zz
        ws[lane + LANES * (WANTED + 3)] = yz
        ws[lane + LANES * (WANTED + 4)] = xz
        ws[lane + LANES * (WANTED + 5)] = xy
