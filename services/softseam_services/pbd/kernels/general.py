"""Energy, stress and local solve of the block constraint for any material of `materials.point`; rows as in `block`.

U = V (psi(F) + 1/2 q^T K q) with F^T q_m for q_m, P = V (dpsi/dF + sum_m q_m t_m^T)                           (1)
Local solve with the material's positive semi-definite tangent A in place of eq. (4) of `block`: as dF = -dL_P diag(G),
(1 + V A diag(G)) dL_P = R;  with S = diag(G)^(1/2):  (1 + V S A S) y = S R,  dL_P = R - V A S y               (2)
a symmetric, positive definite system of nine. Exact where `block`'s is an estimate, and some fifty times as dear.
Blocks of a material with internal state have psi and P of their law's `respond`, see `memory`; its A counts as it is.
"""

import numpy as np

from softseam_services.body.materials import point
from softseam_services.jit import njit

from .block import (
    answer,
    bending_energy,
    hoist,
    hourglass,
    node_softness,
    of_lane,
    parameters_of,
    residual,
    shape,
    write_row,
)
from .block_rows import BOUND, ENERGY, RATIO, SOFTNESS, STRESS, VOLUME, WANTED, G
from .lanes import LANES, lane_kernel, rare_kernel
from .memory import follow, remembers, respond, small
from .neo_hookean import cofactors, stress_row, turned_back


@lane_kernel
def fill(f, F):
    """F (3, 3) <- its nine values."""
    F[0, 0], F[0, 1], F[0, 2] = f[0], f[1], f[2]
    F[1, 0], F[1, 1], F[1, 2] = f[3], f[4], f[5]
    F[2, 0], F[2, 1], F[2, 2] = f[6], f[7], f[8]


@lane_kernel
def _nine(P):
    """The values of P (3, 3), row by row."""
    return P[0, 0], P[0, 1], P[0, 2], P[1, 0], P[1, 1], P[1, 2], P[2, 0], P[2, 1], P[2, 2]


@njit(cache=True, error_model="numpy")
def to_cauchy(F, P, small, sigma):
    """sigma (3, 3) <- P F^T/J, of small strains P [Pa]."""
    J = F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]) + F[0, 1] * (F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2])
    J += F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    for i in range(3):
        for j in range(3):
            sigma[i, j] = P[i, j] if small else (P[i, 0] * F[j, 0] + P[i, 1] * F[j, 1] + P[i, 2] * F[j, 2]) / J


@njit(cache=True, error_model="numpy")
def solve_nine(A, root, volume, r, M, y):
    """r (9,) <- dL_P of eq. (2), by Cholesky; root (3,) is G^(1/2); M (9, 9) and y (9,) are overwritten."""
    for i in range(9):
        for j in range(i + 1):
            M[i, j] = volume * root[i % 3] * A[i, j] * root[j % 3]
        M[i, i] += 1.0
        y[i] = root[i % 3] * r[i]
    for j in range(9):
        for k in range(j):
            M[j, j] -= M[j, k] * M[j, k]
        M[j, j] = np.sqrt(M[j, j])
        for i in range(j + 1, 9):
            for k in range(j):
                M[i, j] -= M[i, k] * M[j, k]
            M[i, j] /= M[j, j]
    for i in range(9):
        for k in range(i):
            y[i] -= M[i, k] * y[k]
        y[i] /= M[i, i]
    for i in range(8, -1, -1):
        for k in range(i + 1, 9):
            y[i] -= M[k, i] * y[k]
        y[i] /= M[i, i]
    for i in range(9):
        for j in range(9):
            r[i] -= volume * A[i, j] * root[j % 3] * y[j]


