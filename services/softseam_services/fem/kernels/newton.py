"""One implicit Euler step: Newton's method with a factor that is kept as long as it serves.

With x_hat = x0 + dt v0 the step's end x makes the residual vanish:
  r(x) = f_ext - f(x) + f_contact(x) - M (x - x_hat)/dt^2                                                       (1)
The matrix M/dt^2 + K has columns whose sum is M/dt^2 alone on a free body, so a full Newton step, with an old factor
or a new one, leaves the sum of r zero: momentum is exact to rounding however early the iteration ends.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.fem.kernels.cells import add_cell_tangents, subtract_forces
from softseam_services.fem.kernels.contact import add_contact_forces, add_contact_tangents, evaluate_contacts
from softseam_services.fem.kernels.fronts import add_diagonal, factor, solve

CONVERGED, STALLED, INDEFINITE, NOT_FINITE = 0, 1, 2, 3
# entries of `memo`, what is known of the factor in work.values
FACTORED, FACTOR_DT, LEAST_J, WORST_CELL, N_FACTORS = 0, 1, 2, 3, 4
N_MEMO = 5

# A kept factor costs iterations, a new one about as much as eight of them; its rate shows after a few.
_PATIENCE = 8.0
_TRIALS = 3
# A step moves no node by more than this share of a cell edge, so that elements do not turn over on the way.
_LIMIT = 0.3
_CAREFUL_LIMIT = 0.1


@njit(cache=True, error_model="numpy")
def residual(x, model, tools, count, dt, work, memo):
    """Eq. (1) into work.r (3 n_free,), elimination order; returns how many contacts the factor lacks."""
    r = work.r
    inverse_square = 1.0 / (dt * dt)
    for node in range(len(model.mass)):
        place = model.order[node]
        if place >= 0:
            inertia = model.mass[node] * inverse_square
            for i in range(3):
                r[3 * place + i] = work.force[node, i] - inertia * (x[node, i] - work.x_hat[node, i])
    memo[LEAST_J], memo[WORST_CELL] = subtract_forces(x, model, work, r)
    missing = evaluate_contacts(x, model, tools, count, work)
    add_contact_forces(model, count, work, r)
    return missing


@njit(cache=True, error_model="numpy")
def refactor(x, model, tree, tools, count, dt, safe, work, memo):
    """Assemble and factor M/dt^2 + K at x; residual(x) came before. Returns True where that succeeded.

    Where the matrix is indefinite, or `safe` is set, cells use their positive semi-definite tangents.
    """
    memo[FACTORED] = 0.0
    for attempt in range(1 if safe else 0, 2):
        work.values[:] = 0.0
        add_diagonal(tree, work.values, model.mass, 1.0 / (dt * dt))
        add_cell_tangents(x, model, tree, work, attempt == 1)
        add_contact_tangents(model, tools, tree, count, work)
        memo[N_FACTORS] += 1.0
        if factor(tree, work.values, work.ints) == 0:
            memo[FACTORED] = 1.0
            memo[FACTOR_DT] = dt
            return True
    return False


@njit(cache=True, error_model="numpy")
def _solve(tree, work):
    """work.d <- A^-1 work.r; returns the largest entry, which is not finite where one of them is not."""
    work.d[:] = work.r
    solve(tree, work.values, work.d, work.t, work.ints)
    return _largest(work.d)


@njit(cache=True, error_model="numpy")
def _largest(values):
    largest = 0.0
    for i in range(len(values)):
        size = abs(values[i])
        if not size <= largest:
            largest = size
    return largest


@njit(cache=True, error_model="numpy")
def _accelerate(known, work):
    """Anderson acceleration of x <- x + d, d = A^-1 r; work.dx is the last step, and the next one on return.

    With D = (differences of d), S = (differences of x) + D over the last iterations, the step is d - S g with g the
    least-squares solution of D g = d (Walker & Ni, SIAM J. Numer. Anal. 49, 2011, eq. 2.1). The columns of D are kept
    orthonormal (work.q) and those of S transformed alike (work.s), so g = work.q d. Every column keeps the sum of M x,
    so momentum stays exact. Returns how many columns are known.
    """
    memory = len(work.q)
    if known >= 0:
        column = known % memory
        q, s = work.q[column], work.s[column]
        q[:] = work.d - work.d_last
        s[:] = work.dx + q
        before = np.sqrt(np.dot(q, q))
        for other in range(min(known + 1, memory)):
            if other != column:
                along = np.dot(work.q[other], q)
                q -= along * work.q[other]
                s -= along * work.s[other]
        size = np.sqrt(np.dot(q, q))
        if size > 1e-6 * before:
            q /= size
            s /= size
            known += 1
        else:
            q[:] = 0.0
            s[:] = 0.0
    else:
        known = 0
    step = work.dx
    work.d_last[:] = work.d
    step[:] = work.d
    for column in range(min(known, memory)):
        step -= np.dot(work.q[column], work.d) * work.s[column]
    return known


@njit(cache=True, error_model="numpy")
def _move(x, model, step, scale):
    """x (n, 3) += scale * step (3 n_free,), in place."""
    for node in range(len(model.mass)):
        place = model.order[node]
        if place >= 0:
            x[node, 0] += scale * step[3 * place]
            x[node, 1] += scale * step[3 * place + 1]
            x[node, 2] += scale * step[3 * place + 2]


@njit(cache=True, error_model="numpy")
def newton(x, model, tree, tools, count, dt, tolerance, most, work, memo):
    """Iterate x (n, 3) in place until no coordinate moves by `tolerance` [m]; returns status and iterations.

    The factor at hand is tried first; a new one is made where contacts are missing in it or convergence is slow.
    """
    known, since, first = -1, 0, 0.0
    for iteration in range(1, most + 1):
        missing = residual(x, model, tools, count, dt, work, memo)
        fresh = False
        if missing > 0 or memo[FACTORED] == 0.0 or memo[FACTOR_DT] != dt:
            if not refactor(x, model, tree, tools, count, dt, False, work, memo):
                return INDEFINITE, iteration
            fresh = True
        largest = _solve(tree, work)
        if not fresh and largest > tolerance and since > 0 and _too_slow(largest, first, tolerance, since):
            if not refactor(x, model, tree, tools, count, dt, False, work, memo):
                return INDEFINITE, iteration
            largest = _solve(tree, work)
            fresh = True
        if not np.isfinite(largest):
            return NOT_FINITE, iteration
        if fresh or since == 0:
            known, since, first = -1, 0, largest
        since += 1
        known = _accelerate(known, work)
        moved = _largest(work.dx)
        if moved > _LIMIT * model.edge:
            work.dx[:] *= _LIMIT * model.edge / moved
        _move(x, model, work.dx, 1.0)
        if largest <= tolerance and moved <= tolerance:
            return CONVERGED, iteration
    return STALLED, most


@njit(cache=True, error_model="numpy")
def _too_slow(largest, first, tolerance, since):
    """Whether the mean rate so far asks for more iterations than a new factor costs."""
    if largest > 2.0 * first:
        return True
    if since < _TRIALS:
        return False
    rate = (largest / first) ** (1.0 / since)
    return rate >= 1.0 or np.log(tolerance / largest) < _PATIENCE * np.log(rate)


@njit(cache=True, error_model="numpy")
def newton_carefully(x, model, tree, tools, count, dt, tolerance, most, work, memo):
    """As `newton`, with a new, positive semi-definite matrix every time, short steps, and a line search along each."""
    slope = 0.0
    for iteration in range(1, most + 1):
        residual(x, model, tools, count, dt, work, memo)
        if iteration > 1:
            # where the residual along the last step changed sign by much, go part of the way back
            ahead = np.dot(work.r, work.dx)
            if ahead < -0.5 * slope:
                _move(x, model, work.dx, slope / (slope - ahead) - 1.0)
                residual(x, model, tools, count, dt, work, memo)
        if not refactor(x, model, tree, tools, count, dt, True, work, memo):
            return INDEFINITE, iteration
        largest = _solve(tree, work)
        if not np.isfinite(largest):
            return NOT_FINITE, iteration
        scale = min(1.0, _CAREFUL_LIMIT * model.edge / largest) if largest > 0.0 else 1.0
        work.dx[:] = scale * work.d
        slope = np.dot(work.r, work.dx)
        _move(x, model, work.dx, 1.0)
        if largest <= tolerance:
            return CONVERGED, iteration
    return STALLED, most
