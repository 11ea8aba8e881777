"""Derivatives of one step of implicit Euler, backward (the adjoint) and forward: exact ones of the map that steps are.

A step finds x where, with c = 1/dt^2, contact forces f_k at points W_k x, and the multipliers and anchors of the step
before (kernels/contact.py),
  c M (x - x_0 - dt v_0) + f(x) - f_ext - sum_k W_k^T f_k(W_k x, ...) = 0,   v = (x - x_0)/dt                      (1)
and hands on f_k and the anchors a_k. Its matrix J = c M + K - sum W^T C W, C = df_k/dx, is not symmetric where points
slip. With X, V, L, B what a number owes to x, v, f, a at the end of the step, and C_z, A_z the derivatives of force and
anchor by an input z (kernels/contact_derivative.py), what it owes to the start and to the inputs follows from
  J^T w = X + V/dt + sum W^T (C^T L + A_x^T B),   y = W w + L                                                   (2)
  X <- c M w - V/dt + ...,   V <- c dt M w,   z <- C_z^T y + A_z^T B,   E <- -w . df/dE + ...                     (3)
where the dots are of points without an anchor, whose s is their place when the step begins. Forward, a change d of
the start and of inputs moves the end by
  J dx = c M (dx_0 + dt dv_0) - df/dE dE + sum W^T C_z dz                                                        (4)
The textbook's recursion lambda_(t-1) = (df_t/dx_t)^T lambda_t is that of explicit steps, x_t = f_t(x_(t-1)): for
equations f_t = 0 it must solve, and each step adds its own part of the loss: (2) and (3).

J is not factored: GMRES (kernels/gmres.py) solves with the symmetric factor of a step near by.
"""

from __future__ import annotations

import numpy as np

from softseam_services.fem.kernels.anderson import add_scaled
from softseam_services.fem.kernels.contact import EDGED, NORMAL, OPEN, PRESSURE, SWEPT, TRACTION, acting_weight
from softseam_services.fem.kernels.contact_derivative import BY_FRICTION, BY_PENALTY, differentiate_contacts
from softseam_services.fem.kernels.dot import dot
from softseam_services.fem.kernels.fronts import solve
from softseam_services.fem.kernels.gmres import add_solution, begin_krylov, extend_krylov
from softseam_services.fem.kernels.tangent_product import multiply_tangent
from softseam_services.jit import njit

POINT, ACTING = 2, 3
"""where W of `_spread` is: at a candidate's point, or where its force acts"""


@njit(cache=True, error_model="numpy", nogil=True)
def differentiate(model, parameters, now, end, tools, dt, count, work, slopes):
    """Fill `slopes` where `kernels.step.advance` has just retraced a step.

    slopes.inner <- f(x) (3 n_free,) in elimination order: what balances all else but the residual.
    """
    inertia, x, inner = 1.0 / (dt * dt), end.x, slopes.inner
    for node in range(len(model.order)):
        place = 3 * model.order[node]
        if place >= 0:
            for i in range(3):
                away = x[node, i] - work.x_hat[node, i]
                inner[place + i] = work.force[node, i] - parameters.mass[node] * inertia * away - work.r[place + i]
    force = np.empty(3)
    for c in range(count):
        if work.state[c] != OPEN:
            _acting(c, work, force)
            _spread(c, ACTING, 1.0, force, model, parameters, work, inner)
    differentiate_contacts(now.x, now.v, dt, x, now.contact, model, parameters, tools, count, work, slopes)


@njit(cache=True, error_model="numpy", inline="always")
def _weight(c, entry, which, parameters, work):
    """Of a node, at a candidate's place in `_spread` and `_collect`."""
    if which == POINT:
        return parameters.point_weight[entry]
    if which == ACTING:
        return acting_weight(c, entry, parameters, work)
    return parameters.point_tilt[entry, which]