@rare_kernel
def project_lanes_general(ws, constants, law, kappa, hh):
    """Solve four blocks once: Lambda += dLambda of eq. (2) and of `block`'s eq. (5), and their nodes move."""
    hoisted = hoist(ws, constants)
    parameters = parameters_of(constants)
    F, P, A, M = np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9)), np.empty((9, 9))
    root, r, y = np.empty(3), np.empty(9), np.empty(9)
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        V, g = ws[lane + LANES * VOLUME], kappa * hh * ws[lane + LANES * SOFTNESS]
        at = lane + LANES * STRESS
        f, q = shape(ws, lane, k)
        fill(f, F)
        if remembers(constants):
            respond(constants, law, lane, parameters, F, P, A)
        else:
            point.stress(law, parameters, F, P)
        p = _nine(P)
        t = hourglass(k, turned_back(f, q))
        r0 = residual(ws, at, 0, stress_row(0, f, p, q, t, 0.0, 1.0, V))
        r1 = residual(ws, at, 1, stress_row(1, f, p, q, t, 0.0, 1.0, V))
        r2 = residual(ws, at, 2, stress_row(2, f, p, q, t, 0.0, 1.0, V))
        r[0], r[1], r[2] = r0[0], r0[1], r0[2]
        r[3], r[4], r[5] = r1[0], r1[1], r1[2]
        r[6], r[7], r[8] = r2[0], r2[1], r2[2]
        root[0], root[1], root[2] = np.sqrt(g * k[G]), np.sqrt(g * k[G + 1]), np.sqrt(g * k[G + 2])
        if not remembers(constants):
            point.tangent(law, parameters, F, A, True)
        solve_nine(A, root, V, r, M, y)
        square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] + f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
        square += f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
        g = g * V * max(1.0, square * (1.0 / 3.0))
        n0, n1 = 1.0 / (1.0 + g * k[BOUND]), 1.0 / (1.0 + g * k[BOUND + 1])
        n2, n3 = 1.0 / (1.0 + g * k[BOUND + 2]), 1.0 / (1.0 + g * k[BOUND + 3])
        move = node_softness(ws, lane, hh)
        answer(ws, lane, ws, at, 0, k, move, (r[0], r[1], r[2], n0 * r0[3], n1 * r0[4], n2 * r0[5], n3 * r0[6]))
        answer(ws, lane, ws, at, 1, k, move, (r[3], r[4], r[5], n0 * r1[3], n1 * r1[4], n2 * r1[5], n3 * r1[6]))
        answer(ws, lane, ws, at, 2, k, move, (r[6], r[7], r[8], n0 * r2[3], n1 * r2[4], n2 * r2[5], n3 * r2[6]))


@rare_kernel
def stress_lanes_general(ws, constants, law):
    """Rows WANTED of four blocks: P and T that their shapes ask for, eq. (1)."""
    hoisted = hoist(ws, constants)
    parameters = parameters_of(constants)
    F, P = np.empty((3, 3)), np.empty((3, 3))
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        V = ws[lane + LANES * VOLUME]
        f, q = shape(ws, lane, k)
        fill(f, F)
        if remembers(constants):
            respond(constants, law, lane, parameters, F, P, np.empty((9, 9)))
        else:
            point.stress(law, parameters, F, P)
        p = _nine(P)
        t = hourglass(k, turned_back(f, q))
        write_row(ws, lane, WANTED, 0, stress_row(0, f, p, q, t, 0.0, 1.0, V))
        write_row(ws, lane, WANTED, 1, stress_row(1, f, p, q, t, 0.0, 1.0, V))
        write_row(ws, lane, WANTED, 2, stress_row(2, f, p, q, t, 0.0, 1.0, V))


@rare_kernel
def energy_lanes_general(ws, constants, law):
    """Rows RATIO, ENERGY of four blocks: J and U, eq. (1)."""
    hoisted = hoist(ws, constants)
    parameters = parameters_of(constants)
    F = np.empty((3, 3))
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, q = shape(ws, lane, k)
        fill(f, F)
        if remembers(constants):
            density = respond(constants, law, lane, parameters, F, np.empty((3, 3)), np.empty((9, 9)))
        else:
            density = point.energy(law, parameters, F)
        energy = density + bending_energy(k, turned_back(f, q))
        ws[lane + LANES * RATIO] = cofactors(f)[1]
        ws[lane + LANES * ENERGY] = ws[lane + LANES * VOLUME] * energy


@rare_kernel
def cauchy_lanes_general(ws, constants, law):
    """The first six rows of WANTED: the Cauchy stress at the centres of four blocks, xx yy zz yz xz xy [Pa]."""
    hoisted = hoist(ws, constants)
    parameters = parameters_of(constants)
    F, P, sigma = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for lane in range(LANES):
        k = of_lane(ws, lane, hoisted)
        f, _ = shape(ws, lane, k)
        fill(f, F)
        if remembers(constants):
            respond(constants, law, lane, parameters, F, P, np.empty((9, 9)))
            to_cauchy(F, P, small(constants, lane), sigma)
        else:
            point.cauchy(law, parameters, F, sigma)
        ws[lane + LANES * WANTED] = sigma[0, 0]
        ws[lane + LANES * (WANTED + 1)] = sigma[1, 1]
        ws[lane + LANES * (WANTED + 2)] = sigma[2, 2]
        ws[lane + LANES * (WANTED + 3)] = sigma[1, 2]
        ws[lane + LANES * (WANTED + 4)] = sigma[0, 2]
        ws[lane + LANES * (WANTED + 5)] = sigma[0, 1]


@rare_kernel
def remember_lanes(ws, constants, law, volume):
    """What four blocks of these volumes (LANES,) remember once a step is solved, in their constants."""
    hoisted = hoist(ws, constants)
    parameters = parameters_of(constants)
    F = np.empty((3, 3))
    for lane in range(LANES):
        f, _ = shape(ws, lane, of_lane(ws, lane, hoisted))
        fill(f, F)
        follow(constants, law, lane, parameters, F, volume[lane])
