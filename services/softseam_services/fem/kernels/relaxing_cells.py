"""What branches that relax add to the fast path of kernels/cells.py: stresses, tangents, energies, and their memory.

They have the octants' points alone, with what steadies these in `FemParameters.stabilisation`; what the octants
remember is work.material_state as the step of work.material_dt begins, 0 to look at it. With 2 dS/dC of `relaxation`
the matrix is
  K_ia,kb = delta_ik L_ab + sum_q dN_a,j c_ij,kl dN_b,l,
  c_ij,kl = w_q [A H_ij H_kl + B H_kj H_il + d(F S)_ij/dF_kl]                                                      (1)
A, B, H of `cells`, L with what lasts of mu.
"""

import numpy as np

from softseam_services.body.materials import relaxation
from softseam_services.jit import njit

SIZE = relaxation.SIZE
"""of a workspace of one octant"""


@njit(cache=True, error_model="numpy")
def steps_of(model, parameters, work):
    """What each branch of each material does in the step (m, n, 4)."""
    steps = np.empty((len(parameters.law), max(0, model.n_state // relaxation.SIX - 1), 4))
    for material in range(len(steps)):
        relaxation.write_step(parameters.law[material], work.material_dt[0], steps[material])
    return steps


@njit(cache=True, error_model="numpy")
def add_stresses(model, parameters, work):
    """work.P += w F S of each octant, of work.F, in place."""
    steps, w = steps_of(model, parameters, work), np.empty(relaxation.SIZE)
    for cell in range(len(model.cell_nodes)):
        F, P = work.F[cell], work.P[cell]
        for q in range(8):
            g = relaxation.strain(F, 3 * q, w)
            relaxation.write_stress(w, g, steps[parameters.material[cell, q]], work.material_state[cell, q])
            relaxation.add_stress(F, 3 * q, work.part[cell] * parameters.weight[cell, q], w, P)


@njit(cache=True, error_model="numpy")
def add_own(F, q, step, state, w, P):
    """P (3, 24) += F S of an octant in the columns of q, in place."""
    g = relaxation.strain(F, 3 * q, w)
    relaxation.write_stress(w, g, step, state)
    relaxation.add_stress(F, 3 * q, 1.0, w, P)


@njit(cache=True, error_model="numpy")
def write_tangent(F, q, weight, A, B, H, step, state, safe, w, D, c):
    """c (9, 9) <- eq. (1) of the columns of q, without L; A and B have the weight in them.

    w (SIZE,), D (6, 6): scratch
    """
    g = relaxation.strain(F, 3 * q, w)
    relaxation.write_stiffness(w, g, step, state, safe, D)
    c[:] = 0.0
    relaxation.add_tangent(F, 3 * q, w, D, not safe, c)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    both = A * H[i, j] * H[k, m] + B * H[k, j] * H[i, m]
                    c[3 * i + j, 3 * k + m] = weight * c[3 * i + j, 3 * k + m] + both


@njit(cache=True, error_model="numpy")
def block_row(a, h, c, lanes, row):
    """row[(3 i + k) lanes + b] <- the sum of eq. (1) for all b; h[(3 q + j) lanes + b] = dN_b,j at q, c (8, 9, 9)."""
    for b in range(9 * lanes):
        row[b] = 0.0
    for q in range(8):
        s = 3 * q * lanes
        x, y, z = h[s + a], h[s + lanes + a], h[s + 2 * lanes + a]
        for i in range(3):
            for k in range(3):
                u = x * c[q, 3 * i, 3 * k] + y * c[q, 3 * i + 1, 3 * k] + z * c[q, 3 * i + 2, 3 * k]
                v = x * c[q, 3 * i, 3 * k + 1] + y * c[q, 3 * i + 1, 3 * k + 1] + z * c[q, 3 * i + 2, 3 * k + 1]
                w = x * c[q, 3 * i, 3 * k + 2] + y * c[q, 3 * i + 1, 3 * k + 2] + z * c[q, 3 * i + 2, 3 * k + 2]
                to = (3 * i + k) * lanes
                for b in range(lanes):
                    row[to + b] += u * h[s + b] + v * h[s + lanes + b] + w * h[s + 2 * lanes + b]


@njit(cache=True, error_model="numpy")
def add_energies(model, parameters, work):
    """What the branches store in all [J]; work.energy (c,) += each cell's, in place."""
    steps, w = steps_of(model, parameters, work), np.empty(relaxation.SIZE)
    total = 0.0
    for cell in range(len(model.cell_nodes)):
        own = 0.0
        for q in range(8):
            g = relaxation.strain(work.F[cell], 3 * q, w)
            stored = relaxation.write_stress(w, g, steps[parameters.material[cell, q]], work.material_state[cell, q])
            own += parameters.weight[cell, q] * stored
        work.energy[cell] += work.part[cell] * own
        total += work.part[cell] * own
    return total


@njit(cache=True, error_model="numpy")
def remember(model, parameters, work, end):
    """end (c, 8, n) <- what the octants remember at the end of the step, of work.F; returns what the material
    dissipated in it [J]."""
    steps, w, dt = steps_of(model, parameters, work), np.empty(relaxation.SIZE), work.material_dt[0]
    lost = 0.0
    for cell in range(len(model.cell_nodes)):
        for q in range(8):
            material = parameters.material[cell, q]
            relaxation.strain(work.F[cell], 3 * q, w)
            _, dissipated = relaxation.advance(
                w, steps[material], parameters.law[material], dt, work.material_state[cell, q], end[cell, q]
            )
            lost += parameters.weight[cell, q] * dissipated
    return lost