@njit(cache=True, error_model="numpy")
def _spread(c, which, scale, vector, model, parameters, work, out):
    """out += scale W^T vector (3,) of a candidate, at free nodes: W of its point, of where its force acts, or of one of
    its patch's edges, 0 or 1."""
    point = work.pair[c, 0]
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place, weight = 3 * model.point_place[entry], scale * _weight(c, entry, which, parameters, work)
        if place >= 0:
            out[place] += weight * vector[0]
            out[place + 1] += weight * vector[1]
            out[place + 2] += weight * vector[2]


@njit(cache=True, error_model="numpy")
def _collect(c, which, values, model, parameters, work, out):
    """out (3,) <- W values of a candidate, as in `_spread`; values (3 n_free,)."""
    point = work.pair[c, 0]
    out[0] = out[1] = out[2] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place, weight = 3 * model.point_place[entry], _weight(c, entry, which, parameters, work)
        if place >= 0:
            out[0] += weight * values[place]
            out[1] += weight * values[place + 1]
            out[2] += weight * values[place + 2]


@njit(cache=True, error_model="numpy", inline="always")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def _add_by_edges(c, values, model, parameters, work, slopes, force):
    """force (3,) += what a change of the edges of a candidate's patch makes of it; values (3 n_free,)."""
    if work.side[c] != EDGED:
        return
    change = np.empty(3)
    for which in range(2):
        _collect(c, which, values, model, parameters, work, change)
        for i in range(3):
            force[i] += _dot(slopes.edges[c, which, i], change)


