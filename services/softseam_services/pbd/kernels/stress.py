"""Cauchy stress of each octant for read-out."""

from softseam_services.body.materials.point import LINEAR, NEO_HOOKEAN
from softseam_services.jit import njit

from .block import gather, of_batch
from .block_rows import WANTED
from .general import cauchy_lanes_general
from .lanes import LANES
from .linear import cauchy_lanes_linear
from .neo_hookean import cauchy_lanes


@njit(cache=True, error_model="numpy")
def octant_stress(ws, xw, nodes, octant, constants, law, cauchy):
    """Stress at the blocks' centres.

    octant  (b, LANES)  8 cell + octant, -1 for padding
    cauchy  (c, 8, 6)   xx yy zz yz xz xy [Pa], updated in place
    """
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        k = of_batch(constants, batch)
        if law == NEO_HOOKEAN:
            cauchy_lanes(ws, k)
        elif law == LINEAR:
            cauchy_lanes_linear(ws, k)
        else:
            cauchy_lanes_general(ws, k, law)
        for lane in range(LANES):
            place = octant[batch, lane]
            if place >= 0:
                for entry in range(6):
                    cauchy[place // 8, place % 8, entry] = ws[LANES * (WANTED + entry) + lane]
