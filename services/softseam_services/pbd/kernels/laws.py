"""The stress and the energy of the blocks in a workspace, by the material's law."""

from softseam_services.body.materials.point import LINEAR, NEO_HOOKEAN
from softseam_services.jit import njit

from .general import energy_lanes_general, stress_lanes_general
from .linear import energy_lanes_linear, stress_lanes_linear
from .neo_hookean import energy_lanes, stress_lanes


@njit(cache=True, error_model="numpy")
def write_stress(ws, constants, law):
    """Lambda = (P, T) of the shape that each block has, into the rows WANTED."""
    if law == NEO_HOOKEAN:
        stress_lanes(ws, constants)
    elif law == LINEAR:
        stress_lanes_linear(ws, constants)
    else:
        stress_lanes_general(ws, constants, law)


@njit(cache=True, error_model="numpy")
def write_energy(ws, constants, law):
    """Energy [J] and volume ratio of each block, into the rows ENERGY and RATIO."""
    if law == NEO_HOOKEAN:
        energy_lanes(ws, constants)
    elif law == LINEAR:
        energy_lanes_linear(ws, constants)
    else:
        energy_lanes_general(ws, constants, law)
