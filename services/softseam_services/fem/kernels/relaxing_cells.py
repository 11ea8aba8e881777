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

from .fronts import LANES

HALF = LANES // 2
SIZE = relaxation.SIZE
"""of a workspace of one octant"""


@njit(cache=True, error_model="numpy")
def steps_of(model, parameters, work):
    """What each branch of each material does in the step (m, n, COLUMNS)."""
    steps = np.empty((len(parameters.law), max(0, model.n_state // relaxation.SIX - 1), relaxation.COLUMNS))
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
def write_tangent(F, q, weight, A, B, H, step, state, safe, w, D, half, c):
    """c (9, 9) <- eq. (1) of the columns of q, without L; A and B have the weight in them.

    w (SIZE,), D (6, 6), half (6, 9): scratch
    """
    g = relaxation.strain(F, 3 * q, w)
    relaxation.write_stiffness(w, g, step, state, weight, safe, D)
    relaxation.write_half(F, 3 * q, D, half)
    for i in range(3):
        b0, b1, b2 = B * H[i, 0], B * H[i, 1], B * H[i, 2]
        for j in range(3):
            a = A * H[i, j]
            for k in range(3):
                h = H[k, j]
                c[3 * i + j, 3 * k] = a * H[k, 0] + b0 * h
                c[3 * i + j, 3 * k + 1] = a * H[k, 1] + b1 * h
                c[3 * i + j, 3 * k + 2] = a * H[k, 2] + b2 * h
    relaxation.add_tangent(F, 3 * q, w, half, not safe, c)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def sides(h, c, left):
    """left[(27 q + 9 i + 3 k + l) LANES + a] <- dN_a,j c_ij,kl for all a, with h and c as of `block_row`."""
    for q in range(8):
        s = 3 * q * LANES
        for i in range(3):
            for m in range(9):
                x, y, z = c[q, 3 * i, m], c[q, 3 * i + 1, m], c[q, 3 * i + 2, m]
                to = (27 * q + 9 * i + m) * LANES
                for a in range(LANES):
                    left[to + a] = x * h[s + a] + y * h[s + LANES + a] + z * h[s + 2 * LANES + a]


@njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def _sum_row(a, start, h, left, row):
    for entry in range(9):
        for b in range(start, LANES):
            row[entry * LANES + b] = 0.0
    for q in range(8):
        s, t = 3 * q * LANES, 27 * q * LANES + a
        xxx, xxy, xxz = left[t], left[t + 1 * LANES], left[t + 2 * LANES]
        xyx, xyy, xyz = left[t + 3 * LANES], left[t + 4 * LANES], left[t + 5 * LANES]
        xzx, xzy, xzz = left[t + 6 * LANES], left[t + 7 * LANES], left[t + 8 * LANES]
        yxx, yxy, yxz = left[t + 9 * LANES], left[t + 10 * LANES], left[t + 11 * LANES]
        yyx, yyy, yyz = left[t + 12 * LANES], left[t + 13 * LANES], left[t + 14 * LANES]
        yzx, yzy, yzz = left[t + 15 * LANES], left[t + 16 * LANES], left[t + 17 * LANES]
        zxx, zxy, zxz = left[t + 18 * LANES], left[t + 19 * LANES], left[t + 20 * LANES]
        zyx, zyy, zyz = left[t + 21 * LANES], left[t + 22 * LANES], left[t + 23 * LANES]
        zzx, zzy, zzz = left[t + 24 * LANES], left[t + 25 * LANES], left[t + 26 * LANES]
        for b in range(start, LANES):
            x, y, z = h[s + b], h[s + LANES + b], h[s + 2 * LANES + b]
            row[b] += xxx * x + xxy * y + xxz * z
            row[LANES + b] += xyx * x + xyy * y + xyz * z
            row[2 * LANES + b] += xzx * x + xzy * y + xzz * z
            row[3 * LANES + b] += yxx * x + yxy * y + yxz * z
            row[4 * LANES + b] += yyx * x + yyy * y + yyz * z
            row[5 * LANES + b] += yzx * x + yzy * y + yzz * z
            row[6 * LANES + b] += zxx * x + zxy * y + zxz * z
            row[7 * LANES + b] += zyx * x + zyy * y + zyz * z
            row[8 * LANES + b] += zzx * x + zzy * y + zzz * z


@njit(cache=True, error_model="numpy")
def block_row(a, h, left, row):
    """row[(3 i + k) LANES + b] <- the sum of eq. (1) for all b >= a; h[(3 q + j) LANES + b] = dN_b,j at q, left of
    `sides`.

    xyz: what the entry x, y has of dN_b,z.
    """
    if a < HALF:
        _sum_row(a, 0, h, left, row)
    else:
        _sum_row(a, HALF, h, left, row)


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
            g = relaxation.strain(work.F[cell], 3 * q, w)
            _, dissipated = relaxation.advance(
                w, g, steps[material], parameters.law[material], dt, work.material_state[cell, q], end[cell, q]
            )
            lost += parameters.weight[cell, q] * dissipated
    return lost