@njit(cache=True, error_model="numpy")
def _spread_by_edges(c, scale, vector, model, parameters, work, slopes, out):
    """out += the transpose of `_add_by_edges`, times scale and a vector (3,), at free nodes."""
    if work.side[c] != EDGED:
        return
    back = np.empty(3)
    for which in range(2):
        _times_transposed(slopes.edges[c, which], 3, vector, back)
        _spread(c, which, scale, back, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def _add_by_lean(c, scale, values, model, parameters, work, slopes, out):
    """out += scale times what the force does as it moves on a candidate's patch; values (3 n_free,)."""
    if work.side[c] != EDGED:
        return
    change, force = np.empty(3), np.empty(3)
    moved = np.zeros(2)
    for which in (0, 1, POINT):
        _collect(c, which, values, model, parameters, work, change)
        for along in range(2):
            moved[along] += scale * _dot(slopes.lean[c, along, which], change)
    _acting(c, work, force)
    for along in range(2):
        _spread(c, along, moved[along], force, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def _spread_by_lean(c, scale, values, model, parameters, work, slopes, out):
    """out += the transpose of `_add_by_lean`, times scale, of values (3 n_free,)."""
    if work.side[c] != EDGED:
        return
    back, moves = np.empty(3), np.empty(2)
    _lean_owes(c, values, model, parameters, work, moves)
    for which in (0, 1, POINT):
        for j in range(3):
            back[j] = moves[0] * slopes.lean[c, 0, which, j] + moves[1] * slopes.lean[c, 1, which, j]
        _spread(c, which, scale, back, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def _acting(c, work, force):
    """force (3,) [N] <- that of a candidate."""
    row = work.contact[c]
    for i in range(3):
        force[i] = row[PRESSURE] * row[NORMAL + i] + row[TRACTION + i]


@njit(cache=True, error_model="numpy")
def _lean_owes(c, values, model, parameters, work, moves):
    """moves (2,) [N m] <- what values (3 n_free,) make of the force's moving along each edge of its patch."""
    force, change = np.empty(3), np.empty(3)
    _acting(c, work, force)
    for which in range(2):
        _collect(c, which, values, model, parameters, work, change)
        moves[which] = _dot(force, change)


@njit(cache=True, error_model="numpy")
def _times(matrix, first, vector, out):
    """out (3,) <- three rows of matrix (6, 3) from `first` on, times vector (3,)."""
    for i in range(3):
        row = matrix[first + i]
        out[i] = row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2]


@njit(cache=True, error_model="numpy")
def _times_transposed(matrix, rows, vector, out):
    """out (3,) <- the transpose of the first rows of matrix (6, 3), times vector (rows,)."""
    for i in range(3):
        out[i] = 0.0
        for k in range(rows):
            out[i] += matrix[k, i] * vector[k]


@njit(cache=True, error_model="numpy")
def _apply(transposed, x, inertia, model, parameters, count, v, work, slopes, out):
    """out <- J v, or J^T v (3 n_free,) in elimination order; work.r is scratch."""
    multiply_tangent(x, v, model, parameters, work, slopes.x, out)
    for node in range(len(x)):
        place = 3 * model.order[node]
        if place >= 0:
            for i in range(3):
                out[place + i] += inertia * parameters.mass[node] * v[place + i]
    moved, force = np.empty(3), np.empty(3)
    for c in range(count):
        if work.state[c] != OPEN:
            if transposed:
                _collect(c, ACTING, v, model, parameters, work, moved)
                _times_transposed(slopes.place[c], 3, moved, force)
                _spread_by_edges(c, -1.0, moved, model, parameters, work, slopes, out)
                _spread_by_lean(c, -1.0, v, model, parameters, work, slopes, out)
                _spread(c, POINT, -1.0, force, model, parameters, work, out)
            else:
                _collect(c, POINT, v, model, parameters, work, moved)
                _times(slopes.place[c], 0, moved, force)
                _add_by_edges(c, v, model, parameters, work, slopes, force)
                _add_by_lean(c, -1.0, v, model, parameters, work, slopes, out)
                _spread(c, ACTING, -1.0, force, model, parameters, work, out)


@njit(cache=True, error_model="numpy", nogil=True)
def solve_whole(transposed, model, parameters, x, dt, count, tolerance, work, slopes, w):
    """w (3 n_free,) <- the solution of J w = slopes.right, or of J^T w, from the guess that is there; in place.

    Returns iterations, -1 where these were not enough; `tolerance` is relative to w, as the factor weighs it.
    """
    tree, basis, h, d, inertia = model.tree, slopes.basis, slopes.hessenberg, slopes.d, 1.0 / (dt * dt)
    _apply(transposed, x, inertia, model, parameters, count, w, work, slopes, d)
    for i in range(len(d)):
        d[i] = slopes.right[i] - d[i]
    solve(tree, work.values, d, work.factoring)
    left = first = np.sqrt(dot(d, d))
    size = 0.0
    for i in range(len(d)):
        size += (w[i] + d[i]) ** 2
    enough = tolerance * np.sqrt(size)
    if first <= enough:
        add_scaled(w, 1.0, d)
        return 0
    begin_krylov(d, first, basis, h)
    n = 0
    while n < len(basis) - 1 and left > enough:
        _apply(transposed, x, inertia, model, parameters, count, basis[n], work, slopes, d)
        solve(tree, work.values, d, work.factoring)
        left = extend_krylov(n, d, basis, h)
        n += 1
    add_solution(n, basis, h, w)
    return n if left <= enough else -1


@njit(cache=True, error_model="numpy", nogil=True)
def begin_back(model, parameters, dt, count, owed, work, slopes):
    """slopes.right and seeds <- the right side of eq. (2), of what is owed to the end of a step."""
    right, back = slopes.right, np.empty(3)
    for node in range(len(model.order)):
        place = 3 * model.order[node]
        if place >= 0:
            for i in range(3):
                right[place + i] = owed.x[node, i] + owed.v[node, i] / dt
    for c in range(count):
        point, tool, seed = work.pair[c, 0], work.pair[c, 1], slopes.seed[c]
        if work.state[c] == OPEN:
            continue
        for i in range(3):
            seed[i] = owed.force[point, tool, i] - owed.tool_force[tool, i]
            seed[3 + i] = owed.anchor[point, tool, i]
        _times_transposed(slopes.place[c], 6, seed, back)
        _spread(c, POINT, 1.0, back, model, parameters, work, right)
        _spread_by_edges(c, 1.0, seed, model, parameters, work, slopes, right)


@njit(cache=True, error_model="numpy", nogil=True)
def finish_back(model, parameters, dt, count, owed, work, slopes):
    """Eq. (3): with the solution in owed.w, what was owed to the end of a step is owed to its start, in place."""
    inertia, w, y = 1.0 / (dt * dt), owed.w, np.empty(3)
    for node in range(len(model.order)):
        place = 3 * model.order[node]
        for i in range(3):
            pulled = inertia * parameters.mass[node] * w[place + i] if place >= 0 else 0.0
            owed.x[node, i] = pulled - (owed.v[node, i] / dt if place >= 0 else 0.0)
            owed.v[node, i] = dt * pulled
    owed.force[:] = 0.0
    owed.anchor[:] = 0.0
    owed.young[0] -= dot(w, slopes.inner)
    for c in range(count):
        if work.state[c] != OPEN:
            _collect(c, ACTING, w, model, parameters, work, y)
            for i in range(3):
                slopes.seed[c, i] += y[i]
            if work.side[c] == EDGED:
                _lean_owes(c, w, model, parameters, work, y)
                for i in range(3):
                    by_place = y[0] * slopes.lean[c, 0, POINT, i] + y[1] * slopes.lean[c, 1, POINT, i]
                    owed.tool_end[work.pair[c, 1], i] -= by_place
            _pull_contact(c, model, parameters, owed, work, slopes)
            if work.side[c] == SWEPT:
                _pull_met(c, model, parameters, dt, owed, work, slopes)


@njit(cache=True, error_model="numpy")
def _pull_contact(c, model, parameters, owed, work, slopes):
    """Eq. (3) of a candidate's inputs, from its seed (y, B)."""
    point, tool, seed, back = work.pair[c, 0], work.pair[c, 1], slopes.seed[c], np.empty(3)
    _times_transposed(slopes.multiplier[c], 6, seed, back)
    for i in range(3):
        owed.force[point, tool, i] += back[i]
    _times_transposed(slopes.place[c], 6, seed, back)
    for i in range(3):
        owed.tool_end[tool, i] += seed[3 + i] - back[i]
    _times_transposed(slopes.since[c], 6, seed, back)
    for i in range(3):
        owed.tool_start[tool, i] += back[i]
        if slopes.anchored[c]:
            owed.anchor[point, tool, i] -= back[i]
    if not slopes.anchored[c]:
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            for i in range(3):
                owed.x[model.point_node[entry], i] -= parameters.point_weight[entry] * back[i]
    for row in range(6):
        owed.young[0] += slopes.penalty[c] * slopes.numbers[c, row, BY_PENALTY] * seed[row]
        owed.friction[tool] += parameters.friction_factor[point] * slopes.numbers[c, row, BY_FRICTION] * seed[row]


@njit(cache=True, error_model="numpy")
def _pull_met(c, model, parameters, dt, owed, work, slopes):
    """Eq. (3) of where a point that meets a plane comes from and flies to."""
    point, tool, seed = work.pair[c, 0], work.pair[c, 1], slopes.seed[c]
    start, end = np.empty(3), np.empty(3)
    _times_transposed(slopes.met[c, 0], 3, seed, start)
    _times_transposed(slopes.met[c, 1], 3, seed, end)
    for i in range(3):
        owed.tool_start[tool, i] -= start[i]
        owed.tool_end[tool, i] -= end[i]
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            node, weight = model.point_node[entry], parameters.point_weight[entry]
            owed.x[node, i] += weight * (start[i] + end[i])
            owed.v[node, i] += weight * dt * end[i]


@njit(cache=True, error_model="numpy", nogil=True)
def begin_forward(model, parameters, dt, count, change, work, slopes):
    """slopes.right and seeds <- the right side of eq. (4), of a change of a step's start, of tools and of numbers."""
    inertia, right, force = 1.0 / (dt * dt), slopes.right, np.empty(3)
    for node in range(len(model.order)):
        place = 3 * model.order[node]
        if place >= 0:
            for i in range(3):
                ahead = inertia * parameters.mass[node] * (change.x[node, i] + dt * change.v[node, i])
                right[place + i] = ahead - change.young[0] * slopes.inner[place + i]
    for c in range(count):
        if work.state[c] != OPEN:
            _push_contact(c, model, parameters, change, work, slopes)
            if work.side[c] == SWEPT:
                _push_met(c, model, parameters, dt, change, work, slopes)
            _spread(c, ACTING, 1.0, slopes.seed[c], model, parameters, work, right)
            if work.side[c] == EDGED:
                _acting(c, work, force)
                for which in range(2):
                    moved = -_dot(slopes.lean[c, which, POINT], change.tool_end[work.pair[c, 1]])
                    _spread(c, which, moved, force, model, parameters, work, right)


@njit(cache=True, error_model="numpy", nogil=True)
def finish_forward(model, parameters, dt, count, change, work, slopes):
    """With the solution of eq. (4) in change.w, the change of a step's start becomes that of its end, in place.

    change.tool_force (t, 3) <- of the forces on tools.
    """
    w = change.w
    for node in range(len(model.order)):
        place = 3 * model.order[node]
        if place >= 0:
            for i in range(3):
                change.v[node, i] = (w[place + i] - change.x[node, i]) / dt
                change.x[node, i] = w[place + i]
    change.force[:] = 0.0
    change.anchor[:] = 0.0
    change.tool_force[:] = 0.0
    moved, force, anchor = np.empty(3), np.empty(3), np.empty(3)
    for c in range(count):
        if work.state[c] == OPEN:
            continue
        point, tool, seed = work.pair[c, 0], work.pair[c, 1], slopes.seed[c]
        _collect(c, POINT, w, model, parameters, work, moved)
        _times(slopes.place[c], 0, moved, force)
        _add_by_edges(c, w, model, parameters, work, slopes, force)
        _times(slopes.place[c], 3, moved, anchor)
        for i in range(3):
            change.force[point, tool, i] = seed[i] + force[i]
            change.anchor[point, tool, i] = seed[3 + i] + anchor[i]
            change.tool_force[tool, i] -= seed[i] + force[i]


@njit(cache=True, error_model="numpy")
def _push_contact(c, model, parameters, change, work, slopes):
    """The seed of a candidate <- change of its force and anchor by inputs of eq. (4), its place at the end apart."""
    point, tool, seed = work.pair[c, 0], work.pair[c, 1], slopes.seed[c]
    since = np.empty(3)
    for i in range(3):
        since[i] = change.tool_start[tool, i]
        if slopes.anchored[c]:
            since[i] -= change.anchor[point, tool, i]
    if not slopes.anchored[c]:
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            for i in range(3):
                since[i] -= parameters.point_weight[entry] * change.x[model.point_node[entry], i]
    penalty = slopes.penalty[c] * change.young[0]
    friction = parameters.friction_factor[point] * change.friction[tool]
    for row in range(6):
        total = change.tool_end[tool, row - 3] if row >= 3 else 0.0
        total += slopes.numbers[c, row, BY_PENALTY] * penalty + slopes.numbers[c, row, BY_FRICTION] * friction
        for i in range(3):
            total += slopes.multiplier[c, row, i] * change.force[point, tool, i]
            total += slopes.since[c, row, i] * since[i]
            total -= slopes.place[c, row, i] * change.tool_end[tool, i]
        seed[row] = total


@njit(cache=True, error_model="numpy")
def _push_met(c, model, parameters, dt, change, work, slopes):
    """Add to the seed of a candidate the change of the plane that its point meets."""
    point, tool, seed = work.pair[c, 0], work.pair[c, 1], slopes.seed[c]
    start, end = np.empty(3), np.empty(3)
    for i in range(3):
        start[i], end[i] = -change.tool_start[tool, i], -change.tool_end[tool, i]
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            node, weight = model.point_node[entry], parameters.point_weight[entry]
            start[i] += weight * change.x[node, i]
            end[i] += weight * (change.x[node, i] + dt * change.v[node, i])
    for row in range(3):
        for i in range(3):
            seed[row] += slopes.met[c, 0, row, i] * start[i] + slopes.met[c, 1, row, i] * end[i]
