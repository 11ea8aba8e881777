"""Stress recovered inside each cell, smoother than its own: a quadratic polynomial fitted to the cells around it.

After O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331-1364, with patches around cells in the
place of nodes: every cell takes the samples of the cells that share a node with it, and fits, component by component,

    sigma*(x) = p(x) . a,   p = (1, r, r r^T),   a = (sum_q w_q p_q p_q^T)^-1 sum_q w_q p_q sigma_q               (1)

with r the distance to the cell's middle in cell edges. `recover.nodal_recovery` fits such polynomials around
nodes, for read-out; to measure quadratic cells the recovered stress must be one order better than theirs inside, too.
Where the samples cannot tell a slope or curvature (a body one cell thick), the least one is taken.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from softseam_services.body.body import Floats, Ints

N_TERMS = 10
NEIGHBOUR = 0.05
"""weight of other cells' samples against the cell's own; even weights make the fit worse at the body's surface, where
all neighbours are on one side"""
RIDGE = 1e-8
"""weight of slopes and curvatures against the samples', relative"""


def terms(r: Floats) -> Floats:
    """p of eq. (1) at r (..., 3) [cell edges] -> (..., 10)."""
    x, y, z = np.moveaxis(r, -1, 0)
    return np.stack([np.ones_like(x), x, y, z, x * x, y * y, z * z, y * z, x * z, x * y], axis=-1)


def patch_fit(
    cell_nodes: Ints, n_nodes: int, middle: Floats, size: Floats, places: Floats, weight: Floats
) -> csr_array:
    """Matrix (10 C, S C) that takes samples, S a cell, to the polynomials' coefficients.

    cell_nodes (C, 27), n_nodes that they number; middle (C, 3) of each cell and size (C, 3), its edges [m]
    places     (C, S, 3) of the samples at rest [m]; weight (C, S), 0 for those that do not count
    """
    n_cells, n_samples = weight.shape
    around = csr_array(
        (np.ones(cell_nodes.size), (np.repeat(np.arange(n_cells), 27), cell_nodes.ravel())), shape=(n_cells, n_nodes)
    )
    pairs = (around @ around.T).tocoo()
    cell, other = pairs.coords
    order = np.lexsort((other, cell))
    cell, other = cell[order], other[order]
    p = terms((places[other] - middle[cell, None]) / size[cell, None])  # (pairs, S, 10)
    weighted = p * (weight[other] * np.where(cell == other, 1.0, NEIGHBOUR)[:, None])[..., None]
    moments = np.zeros((n_cells, N_TERMS, N_TERMS))
    np.add.at(moments, cell, np.einsum("ksp,ksq->kpq", weighted, p))
    total = moments[:, 0, 0].copy()
    moments[total == 0.0] = np.eye(N_TERMS)  # no samples in reach: coefficients zero
    moments += (RIDGE * total)[:, None, None] * np.diag(np.arange(N_TERMS) > 0)
    fit = np.einsum("kpq,ksq->kps", np.linalg.inv(moments)[cell], weighted)
    row = N_TERMS * cell[:, None, None] + np.arange(N_TERMS)[None, :, None]
    column = n_samples * other[:, None, None] + np.arange(n_samples)[None, None, :]
    row, column = np.broadcast_to(row, fit.shape), np.broadcast_to(column, fit.shape)
    shape = (N_TERMS * n_cells, n_samples * n_cells)
    return csr_array((fit.ravel(), (row.ravel(), column.ravel())), shape=shape)
