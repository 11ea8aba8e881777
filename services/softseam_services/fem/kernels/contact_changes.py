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

import numpy as np

from softseam_services.jit import njit

from .anderson import add_scaled, dot
from .contact import coefficient
from .contact_columns import EDGED, NORMAL, OPEN, PRESSURE, RELAXED, SLIP, SLOPE, TRACTION, TRIAL
from .contact_tangents import LEANS, SPREADS
from .fronts import solve
from .gmres import add_solution, begin_krylov, extend_krylov

_TOLERANCE = 0.05
"""of eq. (1), in the length of d [1]"""


@njit(cache=True, error_model="numpy", forceinline=True)
def find_changes(parameters, count, work):
    """work.change (c, 3, 3) <- what the factor lacks of the whole tangent of every candidate [N/m]; on patches under
    edges that tangent itself, for what the factor has of it is spread over other places."""
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
                change[i, j] = pushed * row[NORMAL + j]
                if work.side[c] != EDGED:
                    change[i, j] -= work.factored[point, tool, i, j]
                if row[RELAXED] > 0.0:
                    change[i, j] -= tangential * e * row[TRACTION + j] * along
            change[i, i] += tangential


@njit(cache=True, error_model="numpy", forceinline=True)
def apply_changes(model, parameters, count, v, work, out):
    """out (3 n_free,) <- C v in elimination order, of work.change."""
    for i in range(len(out)):
        out[i] = 0.0
    moved, force = np.empty((3, 3)), np.empty((3, 3))
    for c in range(count):
        point, change = work.pair[c, 0], work.change[c]
        if work.state[c] == OPEN and work.factored_state[point, work.pair[c, 1]] == OPEN:
            continue
        if work.side[c] == EDGED:
            _change_of_patch(c, model, parameters, v, work, moved, force, out)
            continue
        vx = vy = vz = 0.0
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            place, weight = 3 * model.point_place[entry], parameters.point_weight[entry]
            if place >= 0:
                vx += weight * v[place]
                vy += weight * v[place + 1]
                vz += weight * v[place + 2]
        fx = change[0, 0] * vx + change[0, 1] * vy + change[0, 2] * vz
        fy = change[1, 0] * vx + change[1, 1] * vy + change[1, 2] * vz
        fz = change[2, 0] * vx + change[2, 1] * vy + change[2, 2] * vz
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            place, weight = 3 * model.point_place[entry], parameters.point_weight[entry]
            if place >= 0:
                out[place] += weight * fx
                out[place + 1] += weight * fy
                out[place + 2] += weight * fz


@njit(cache=True, error_model="numpy")
def _change_of_patch(c, model, parameters, v, work, moved, force, out):
    """out += C v of one patch; moved and force (3, 3) are scratch."""
    point, tool, row, now = work.pair[c, 0], work.pair[c, 1], work.contact[c], np.zeros(10)
    along, extra, none = now[:LEANS], np.zeros(3), np.zeros(3)
    if work.state[c] != OPEN:
        root = np.sqrt(row[SLOPE])
        slips = work.state[c] == SLIP and row[PRESSURE] > 0.0
        for i in range(3):
            along[i] = root * row[NORMAL + i]
            extra[i] = root * row[TRACTION + i] / row[PRESSURE] if slips else 0.0
        now[LEANS], now[LEANS + 1] = work.lean[c, 0], work.lean[c, 1]
        now[SPREADS:] = work.spread[c]
    moved[:], force[:] = 0.0, 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place = 3 * model.point_place[entry]
        if place >= 0:
            for i in range(3):
                moved[0, i] += parameters.point_weight[entry] * v[place + i]
                moved[1, i] += parameters.point_tilt[entry, 0] * v[place + i]
                moved[2, i] += parameters.point_tilt[entry, 1] * v[place + i]
    add_resistance(1.0, work.change[c], now, extra, moved, force)
    add_resistance(-1.0, work.factored[point, tool], work.factored_patch[point, tool], none, moved, force)
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place = 3 * model.point_place[entry]
        if place >= 0:
            for i in range(3):
                out[place + i] += (
                    parameters.point_weight[entry] * force[0, i]
                    + parameters.point_tilt[entry, 0] * force[1, i]
                    + parameters.point_tilt[entry, 1] * force[2, i]
                )


@njit(cache=True, error_model="numpy")
def add_resistance(sign, block, patch, extra, moved, force):
    """force (3, 3) += sign times what a patch resists with, at its point and at its edges, where these move so (3, 3).

    block  tangent of its force (3, 3), b b^T of which acts where its patch is stiff, eq. (4) of kernels/contact.py
    patch  b, lean and spread as in work.factored_patch (10,)
    extra  a (3,), of a b^T, the part of the tangent by which friction goes with pressure
    """
    s, t, stiff_s, stiff_t = patch[LEANS], patch[LEANS + 1], patch[SPREADS], patch[SPREADS + 1]
    at_point = by_u = by_v = 0.0
    for i in range(3):
        at_point += patch[i] * moved[0, i]
        by_u += patch[i] * moved[1, i]
        by_v += patch[i] * moved[2, i]
    stiff = at_point + stiff_s * by_u + stiff_t * by_v
    ahead = stiff - (at_point + s * by_u + t * by_v)
    turn_u = patch[SPREADS + 2] * by_u + patch[SPREADS + 3] * by_v
    turn_v = patch[SPREADS + 3] * by_u + patch[SPREADS + 4] * by_v
    for i in range(3):
        f = (patch[i] + extra[i]) * ahead
        for j in range(3):
            f += block[i, j] * (moved[0, j] + s * moved[1, j] + t * moved[2, j])
        force[0, i] += sign * f
        force[1, i] += sign * (s * f + patch[i] * ((stiff_s - s) * stiff + turn_u))
        force[2, i] += sign * (t * f + patch[i] * ((stiff_t - t) * stiff + turn_v))


@njit(cache=True, error_model="numpy")
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
