"""The stiffness of a region's cells times a vector, without a matrix.

On the fast path, of kernels/cells.py with its A, B, H = cof F (or I), L and gradients g of a cell at 8 points q,
  (K v)_ia = sum_b L_ab v_ib + sum_q (dP_q g_a)_i,   dP = A (H : dF) H + B H dF^T H,   dF = sum_b v_b g_b^T       (1)
Of other elements and laws, of laws with state, and of cells that are watched for lost volume, it is the central
difference of forces over `APART` of a cell edge, off by about 1e-10.
"""

import numpy as np

from softseam_services.jit import njit

from .anderson import add_scaled
from .cells import deformation, gather, multiply_full, point_factors
from .elements import subtract_forces
from .lapack import multiply

APART = 1e-5
"""of a cell edge: between what central differences compare"""


@njit(cache=True, error_model="numpy")
def multiply_tangent(x, v, model, parameters, work, moved, out):
    """out <- K v (3 n_free,) in elimination order, K at x (n, 3); moved (n, 3) is scratch, as are work.r and others."""
    largest = 0.0
    for i in range(len(v)):
        largest = max(largest, abs(v[i]))
        out[i] = 0.0
    if largest == 0.0:
        return
    if not model.general and model.n_state == 0 and work.watches[0] == 0:
        for node in range(len(x)):
            place = 3 * model.order[node]
            for i in range(3):
                moved[node, i] = v[place + i] if place >= 0 else 0.0
        _multiply_cells(x, moved, model, parameters, work, out)
        return
    scale = APART * parameters.edge / largest
    for side in (1.0, -1.0):
        for node in range(len(x)):
            place = 3 * model.order[node]
            for i in range(3):
                moved[node, i] = x[node, i] + (side * scale * v[place + i] if place >= 0 else 0.0)
        for i in range(len(v)):
            work.r[i] = 0.0
        subtract_forces(moved, model, parameters, work, work.r)
        add_scaled(out, -0.5 * side / scale, work.r)


@njit(cache=True, error_model="numpy")
def _multiply_cells(x, moved, model, parameters, work, out):
    """Eq. (1); moved (n, 3)."""
    n_cells, H, G = len(model.cell_nodes), np.empty((3, 3)), np.empty((3, 3))
    deformation(x, model, parameters, work)
    F, P = work.F, work.P
    gather(moved, model.cell_nodes, work.xe)
    multiply_full(model, parameters, work.xe, parameters.gradient, P, 24, 27, False, work.ints)
    for cell in range(n_cells):
        cut = model.cut[cell]
        if cut >= 0:
            multiply(work.xe[cell], parameters.cut_gradient[cut], P[cell], 3, 24, 27, False, work.ints)
        for q in range(8):
            at = 3 * q
            mu, lam, weight = parameters.mu[cell, q], parameters.lambda_[cell, q], parameters.weight[cell, q]
            A, B = point_factors(F[cell], at, model.linear, mu, lam, weight, False, H)
            along = 0.0
            for i in range(3):
                for k in range(3):
                    along += H[i, k] * P[cell, i, at + k]
                    # G = H dF^T
                    G[i, k] = H[i, 0] * P[cell, k, at] + H[i, 1] * P[cell, k, at + 1] + H[i, 2] * P[cell, k, at + 2]
            for i in range(3):
                for k in range(3):
                    turned = G[i, 0] * H[0, k] + G[i, 1] * H[1, k] + G[i, 2] * H[2, k]
                    P[cell, i, at + k] = A * along * H[i, k] + B * turned
        laplacian = parameters.laplacian[model.pattern[cell]]
        multiply(work.xe[cell], laplacian, work.fe[cell], 3, 27, 27, False, work.ints)
        if cut >= 0:
            multiply(P[cell], parameters.cut_force[cut, :24], work.fe[cell], 3, 27, 24, True, work.ints)
    multiply_full(model, parameters, P, parameters.gradient_t, work.fe, 27, 24, True, work.ints)
    for cell in range(n_cells):
        for a in range(27):
            place = 3 * model.cell_order[cell, a]
            if place >= 0:
                out[place] += work.fe[cell, 0, a]
                out[place + 1] += work.fe[cell, 1, a]
                out[place + 2] += work.fe[cell, 2, a]
