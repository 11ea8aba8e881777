"""Strain energy of each cell for read-out."""

from softseam_services.jit import njit

from .block import gather, of_batch
from .block_rows import ENERGY, VOLUME
from .lanes import LANES, move_four
from .laws import write_energy


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
        write_energy(ws, of_batch(constants, batch), law)
        for lane in range(LANES):
            if octant[batch, lane] >= 0:
                energy[octant[batch, lane] // 8] += ws[LANES * ENERGY + lane]
