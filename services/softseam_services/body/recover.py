"""Stress recovered at the nodes from the points where it is most accurate.

Superconvergent patch recovery: O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331-1364. Around
each node a linear polynomial is fitted, component by component, to the stresses at the sample points of the cells that
share the node; its value there is the recovered stress. FEM samples at the 2 x 2 x 2 Gauss points, PBD at the centres
of its blocks. Samples weigh as much as their octant is filled; empty octants have none.

    M_n = sum_q w_q p_q p_q^T,   p = (1, r_q),   sigma*_n = e_0^T M_n^-1 sum_q w_q p_q sigma_q                    (1)

with r the distance to the node in cell edges. The fit depends on the rest state alone: a sparse matrix, built once.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from softseam_services.body.body import Body, Floats
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.own_shapes import cell_volumes, sample_places

FEM_SAMPLE, PBD_SAMPLE = 1.0 / np.sqrt(3.0), 0.5
"""local coordinates of the samples are +- this"""
RIDGE = 1e-9
"""keeps the slope finite, and as small as can be, where the samples lie in a plane"""


def nodal_recovery(body: Body, sample: Floats, material: int = 0) -> csr_array:
    """Matrix (N, 8 C) that takes values at all octants, cell by cell, to the nodes.

    sample (C,) local coordinate of each cell's samples; material: only its octants count, as stress jumps where another
    begins. Rows of nodes without such an octant in reach are zero.
    """
    place = LOCAL - 1.0
    octant = place[OCTANT_NODES].sum(axis=1) / 4.0  # -1 or 1 along each axis
    if body.boxes:
        r = 0.5 * (sample[:, None, None, None] * octant[None, None] - place[None, :, None, :])  # (C, 27, 8, 3)
    else:
        r = sample_places(body, sample)[:, None] - body.x_rest[body.cell_nodes][:, :, None]
        r /= np.cbrt(cell_volumes(body).mean())
    p = np.concatenate([np.ones((*r.shape[:3], 1)), r], axis=3)
    weighted = p * (body.fill * (body.octant_material == material))[:, None, :, None]
    moments = np.zeros((body.n_nodes, 4, 4))
    np.add.at(moments, body.cell_nodes, np.einsum("canq,canp->capq", weighted, p))
    size = moments[:, 0, 0].copy()
    found = size > 0.0
    moments[:, 1:, 1:] += (RIDGE * size)[:, None, None] * np.eye(3)
    moments[~found] = np.eye(4)
    first = np.linalg.inv(moments)[:, 0] * found[:, None]
    weight = np.einsum("caq,canq->can", first[body.cell_nodes], weighted)
    row = np.broadcast_to(body.cell_nodes[:, :, None], weight.shape)
    column = np.broadcast_to(np.arange(8 * body.n_cells).reshape(-1, 1, 8), weight.shape)
    entries = (weight.ravel(), (row.ravel(), column.ravel()))
    return csr_array(entries, shape=(body.n_nodes, 8 * body.n_cells))
