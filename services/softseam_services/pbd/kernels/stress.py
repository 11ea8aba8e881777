"""Cauchy stress of each octant for read-out."""

from __future__ import annotations

from numba import njit

from .block import WANTED, gather
from .lanes import LANES
from .linear import cauchy_lanes_linear
from .neo_hookean import cauchy_lanes


@njit(cache=True, error_model="numpy")
def octant_stress(ws, xw, nodes, octant, constants, linear, cauchy):
    """Stress at the blocks' centres.

    octant  (b, LANES)  8 cell + octant, -1 for padding
    cauchy  (c, 8, 6)   xx yy zz yz xz xy [Pa], updated in place
    """
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        if linear:
            cauchy_lanes_linear(ws, constants)
        else:
            cauchy_lanes(ws, constants)
        for lane in range(LANES):
            place = octant[batch, lane]
            if place >= 0:
                for entry in range(6):
                    cauchy[place // 8, place % 8, entry] = ws[LANES * (WANTED + entry) + lane]
