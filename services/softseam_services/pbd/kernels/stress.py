"""Cauchy stress of each octant for read-out."""

from __future__ import annotations

from numba import njit

from .block import ROWS, shape_lanes
from .neo_hookean import volumetric_lanes
from .sweep import gather


@njit(cache=True, error_model="numpy")
def octant_stress(ws, xw, nodes, octant, constants, linear, cauchy):
    """sigma = mu/J F F^T + s I at the block's centre, or mu (F + F^T - 2 I) + lambda tr(F - I) I for small strain.

    octant  (b, 8)     8 cell + octant, -1 for padding
    cauchy  (c, 8, 6)  xx yy zz yz xz xy [Pa], updated in place
    """
    mu, lam = constants[0], constants[1]
    first = (0, 1, 2, 1, 0, 0)
    second = (0, 1, 2, 2, 2, 1)
    for batch in range(len(nodes)):
        gather(ws, xw, nodes, batch)
        shape_lanes(ws, constants)
        if not linear:
            volumetric_lanes(ws, constants)
        for lane in range(len(ws) // ROWS):
            if octant[batch, lane] < 0:
                continue
            out = cauchy[octant[batch, lane] // 8, octant[batch, lane] % 8]
            trace = ws[464 + lane] + ws[496 + lane] + ws[528 + lane] - 3.0
            for entry in range(6):
                a, b = first[entry], second[entry]
                delta = 1.0 if a == b else 0.0
                if linear:
                    f = ws[464 + 24 * a + 8 * b + lane] + ws[464 + 24 * b + 8 * a + lane]
                    out[entry] = mu * (f - 2.0 * delta) + lam * trace * delta
                else:
                    square = 0.0
                    for c in range(3):
                        square += ws[464 + 24 * a + 8 * c + lane] * ws[464 + 24 * b + 8 * c + lane]
                    out[entry] = mu * square / ws[440 + lane] + ws[448 + lane] * delta
