"""Newton's method beside a kept factor: what changed at contacts is solved for by iterations, not by a new factor.

A factor A has contacts' symmetric tangents, eq. (2) of kernels/contact.py, as they were when it was made. With C the
whole tangents of today's contacts without those, both of a few nodes only, a correction d solves
  (A + C) d = r,   or   (1 + A^-1 C) d = A^-1 r                                                                 (1)
by GMRES (kernels/gmres.py), each of whose iterations is one solution with A. Whole: a slipping point with normal n,
pressure p, trial force t, way e = t/|t| and B = mu p (Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991) has
  -df/dx = r (n n^T + mu e n^T + (B/|t|)(1 - n n^T - e e^T)),                                                    (2)
of which the second term is not symmetric. The last one only holds where the point slipped the same way in the iterate
before: along e nothing resists, and what turns round at every iteration shall stop.
"""

from __future__ import annotations

import numpy as np

from softseam_services.fem.kernels.anderson import add_scaled
from softseam_services.fem.kernels.contact import (
    NORMAL,
    OPEN,
    PRESSURE,
    RELAXED,
    SLIP,
    SLOPE,
    TRACTION,
    TRIAL,
    acting_weight,
    coefficient,
)
from softseam_services.fem.kernels.dot import dot
from softseam_services.fem.kernels.fronts import solve
from softseam_services.fem.kernels.gmres import add_solution, begin_krylov, extend_krylov
from softseam_services.jit import njit

_TOLERANCE = 0.05
"""of eq. (1), in the length of d [1]"""


@njit(cache=True, error_model="numpy", inline="always")
def find_changes(parameters, count, work):
    """work.change (c, 3, 3) <- what the factor lacks of the whole tangent of every candidate [N/m]."""
    for c in range(count):
        point, tool, row, change = work.pair[c, 0], work.pair[c, 1], work.contact[c], work.change[c]
        touches, slips = work.state[c] != OPEN, work.state[c] == SLIP
        stiffness, slope = (work.hold[c, 0], row[SLOPE]) if touches else (0.0, 0.0)
        friction = coefficient(parameters, point, tool) if slips else 0.0
        bound = friction * row[PRESSURE]
        tangential = stiffness * bound / row[TRIAL] if slips else stiffness
        along = 1.0 / bound if bound > 0.0 else 0.0
        for i in range(3):
            e = row[TRACTION + i] * along
            for j in range(3):
                pushed = (slope - tangential) * row[NORMAL + i] + friction * slope * e
                change[i, j] = pushed * row[NORMAL + j] - work.factored[point, tool, i, j]
                if row[RELAXED] > 0.0:
                    change[i, j] -= tangential * e * row[TRACTION + j] * along
            change[i, i] += tangential


@njit(cache=True, error_model="numpy", inline="always")
def apply_changes(model, parameters, count, v, work, out):
    """out (3 n_free,) <- C v in elimination order, of work.change."""
    for i in range(len(out)):
        out[i] = 0.0
    for c in range(count):
        point, change = work.pair[c, 0], work.change[c]
        if work.state[c] == OPEN and work.factored_state[point, work.pair[c, 1]] == OPEN:
            continue
        vx = vy = vz = 0.0
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            place = 3 * model.point_place[entry]
            weight = acting_weight(c, entry, parameters, work)
            if place >= 0:
                vx += weight * v[place]
                vy += weight * v[place + 1]
                vz += weight * v[place + 2]
        fx = change[0, 0] * vx + change[0, 1] * vy + change[0, 2] * vz
        fy = change[1, 0] * vx + change[1, 1] * vy + change[1, 2] * vz
        fz = change[2, 0] * vx + change[2, 1] * vy + change[2, 2] * vz
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            place = 3 * model.point_place[entry]
            weight = acting_weight(c, entry, parameters, work)
            if place >= 0:
                out[place] += weight * fx
                out[place + 1] += weight * fy
                out[place + 2] += weight * fz


@njit(cache=True, error_model="numpy", inline="always")
def solve_with_changes(model, parameters, tree, count, work):
    """work.d (3 n_free,) <- the solution of eq. (1), or what comes nearest in work.basis; A^-1 r on entry.

    work.d_last, q and s of Anderson's method are lost.
    """
    basis, h, d, w = work.basis, work.hessenberg, work.d, work.d_last
    left = first = np.sqrt(dot(d, d))
    find_changes(parameters, count, work)
    begin_krylov(d, first, basis, h)
    n = 0
    while n < len(basis) - 1 and left > _TOLERANCE * first:
        apply_changes(model, parameters, count, basis[n], work, w)
        solve(tree, work.values, w, work.factoring)
        add_scaled(w, 1.0, basis[n])
        left = extend_krylov(n, w, basis, h)
        n += 1
    for i in range(len(d)):
        d[i] = 0.0
    add_solution(n, basis, h, d)
