"""Gauss-Seidel over all blocks, batch after batch; and the exact stress and energy of the same blocks."""

import numpy as np

from softseam_services.body.materials.point import LINEAR, NEO_HOOKEAN, RELAXING
from softseam_services.jit import njit

from .block import gather, hoist, load_stress, new_workspace, of_batch, of_lane, read_row, scatter, spread, store_stress
from .block_rows import ENERGY, RATIO, SOFTNESS, STRESS, VOLUME, WANTED
from .general import project_lanes_general, remember_lanes
from .lanes import LANES, move_four
from .laws import write_energy, write_stress
from .linear import project_lanes_linear
from .neo_hookean import project_lanes
from .relaxing import bring_fold, sweep_relaxing

__all__ = ["batch_energies", "block_forces", "exact_stress", "new_workspace", "strain_energy", "sweep"]


@njit(cache=True, error_model="numpy")
def sweep(ws, xw, nodes, volume, softness, stress, constants, law, kappa, h, first, end):
    """Project the blocks of the batches first .. end - 1 once, one batch after the other.

    ws        (ROWS * LANES,)  workspace
    xw        (n + 8, 4)       positions [m], updated in place, and inverse masses [1/kg]
    nodes     (b, 8, LANES)    batch, node, lane
    volume    (b, LANES)       fill times volume [m^3]
    softness  (b, LANES)       8 times the largest inverse mass of a block's nodes [1/kg]
    stress    (b, N_STRESS)    Lambda, row by row of LANES lanes, updated in place
    constants                  `block.Constants`
    law                        number of the materials' kind in `body.materials.point`
    kappa, h                   under-relaxation of the local compliance [1], substep [s]
    """
    hh = h * h
    if law == RELAXING:
        sweep_relaxing(ws, xw, nodes, volume, softness, stress, constants, kappa, hh, first, end)
        return
    for batch in range(first, end):
        gather(ws, xw, nodes, batch)
        load_stress(ws, stress, batch)
        move_four(ws, LANES * SOFTNESS, softness, LANES * batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        k = of_batch(constants, batch)
        if law == NEO_HOOKEAN:
            project_lanes(ws, k, kappa, hh)
        elif law == LINEAR:
            project_lanes_linear(ws, k, kappa, hh)
        else:
            project_lanes_general(ws, k, law, kappa, hh)
        store_stress(ws, STRESS, stress, batch)
        scatter(ws, xw, nodes, batch)


@njit(cache=True, error_model="numpy")
def exact_stress(ws, xw, nodes, volume, stress, constants, law):
    """Lambda = (P, T) of the shape that each block has now; stress (b, N_STRESS) updated in place."""
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        bring_fold(ws, constants, batch)
        write_stress(ws, of_batch(constants, batch), law)
        store_stress(ws, WANTED, stress, batch)


@njit(cache=True, error_model="numpy")
def block_forces(ws, nodes, stress, constants, force, first, end):
    """Add f_i = -(P b_i + sum_m h_mi T_m) of the blocks of batches first .. end - 1 to force (n + 8, 4) [N].

    The fourth column is not used.
    """
    one = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    for batch in range(first, end):
        gather(ws, force, nodes, batch)
        load_stress(ws, stress, batch)
        hoisted = hoist(ws, of_batch(constants, batch))
        for lane in range(LANES):
            k = of_lane(ws, lane, hoisted)
            spread(ws, lane, 0, k, one, read_row(ws, lane, STRESS, 0))
            spread(ws, lane, 1, k, one, read_row(ws, lane, STRESS, 1))
            spread(ws, lane, 2, k, one, read_row(ws, lane, STRESS, 2))
        scatter(ws, force, nodes, batch)


@njit(cache=True, error_model="numpy")
def batch_energies(ws, xw, nodes, volume, constants, law, first, end, energies):
    """U = sum V (psi(F) + 1/2 q^T K q) [J] of each batch first .. end - 1 and its least J, into energies (b, 2).

    Empty blocks do not count.
    """
    for batch in range(first, end):
        gather(ws, xw, nodes, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        bring_fold(ws, constants, batch)
        write_energy(ws, of_batch(constants, batch), law)
        total, least = 0.0, np.inf
        for lane in range(LANES):
            if volume[batch, lane] > 0.0:
                total += ws[LANES * ENERGY + lane]
                least = min(least, ws[LANES * RATIO + lane])
        energies[batch, 0], energies[batch, 1] = total, least


@njit(cache=True, error_model="numpy")
def strain_energy(energies):
    """Energy of all blocks [J] and their least J, from the batches' energies (b, 2): a sum in their order."""
    total, least = 0.0, np.inf
    for batch in range(len(energies)):
        total += energies[batch, 0]
        least = min(least, energies[batch, 1])
    return total, least


@njit(cache=True, error_model="numpy")
def remember(ws, xw, nodes, volume, constants, law, first, end):
    """What the blocks of batches first .. end - 1 remember once a step is solved, see `memory`."""
    for batch in range(first, end):
        gather(ws, xw, nodes, batch)
        k = of_batch(constants, batch)
        remember_lanes(ws, k, law, volume[batch])
