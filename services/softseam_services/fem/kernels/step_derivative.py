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

import numpy as np

from softseam_services.jit import njit

from .anderson import add_scaled, dot
from .contact_columns import EDGED, OPEN, SWEPT
from .contact_derivative import BY_FRICTION, BY_PENALTY, differentiate_contacts
from .contact_spread import (
    ACTING,
    POINT,
    acting,
    add_by_edges,
    add_by_lean,
    collect,
    dot3,
    lean_owes,
    spread,
    spread_by_edges,
    spread_by_lean,
    times,
    times_transposed,
)
from .fronts import solve
from .gmres import add_solution, begin_krylov, extend_krylov
from .tangent_product import multiply_tangent


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
            acting(c, work, force)
            spread(c, ACTING, 1.0, force, model, parameters, work, inner)
    differentiate_contacts(now.x, now.v, dt, x, now.contact, model, parameters, tools, count, work, slopes)


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
                collect(c, ACTING, v, model, parameters, work, moved)
                times_transposed(slopes.place[c], 3, moved, force)
                spread_by_edges(c, -1.0, moved, model, parameters, work, slopes, out)
                spread_by_lean(c, -1.0, v, model, parameters, work, slopes, out)
                spread(c, POINT, -1.0, force, model, parameters, work, out)
            else:
                collect(c, POINT, v, model, parameters, work, moved)
                times(slopes.place[c], 0, moved, force)
                add_by_edges(c, v, model, parameters, work, slopes, force)
                add_by_lean(c, -1.0, v, model, parameters, work, slopes, out)
                spread(c, ACTING, -1.0, force, model, parameters, work, out)


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
        times_transposed(slopes.place[c], 6, seed, back)
        spread(c, POINT, 1.0, back, model, parameters, work, right)
        spread_by_edges(c, 1.0, seed, model, parameters, work, slopes, right)


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
            collect(c, ACTING, w, model, parameters, work, y)
            for i in range(3):
                slopes.seed[c, i] += y[i]
            if work.side[c] == EDGED:
                lean_owes(c, w, model, parameters, work, y)
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
    times_transposed(slopes.multiplier[c], 6, seed, back)
    for i in range(3):
        owed.force[point, tool, i] += back[i]
    times_transposed(slopes.place[c], 6, seed, back)
    for i in range(3):
        owed.tool_end[tool, i] += seed[3 + i] - back[i]
    times_transposed(slopes.since[c], 6, seed, back)
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
    times_transposed(slopes.met[c, 0], 3, seed, start)
    times_transposed(slopes.met[c, 1], 3, seed, end)
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
            spread(c, ACTING, 1.0, slopes.seed[c], model, parameters, work, right)
            if work.side[c] == EDGED:
                acting(c, work, force)
                for which in range(2):
                    moved = -dot3(slopes.lean[c, which, POINT], change.tool_end[work.pair[c, 1]])
                    spread(c, which, moved, force, model, parameters, work, right)


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
        collect(c, POINT, w, model, parameters, work, moved)
        times(slopes.place[c], 0, moved, force)
        add_by_edges(c, w, model, parameters, work, slopes, force)
        times(slopes.place[c], 3, moved, anchor)
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
