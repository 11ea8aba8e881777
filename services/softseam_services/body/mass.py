"""Lumped masses of partly filled cells.

Row sums of the hex27 functions over the filled part (Simpson's weights on a full cell) keep mass, centre of mass and
inertia exactly, but turn negative on some partly filled cells. Each cell therefore takes
m = (1 - t) m_rowsum + t (0.8 m_trilinear + 0.2 m_octant)                                                      (1)
with the smallest t in [0, 1] that keeps m >= 0.2 m_octant on every node. m_trilinear are the row sums of the octants'
trilinear functions (never negative, centre of mass exact), m_octant spreads each octant's mass equally over its 8
nodes. On a full cell the corner has 0.30 m_octant, so t = 0 and nothing changes.
"""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.filled import FILL_FLOOR, FULL_MOMENTS, LINEAR, quadratic
from softseam_services.body.lattice import OCTANT_NODES, SIMPSON

MASS_SHARE = 0.2
"""least ratio of a node's mass to its m_octant"""

_EXACT_CELL = 0.01
"""cells at least this full carry exactly their own mass; the floor's excess of emptier ones is taken off these"""


def lump_full(density: Floats, edges: Floats) -> Floats:
    """Mass (C, 27) [kg] that each full cell gives to its nodes; density (C, 8) [kg/m^3]."""
    mass = np.asarray((density[:, :1] * edges.prod()) * SIMPSON)
    mixed = np.flatnonzero((density != density[:, :1]).any(axis=1))
    if len(mixed):
        mass[mixed] = lump(np.tile(FULL_MOMENTS, (len(mixed), 8, 1)), edges, density[mixed])[1]
    return mass


def lump(moments: Floats, edges: Floats, density: Floats | float) -> tuple[Floats, Floats]:
    """Fill (C, 8) of each octant and mass (C, 27) [kg] that each cell gives to its nodes, all positive.

    moments (C, 8, 27): M_pqr of the filled part of each octant, see kernels.fill; density (C, 8) or one for all
    [kg/m^3]: an octant counts in eq. (1) with its density over the largest
    """
    true_fill = moments[:, :, 0]
    fill = np.maximum(true_fill, FILL_FLOOR)
    most = float(np.max(density))
    share = np.broadcast_to(np.asarray(density) / most, fill.shape)
    moments = (moments + (fill - true_fill)[:, :, None] * FULL_MOMENTS) * share[:, :, None]
    octant_volume = edges.prod() / 8.0
    row_sum = np.zeros((len(fill), 27))
    trilinear = np.zeros((len(fill), 27))
    spread = np.zeros((len(fill), 27))
    for octant in range(8):
        x, y, z = (quadratic((octant >> axis) & 1) for axis in range(3))
        cube = moments[:, octant].reshape(-1, 3, 3, 3)  # r, q, p
        row_sum += np.einsum("nrqp,cr,bq,ap->ncba", cube, z, y, x, optimize=True).reshape(-1, 27)
        corners = np.einsum("nrqp,cr,bq,ap->ncba", cube[:, :2, :2, :2], *[LINEAR[:, :2]] * 3, optimize=True)
        trilinear[:, OCTANT_NODES[octant]] += corners.reshape(-1, 8)
        spread[:, OCTANT_NODES[octant]] += (fill * share)[:, octant, None] / 8.0
    # m >= 0.2 m_octant on a node asks (1 - t)(m_rowsum - 0.2 m_octant) + t 0.8 m_trilinear >= 0.
    short = np.maximum(MASS_SHARE * spread - row_sum, 0.0)
    gain = (1.0 - MASS_SHARE) * np.maximum(trilinear, 0.0)
    t = np.max(np.where(short > 0.0, short / (short + gain), 0.0), axis=1, keepdims=True)
    mass = (1.0 - t) * row_sum + t * (gain + MASS_SHARE * spread)  # eq. (1)

    true_cell = true_fill.sum(axis=1)
    exact = true_cell >= 8.0 * _EXACT_CELL
    target = np.where(exact, true_cell, fill.sum(axis=1))
    excess = float(target.sum() - true_cell.sum())
    partly = exact & (true_cell < 8.0)
    if excess > 0.0 and partly.any():
        target[partly] *= 1.0 - excess / target[partly].sum()
    target *= (fill * share).sum(axis=1) / fill.sum(axis=1)
    mass *= (target / mass.sum(axis=1))[:, None]
    return fill, most * octant_volume * mass
