"""Tables of the quadratic hexahedron with split quadrature on box cells of equal edges.

The constant part mu/2 I1 is integrated with 3^3 Gauss points on a full cell, everything else with 2^3, one point an
octant. On a partly filled cell the 2^3 points carry their octant's fill f_q, and the difference of the two rules, which
is positive semi-definite and vanishes on linear fields, its mean:
  L_ab = sum_q f_q V/8 mu grad N_a . grad N_b + mean(f) mu S_ab,  S = int_{3^3} - int_{2^3} grad N_a . grad N_b     (1)
so a rest state is free of stress whatever the fill, and a full cell has exactly the 3^3 rule.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.interpolate import hex27

_TWO = np.array([-1.0, 1.0]) / np.sqrt(3.0)
_THREE = (np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6), np.array([5.0, 8.0, 5.0]) / 9.0)


class CellTables(NamedTuple):
    gradient: Floats
    """grad N_a at the octants' Gauss points, column 3 q + axis (27, 24) [1/m]"""
    gradient_t: Floats
    """its transpose (24, 27)"""
    stabilisation: Floats
    """S of eq. (1) (27, 27) [m]"""
    volume: float
    """of a cell [m^3]"""


def cell_tables(edges: Floats) -> CellTables:
    """Tables for cells with these edges (3,) [m]."""
    volume = float(edges.prod())
    value, slope = np.empty(27), np.empty((27, 3))
    gradient = np.empty((27, 8, 3))
    two = np.zeros((27, 27))
    for q in range(8):
        hex27(np.array([_TWO[q % 2], _TWO[q // 2 % 2], _TWO[q // 4]]), value, slope)
        gradient[:, q] = slope * (2.0 / edges)
        two += volume / 8.0 * gradient[:, q] @ gradient[:, q].T
    three = np.zeros((27, 27))
    points, weights = _THREE
    for i in range(3):
        for j in range(3):
            for k in range(3):
                hex27(np.array([points[i], points[j], points[k]]), value, slope)
                g = slope * (2.0 / edges)
                three += volume / 8.0 * weights[i] * weights[j] * weights[k] * (g @ g.T)
    flat = gradient.reshape(27, 24)
    return CellTables(flat.copy(), flat.T.copy(), three - two, volume)
