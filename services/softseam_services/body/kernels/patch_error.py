"""Stress recovered inside each cell, smoother than its own, and the energy of what the cell's own lacks to it.

After O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331-1364, with patches around cells in the
place of nodes: every cell takes the samples of the cells that share a node with it, and fits, component by component,

    sigma*(x) = p(x) . a,   p = (1, r, r r^T),   a = (sum_q w_q p_q p_q^T)^-1 sum_q w_q p_q sigma_q               (1)

with r the distance to the cell's middle in cell edges. `recover.nodal_recovery` fits such polynomials around
nodes, for read-out; to measure quadratic cells the recovered stress must be one order better than theirs inside, too.
Where the samples do not determine a slope or curvature (a body one cell thick), the least one is taken.
"""

import numpy as np

from softseam_services.jit import njit

N_TERMS = 10
NEIGHBOUR = 0.05
"""weight of other cells' samples against the cell's own; even weights make the fit worse at the body's surface, where
all neighbours are on one side"""
RIDGE = 1e-8
"""weight of slopes and curvatures against the samples', relative"""


@njit(cache=True, error_model="numpy")
def _terms(x, y, z, p):
    """p of eq. (1) at (x, y, z) [cell edges], (10,) updated in place."""
    p[0], p[1], p[2], p[3] = 1.0, x, y, z
    p[4], p[5], p[6] = x * x, y * y, z * z
    p[7], p[8], p[9] = y * z, x * z, x * y


@njit(cache=True, error_model="numpy")
def _cells_at_nodes(cell_nodes, n_nodes):
    """The cells at each node, ascending: those of node a are cells[first[a] : first[a + 1]]."""
    first = np.zeros(n_nodes + 1, dtype=np.int64)
    for cell in range(len(cell_nodes)):
        for a in range(27):
            first[cell_nodes[cell, a] + 1] += 1
    for node in range(n_nodes):
        first[node + 1] += first[node]
    place, cells = first[:-1].copy(), np.empty(27 * len(cell_nodes), dtype=np.int64)
    for cell in range(len(cell_nodes)):
        for a in range(27):
            node = cell_nodes[cell, a]
            cells[place[node]] = cell
            place[node] += 1
    return first, cells


@njit(cache=True, error_model="numpy")
def _solve(M, R):
    """R (10, 6) <- M^-1 R for M (10, 10) positive definite, of which the lower triangle is read and overwritten."""
    for j in range(N_TERMS):
        for k in range(j):
            M[j, j] -= M[j, k] * M[j, k]
        M[j, j] = np.sqrt(M[j, j])
        for i in range(j + 1, N_TERMS):
            for k in range(j):
                M[i, j] -= M[i, k] * M[j, k]
            M[i, j] /= M[j, j]
    for s in range(6):
        for i in range(N_TERMS):
            for k in range(i):
                R[i, s] -= M[i, k] * R[k, s]
            R[i, s] /= M[i, i]
        for i in range(N_TERMS - 1, -1, -1):
            for k in range(i + 1, N_TERMS):
                R[i, s] -= M[k, i] * R[k, s]
            R[i, s] /= M[i, i]


@njit(cache=True, error_model="numpy")
def _fit(cell, number, around, middle, size, at, sampled, fill, octant, M, R, p):
    """R (10, 6) <- a of eq. (1) from the samples of one material in the cells `around`; 0 where there are none."""
    M[:] = 0.0
    R[:] = 0.0
    for other in around:
        for q in range(8):
            if octant[other, q] == number and fill[other, q] > 0.0:
                weight = fill[other, q] * (1.0 if other == cell else NEIGHBOUR)
                x = (at[other, q, 0] - middle[cell, 0]) / size[cell, 0]
                y = (at[other, q, 1] - middle[cell, 1]) / size[cell, 1]
                z = (at[other, q, 2] - middle[cell, 2]) / size[cell, 2]
                _terms(x, y, z, p)
                for i in range(N_TERMS):
                    share = weight * p[i]
                    for j in range(i + 1):
                        M[i, j] += share * p[j]
                    for s in range(6):
                        R[i, s] += share * sampled[other, q, s]
    total = M[0, 0]
    if total > 0.0:
        for i in range(1, N_TERMS):
            M[i, i] += RIDGE * total
        _solve(M, R)


@njit(cache=True, error_model="numpy")
def patch_error(
    cell_nodes,
    n_nodes,
    middle,
    size,
    at,
    sampled,
    fill,
    octant,
    points,
    shape,
    material,
    moduli,
    weight,
    sigma,
    out,
):
    """Energy of sigma* - sigma in each cell by Hooke's law, 1/2 int s : C^-1 : s dV, into out (c,) [J].

    cell_nodes  (c, 27) of n_nodes; middle (c, 3) of each cell and size (c, 3), its edges [m]
    at          (c, 8, 3) of the samples at rest [m], sampled (c, 8, 6) their stress [Pa], one in each octant
    fill, octant (c, 8) filled part of each octant, 0 where its sample does not count, and its material
    points      (t, q, 3) of the integration in each shape of cell, from its middle [cell edges]; shape (c,)
    material    (c, q) of each point, moduli (c, q, 2) its mu and lambda [Pa], weight (c, q) [m^3] and sigma (c, q, 6)
                [Pa] there
    """
    first, at_node = _cells_at_nodes(cell_nodes, n_nodes)
    seen = np.full(len(cell_nodes), -1)
    around = np.empty(len(cell_nodes), dtype=np.int64)
    M, R, p = np.empty((N_TERMS, N_TERMS)), np.empty((N_TERMS, 6)), np.empty(N_TERMS)
    n_materials = 1 + material.max()
    for cell in range(len(cell_nodes)):
        n_around = 0
        for a in range(27):
            node = cell_nodes[cell, a]
            for other in at_node[first[node] : first[node + 1]]:
                if seen[other] != cell:
                    seen[other] = cell
                    around[n_around] = other
                    n_around += 1
        out[cell] = 0.0
        for number in range(n_materials):
            fitted = False
            for q in range(material.shape[1]):
                if material[cell, q] != number:
                    continue
                if not fitted:
                    _fit(cell, number, around[:n_around], middle, size, at, sampled, fill, octant, M, R, p)
                    fitted = True
                _terms(points[shape[cell], q, 0], points[shape[cell], q, 1], points[shape[cell], q, 2], p)
                trace = square = 0.0
                for s in range(6):
                    lack = -sigma[cell, q, s]
                    for i in range(N_TERMS):
                        lack += p[i] * R[i, s]
                    if s < 3:
                        trace += lack
                        square += lack * lack
                    else:
                        square += 2.0 * lack * lack
                mu, lambda_ = moduli[cell, q, 0], moduli[cell, q, 1]
                density = (square - lambda_ / (3.0 * lambda_ + 2.0 * mu) * trace * trace) / (4.0 * mu)
                out[cell] += weight[cell, q] * density
