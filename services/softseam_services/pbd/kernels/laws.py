"""Stress and energy by the material's law: of the blocks in a workspace, and of octants and cells for read-out."""

from softseam_services.body.materials.point import LINEAR, NEO_HOOKEAN, RELAXING
from softseam_services.jit import njit

from .block import gather, of_batch
from .block_rows import ENERGY, VOLUME, WANTED
from .general import cauchy_lanes_general, energy_lanes_general, stress_lanes_general
from .lanes import LANES, move_four
from .linear import cauchy_lanes_linear, energy_lanes_linear, stress_lanes_linear
from .neo_hookean import cauchy_lanes, energy_lanes, stress_lanes
from .relaxing import bring_fold, cauchy_lanes_relaxing, energy_lanes_relaxing, stress_lanes_relaxing


@njit(cache=True, error_model="numpy")
def write_stress(ws, constants, law):
    """Lambda = (P, T) of the shape that each block has, into the rows WANTED; after `bring_fold`."""
    if law == NEO_HOOKEAN:
        stress_lanes(ws, constants)
    elif law == LINEAR:
        stress_lanes_linear(ws, constants)
    elif law == RELAXING:
        stress_lanes_relaxing(ws, constants)
    else:
        stress_lanes_general(ws, constants, law)


@njit(cache=True, error_model="numpy")
def write_energy(ws, constants, law):
    """Energy [J] and volume ratio of each block, into the rows ENERGY and RATIO; after `bring_fold`."""
    if law == NEO_HOOKEAN:
        energy_lanes(ws, constants)
    elif law == LINEAR:
        energy_lanes_linear(ws, constants)
    elif law == RELAXING:
        energy_lanes_relaxing(ws, constants)
    else:
        energy_lanes_general(ws, constants, law)


@njit(cache=True, error_model="numpy")
def octant_stress(ws, xw, nodes, octant, constants, law, cauchy):
    """Stress at the blocks' centres.

    octant  (b, LANES)  8 cell + octant, -1 for padding
    cauchy  (c, 8, 6)   xx yy zz yz xz xy [Pa], updated in place
    """
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        bring_fold(ws, constants, batch)
        k = of_batch(constants, batch)
        if law == NEO_HOOKEAN:
            cauchy_lanes(ws, k)
        elif law == LINEAR:
            cauchy_lanes_linear(ws, k)
        elif law == RELAXING:
            cauchy_lanes_relaxing(ws, k)
        else:
            cauchy_lanes_general(ws, k, law)
        for lane in range(LANES):
            place = octant[batch, lane]
            if place >= 0:
                for entry in range(6):
                    cauchy[place // 8, place % 8, entry] = ws[LANES * (WANTED + entry) + lane]


@njit(cache=True, error_model="numpy")
def cell_energies(ws, xw, nodes, volume, octant, constants, law, energy):
    """V (psi(F) + 1/2 q^T K q) of the blocks of each cell.

    volume  (b, LANES)  fill times volume [m^3]
    octant  (b, LANES)  8 cell + octant, -1 for padding
    energy  (c,)        [J], updated in place
    """
    energy[:] = 0.0
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        bring_fold(ws, constants, batch)
        write_energy(ws, of_batch(constants, batch), law)
        for lane in range(LANES):
            if octant[batch, lane] >= 0:
                energy[octant[batch, lane] // 8] += ws[LANES * ENERGY + lane]
