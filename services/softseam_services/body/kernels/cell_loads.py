"""Stress at points of cells, and the nodal forces that it makes: what error indicators compare, off the hot path."""

import numpy as np

from softseam_services.body.materials.point import cauchy, stress
from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def _gradient(xe, nodes, G, F):
    """F = sum_a x_a (x) grad N_a at a point; xe (27, 3), nodes (m,) in it, G (3, m), F (3, 3) updated in place."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(len(nodes)):
                total += xe[nodes[a], i] * G[j, a]
            F[i, j] = total


@njit(cache=True, error_model="numpy")
def stress_at_points(x, cell_nodes, nodes, gradient, shape, kind, parameters, out):
    """Cauchy stress xx yy zz yz xz xy of the b elements of each cell at their q points.

    x (n, 3) [m], cell_nodes (c, 27), nodes (b, m), gradient (t, b, q, 3, m) [1/m], shape (c,) which of the t each has
    parameters (c, b q, MAX_PARAMETERS) of the material at each point; out (c, b q, 6) [Pa], updated in place
    """
    F, sigma, xe = np.empty((3, 3)), np.empty((3, 3)), np.empty((27, 3))
    n_points = gradient.shape[2]
    for cell in range(len(cell_nodes)):
        for a in range(27):
            for i in range(3):
                xe[a, i] = x[cell_nodes[cell, a], i] - x[cell_nodes[cell, 13], i]
        for element in range(len(nodes)):
            for q in range(n_points):
                _gradient(xe, nodes[element], gradient[shape[cell], element, q], F)
                at = element * n_points + q
                cauchy(kind, parameters[cell, at], F, sigma)
                row = out[cell, at]
                row[0], row[1], row[2] = sigma[0, 0], sigma[1, 1], sigma[2, 2]
                row[3], row[4], row[5] = sigma[1, 2], sigma[0, 2], sigma[0, 1]


@njit(cache=True, error_model="numpy")
def cell_forces(x, cell_nodes, gradient, weight, kind, parameters, out):
    """f_ai = sum_q w_q P_ij dN_a,j of each cell on its own nodes, dU/dx, not summed over cells.

    x (n, 3) [m], cell_nodes (c, 27), gradient (q, 3, 27) [1/m] of box cells, weight (c, q) [m^3]
    parameters (c, q, MAX_PARAMETERS) of the material at each point; out (c, 27, 3) [N], updated in place
    """
    F, P, xe = np.empty((3, 3)), np.empty((3, 3)), np.empty((27, 3))
    nodes = np.arange(27)
    out[:] = 0.0
    for cell in range(len(cell_nodes)):
        for a in range(27):
            for i in range(3):
                xe[a, i] = x[cell_nodes[cell, a], i] - x[cell_nodes[cell, 13], i]
        for q in range(len(gradient)):
            if weight[cell, q] == 0.0:
                continue
            _gradient(xe, nodes, gradient[q], F)
            stress(kind, parameters[cell, q], F, P)
            for a in range(27):
                for i in range(3):
                    pull = 0.0
                    for j in range(3):
                        pull += P[i, j] * gradient[q, j, a]
                    out[cell, a, i] += weight[cell, q] * pull
