"""Gauss-Seidel over all blocks, batch after batch; and the exact stress and energy of the same blocks."""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.body.materials.point import LINEAR, NEO_HOOKEAN

from .block import (
    ENERGY,
    RATIO,
    SOFTNESS,
    STRESS,
    VOLUME,
    WANTED,
    gather,
    hoist,
    load_stress,
    new_workspace,
    read_row,
    scatter,
    spread,
    store_stress,
)
from .general import energy_lanes_general, project_lanes_general, stress_lanes_general
from .lanes import LANES, move_four
from .linear import energy_lanes_linear, project_lanes_linear, stress_lanes_linear
from .neo_hookean import energy_lanes, project_lanes, stress_lanes

__all__ = ["block_forces", "exact_stress", "new_workspace", "strain_energy", "sweep"]


@njit(cache=True, error_model="numpy")
def sweep(ws, xw, nodes, volume, softness, stress, constants, law, kappa, h):
    """Project every block once, colour after colour.

    ws        (ROWS * LANES,)  workspace
    xw        (n + 8, 4)       positions [m], updated in place, and inverse masses [1/kg]
    nodes     (b, 8, LANES)    batch, node, lane
    volume    (b, LANES)       fill times volume [m^3]
    softness  (b, LANES)       8 times the largest inverse mass of a block's nodes [1/kg]
    stress    (b, N_STRESS)    Lambda, row by row of LANES lanes, updated in place
    law                        number of the material in `body.materials.point`
    kappa, h                   under-relaxation of the local compliance [1], substep [s]
    """
    hh = h * h
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        load_stress(ws, stress, batch)
        move_four(ws, LANES * SOFTNESS, softness, LANES * batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        if law == NEO_HOOKEAN:
            project_lanes(ws, constants, kappa, hh)
        elif law == LINEAR:
            project_lanes_linear(ws, constants, kappa, hh)
        else:
            project_lanes_general(ws, constants, law, kappa, hh)
        store_stress(ws, STRESS, stress, batch)
        scatter(ws, xw, nodes, batch)


@njit(cache=True, error_model="numpy")
def exact_stress(ws, xw, nodes, volume, stress, constants, law):
    """Lambda = (P, T) of the shape that each block has now; stress (b, N_STRESS) updated in place."""
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        if law == NEO_HOOKEAN:
            stress_lanes(ws, constants)
        elif law == LINEAR:
            stress_lanes_linear(ws, constants)
        else:
            stress_lanes_general(ws, constants, law)
        store_stress(ws, WANTED, stress, batch)


@njit(cache=True, error_model="numpy")
def block_forces(ws, nodes, stress, constants, force):
    """Add f_i = -(P b_i + sum_m h_mi T_m) of every block to force (n + 8, 4) [N]; the fourth column is not used."""
    k = hoist(constants)
    one = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    for batch in range(len(nodes)):
        gather(ws, force, nodes, batch)
        load_stress(ws, stress, batch)
        for lane in range(LANES):
            spread(ws, lane, 0, k, one, read_row(ws, lane, STRESS, 0))
            spread(ws, lane, 1, k, one, read_row(ws, lane, STRESS, 1))
            spread(ws, lane, 2, k, one, read_row(ws, lane, STRESS, 2))
        scatter(ws, force, nodes, batch)


@njit(cache=True, error_model="numpy")
def strain_energy(ws, xw, nodes, volume, constants, law):
    """U = sum V (psi(F) + 1/2 q^T K q) over all blocks [J], and the least J of those that are not empty."""
    total = 0.0
    least = np.inf
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        if law == NEO_HOOKEAN:
            energy_lanes(ws, constants)
        elif law == LINEAR:
            energy_lanes_linear(ws, constants)
        else:
            energy_lanes_general(ws, constants, law)
        for lane in range(LANES):
            if volume[batch, lane] > 0.0:
                total += ws[LANES * ENERGY + lane]
                least = min(least, ws[LANES * RATIO + lane])
    return total, least
