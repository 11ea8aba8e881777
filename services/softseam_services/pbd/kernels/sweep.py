"""Gauss-Seidel over all blocks, batch after batch; and the exact stress and energy of the same blocks."""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.body.materials.neo_hookean import volumetric

from .block import LAM, MU, ROWS, hourglass, move_lanes, shape_lanes
from .linear import solve_lanes_linear, stress_lanes_linear
from .neo_hookean import solve_lanes, stress_lanes, volumetric_lanes


@njit(cache=True, error_model="numpy", inline="always")
def gather(ws, xw, nodes, batch):
    for node in range(8):
        for lane in range(8):
            i = nodes[batch, node, lane]
            ws[24 * node + lane] = xw[i, 0]
            ws[24 * node + 8 + lane] = xw[i, 1]
            ws[24 * node + 16 + lane] = xw[i, 2]
            ws[192 + 8 * node + lane] = xw[i, 3]


@njit(cache=True, error_model="numpy")
def sweep(ws, xw, nodes, volume, softness, stress, constants, linear, kappa, h):
    """Project every block once, colour after colour.

    ws        (ROWS * 8,)     workspace
    xw        (n + 8, 4)      positions [m], updated in place, and inverse masses [1/kg]
    nodes     (b, 8, 8)       batch, node, lane
    volume    (b, 8)          fill times volume [m^3]
    softness  (b, 8)          8 times the largest inverse mass of a block's nodes [1/kg]
    stress    (b, 168)        Lambda, row by row of 8 lanes, updated in place
    kappa, h                  under-relaxation of the local compliance [1], substep [s]
    """
    hh = h * h
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        for entry in range(64):
            ws[192 + entry] *= hh
        for entry in range(168):
            ws[256 + entry] = stress[batch, entry]
        for lane in range(8):
            ws[424 + lane] = kappa * hh * softness[batch, lane]
            ws[432 + lane] = volume[batch, lane]
        shape_lanes(ws, constants)
        if linear:
            stress_lanes_linear(ws, constants)
            solve_lanes_linear(ws, constants)
        else:
            volumetric_lanes(ws, constants)
            stress_lanes(ws, constants)
            solve_lanes(ws, constants)
        move_lanes(ws, constants)
        for entry in range(168):
            stress[batch, entry] = ws[256 + entry]
        for node in range(8):
            for lane in range(8):
                i = nodes[batch, node, lane]
                xw[i, 0] = ws[24 * node + lane]
                xw[i, 1] = ws[24 * node + 8 + lane]
                xw[i, 2] = ws[24 * node + 16 + lane]


@njit(cache=True, error_model="numpy")
def exact_stress(ws, xw, nodes, volume, stress, constants, linear):
    """Lambda = (P, T) of the shape that each block has now; stress (b, 168) updated in place."""
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        for lane in range(8):
            ws[432 + lane] = volume[batch, lane]
        shape_lanes(ws, constants)
        if linear:
            stress_lanes_linear(ws, constants)
        else:
            volumetric_lanes(ws, constants)
            stress_lanes(ws, constants)
        for entry in range(168):
            stress[batch, entry] = ws[632 + entry]


@njit(cache=True, error_model="numpy")
def block_forces(nodes, stress, constants, force):
    """Add f_i = -(P b_i + sum_m h_mi T_m/8) of every block to force (n + 8, 3) [N]."""
    for batch in range(len(nodes)):
        for node in range(8):
            xi = 1.0 if node & 1 else -1.0
            eta = 1.0 if node & 2 else -1.0
            zeta = 1.0 if node & 4 else -1.0
            for lane in range(8):
                i = nodes[batch, node, lane]
                for a in range(3):
                    p, t = 24 * a + lane, 72 + 8 * a + lane
                    force[i, a] -= (
                        xi * constants[2] * stress[batch, p]
                        + eta * constants[3] * stress[batch, p + 8]
                        + zeta * constants[4] * stress[batch, p + 16]
                        + 0.125
                        * (
                            eta * zeta * stress[batch, t]
                            + xi * zeta * stress[batch, t + 24]
                            + xi * eta * stress[batch, t + 48]
                            + xi * eta * zeta * stress[batch, t + 72]
                        )
                    )


@njit(cache=True, error_model="numpy")
def strain_energy(ws, xw, nodes, volume, constants, linear):
    """U = sum V psi(F) + 1/2 q^T K q over all blocks [J], and the least J."""
    total = 0.0
    least = np.inf
    F = np.empty((3, 3))
    q = np.empty(12)
    mu, lam = constants[MU], constants[LAM]
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        shape_lanes(ws, constants)
        for lane in range(8):
            V = volume[batch, lane]
            if V == 0.0:
                continue
            square = 0.0
            shear = 0.0
            for a in range(3):
                for b in range(3):
                    F[a, b] = ws[464 + 24 * a + 8 * b + lane]
                    square += F[a, b] * F[a, b]
            for a in range(3):
                for b in range(3):
                    e = 0.5 * (F[a, b] + F[b, a]) - (1.0 if a == b else 0.0)
                    shear += e * e
            J = ws[440 + lane]
            least = min(least, J)
            for m in range(4):
                for c in range(3):
                    if linear:
                        q[3 * m + c] = ws[536 + 24 * m + 8 * c + lane]
                    else:
                        q[3 * m + c] = (
                            F[0, c] * ws[536 + 24 * m + lane]
                            + F[1, c] * ws[544 + 24 * m + lane]
                            + F[2, c] * ws[552 + 24 * m + lane]
                        )
            t = hourglass(
                constants,
                (q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], q[8], q[9], q[10], q[11]),
                V,
            )
            if linear:
                trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
                total += V * (mu * shear + 0.5 * lam * trace * trace)
            else:
                total += V * (0.5 * mu * (square - 3.0) + volumetric(J, mu, lam)[0])
            for entry in range(12):
                total += 0.5 * q[entry] * t[entry]
    return total, least


@njit(cache=True, error_model="numpy")
def new_workspace():
    """Workspace of the block kernels (ROWS * 8,)."""
    return np.zeros(ROWS * 8)
