"""One implicit step: Newton's method with a factor that is kept as long as it serves.

With the integrator's share_M = `inertia` [1/s^2] and x_hat (`integrators.scheme`) the step's end x makes the residual
vanish, where x_t = x0 + share (x - x0), and f is that of a viscous material, too (kernels/viscosity.py):
  r(x) = f_ext - f(x_t) + f_contact(x) - inertia M (x - x_hat)                                                  (1)
The matrix inertia M + share K has columns whose sum is inertia M alone on a free body, so a full Newton step, with an
old factor or a new one, leaves the sum of r zero: momentum is exact to rounding however early it ends. A factor that
has contacts in it would not, so none of these outlives the last contact.
"""

import numpy as np

from softseam_services.fem.integrators.scheme import begin
from softseam_services.jit import njit

from .anderson import accelerate, dot
from .candidates import find_candidates
from .contact import add_contact_forces, any_held, evaluate_contacts, firm_way, hold_what_stuck, lets_go
from .contact_changes import solve_with_changes
from .contact_columns import OPEN, RELAXED
from .contact_tangents import add_contact_tangents
from .elements import add_cell_tangents, subtract_forces
from .fronts import add_diagonal, add_seam_stiffness, factor, hold, seam_inverse, solve
from .lapack import multiply
from .viscosity import add_viscous_tangents, subtract_viscous
from .viscous_start import resist

CONVERGED, STALLED, INDEFINITE, NOT_FINITE = 0, 1, 2, 3
# entries of work.memo, what is known of the factor in work.values
FACTORED, FACTOR_INERTIA, LEAST_J, WORST_CELL, N_FACTORS, FACTOR_TOUCHES, FACTOR_KEEPS, N_CANDIDATES = (
    0, 1, 2, 3, 4, 5, 6, 7,
)  # fmt: skip
N_MEMO = 8

# A kept factor costs iterations, a new one about as much as twelve of them; its rate shows after a few.
_PATIENCE = 12.0
_TRIALS = 4
# A step that is this many iterations under way is in trouble: from then on what changed at settled contacts is solved
# for where more iterations than `_WORTH` are to come. What is left shall shrink by `_ENOUGH` of what it should, or that
# step is halved, down to `_SHORTEST`; then none is tried for `_PROBATION`. A rate of whole ones that is worse than
# `_STALE` is the elements', who want a new factor.
_TROUBLE = 15
_WORTH = 3.0
_PROBATION = 5
_STALE = 0.3
_SHORTEST = 0.25
_ENOUGH = 1e-2
# Corrections by a factor with contacts that are open are not believed to be small after more iterations than that.
_SOON = 7
# Contacts that open and close by turns stay in a factor after so many for contacts that it lacked.
_OFTEN = 2
# A step moves no node by more than this share of a cell edge, so that elements do not turn over on the way.
_LIMIT = 0.3
_CAREFUL_LIMIT = 0.1
# A first guess closer to the start of the step than this share of a cell edge is not worth a doubt.
_FAR = 1e-3
# An error of position may change the pressure of all contacts together by this part of it; and no need to be finer than
# this share of a cell edge for its sake.
_FIRM = 1e-2
_FINEST = 1e-7
_FIRST = 0.1
# Points closer to a tool than this share of a cell edge are in a new factor as if they touched.
_AHEAD = 1e-3


@njit(cache=True, error_model="numpy")
def seam_pull(x, model, work):
    """work.seam_actual (s, 3) <- stiffness (anchor - x): what the other side adds to the seam force [N]."""
    n = 3 * len(model.seam)
    away = work.seam_away
    for t in range(len(model.seam)):
        node = model.seam[t]
        for k in range(3):
            away[3 * t + k, 0] = work.seam_target[t, k] - x[node, k]
    multiply(work.seam_impedance, away, work.seam_actual, n, 1, n, False, work.ints)


@njit(cache=True, error_model="numpy")
def _inside(x, x0, share, work):
    """x_t (n, 3) of eq. (1): x itself, or work.inside."""
    if share == 1.0:
        return x
    for node in range(len(x)):
        for i in range(3):
            work.inside[node, i] = x0[node, i] + share * (x[node, i] - x0[node, i])
    return work.inside


@njit(cache=True, error_model="numpy")
def residual(x, x0, model, parameters, tools, count, inertia, share, work):
    """Eq. (1) into work.r (3 n_free,), elimination order; returns how many contacts the factor lacks."""
    r = work.r
    for node in range(len(model.order)):
        place = model.order[node]
        if place >= 0:
            mass = parameters.mass[node] * inertia
            for i in range(3):
                r[3 * place + i] = work.force[node, i] - mass * (x[node, i] - work.x_hat[node, i])
    if work.seam_coupled[0]:
        seam_pull(x, model, work)
        for s in range(len(model.seam)):
            for i in range(3):
                r[3 * model.order[model.seam[s]] + i] += work.seam_actual[s, i]
    inside = _inside(x, x0, share, work)
    work.memo[LEAST_J], work.memo[WORST_CELL] = subtract_forces(inside, model, parameters, work, r)
    if work.viscous[0] > 0.0:
        subtract_viscous(inside, x0, model, parameters, work, r)
    missing = evaluate_contacts(x, model, parameters, tools, count, work)
    add_contact_forces(model, parameters, count, work, r)
    for h in range(len(model.rollers)):
        place = model.order[model.rollers[h, 0]]
        if place >= 0:
            r[3 * place + model.rollers[h, 1]] = 0.0
    return missing


@njit(cache=True, error_model="numpy")
def refactor(x, x0, model, parameters, tree, tools, count, inertia, share, safe, ahead, keep, work):
    """Assemble and factor inertia M + share K at x; residual(x) came before. Returns True where that succeeded.

    Points closer to a tool than `ahead` [m] count as touching, and with `keep` those of the last factor. Where the
    matrix is indefinite, or `safe` is set, cells use their positive semi-definite tangents.
    """
    work.memo[FACTORED] = 0.0
    if not keep:
        work.factored_state[:] = OPEN
    inside = _inside(x, x0, share, work)
    for attempt in range(1 if safe else 0, 2):
        for i in range(len(work.values)):
            work.values[i] = 0.0
        add_diagonal(tree, work.values, parameters.mass, inertia / share)
        add_cell_tangents(inside, model, parameters, tree, work, attempt == 1)
        if work.viscous[0] > 0.0:
            add_viscous_tangents(inside, x0, model, parameters, tree, work, attempt == 1)
        if share != 1.0:
            for i in range(len(work.values)):
                work.values[i] *= share
        work.memo[FACTOR_TOUCHES] = add_contact_tangents(model, parameters, tree, count, ahead, work)
        if work.seam_coupled[0]:
            add_seam_stiffness(tree, work.values, work.seam_impedance)
        hold(tree, work.values, model.rollers)
        work.memo[N_FACTORS] += 1.0
        if factor(tree, work.values, work.factoring) == 0:
            work.memo[FACTORED] = 1.0
            work.memo[FACTOR_INERTIA] = inertia
            work.memo[FACTOR_KEEPS] = keep
            return True
    return False


@njit(cache=True, error_model="numpy")
def _largest(values):
    """Largest absolute value; not finite where one of them is not."""
    largest = 0.0
    for i in range(len(values)):
        size = abs(values[i])
        if not size <= largest:
            largest = size
    return largest


@njit(cache=True, error_model="numpy")
def _move(x, order, step, scale):
    """x (n, 3) += scale * step (3 n_free,), in place."""
    for node in range(len(order)):
        place = order[node]
        if place >= 0:
            x[node, 0] += scale * step[3 * place]
            x[node, 1] += scale * step[3 * place + 1]
            x[node, 2] += scale * step[3 * place + 2]


@njit(cache=True, error_model="numpy")
def farthest(x0, x):
    """Longest way of a node between two configurations [m]."""
    longest = 0.0
    for node in range(len(x0)):
        square = 0.0
        for i in range(3):
            square += (x[node, i] - x0[node, i]) ** 2
        longest = max(longest, square)
    return np.sqrt(longest)


@njit(cache=True, error_model="numpy")
def _back_to(x0, x, count, work):
    """Drop the first guess x for the start of the step, in place, where points that stuck are held; returns 0.0."""
    for node in range(len(x)):
        for i in range(3):
            x[node, i] = x0[node, i]
    hold_what_stuck(count, work)
    return 0.0


@njit(cache=True, error_model="numpy")
def _too_slow(largest, first, tolerance, since):
    """Whether the mean rate so far asks for more iterations than a new factor costs."""
    if largest <= tolerance or since == 0:
        return False
    if largest > 2.0 * first:
        return True
    if since < _TRIALS:
        return False
    rate = (largest / first) ** (1.0 / since)
    return rate >= 1.0 or np.log(tolerance / largest) < _PATIENCE * np.log(rate)


@njit(cache=True, error_model="numpy", forceinline=True)
def _is_worth(largest, before, enough, exact):
    """Whether corrections by the factor alone shrink too slowly, or would: the last step was not by it alone."""
    rate = largest / before
    return largest > enough and (exact or rate >= 1.0 or np.log(enough / largest) < _WORTH * np.log(rate))


@njit(cache=True, error_model="numpy", forceinline=True)
def newton(x, x0, model, parameters, tree, tools, count, inertia, share, settings, flies, work):
    """Iterate x (n, 3) in place until no coordinate moves by settings.tolerance [m]; returns status and iterations.

    The first guess is dropped for x0, the start of the step, where its correction is as large as its way from there: a
    tool stopped or turned. So is one that merely `flies` on where it loses its contacts (`lets_go`). From x0, points
    that stuck are held once (`hold_what_stuck`). The factor at hand is tried first, with Anderson acceleration; a
    new one is made where contacts are missing in it or convergence is slow. Where that goes on for long, what changed
    at contacts since the factor was made is solved for, too (kernels/contact_changes.py).
    careful: a new, positive semi-definite matrix every time, short steps, and a line search along each, until contacts
    are settled.
    """
    tolerance, most, careful = settings.tolerance, settings.most, settings.careful
    known, since, first, largest, moved = -1, 0, 0.0, np.inf, np.inf
    slope, left = -1.0, False
    plain, exact, renewed = np.inf, False, 0
    trusted = _TROUBLE
    length, part, settled = np.inf, 1.0, False
    made = work.memo[N_FACTORS]
    guessed = farthest(x0, x)
    limit = (_CAREFUL_LIMIT if careful else _LIMIT) * parameters.edge
    closer = -np.inf if careful else _AHEAD * parameters.edge
    if guessed < _FAR * parameters.edge and not careful:
        hold_what_stuck(count, work)
    for iteration in range(1, most + 1):
        if work.halt[0] != 0:
            return STALLED, iteration
        missing = residual(x, x0, model, parameters, tools, count, inertia, share, work)
        if flies and guessed > _FAR * parameters.edge and not careful and lets_go(parameters, tools, count, work):
            guessed = _back_to(x0, x, count, work)
            continue
        if careful and slope > 0.0:
            # where the residual along the last step changed sign by much, go part of the way back
            ahead = dot(work.r, work.dx)
            if ahead < -0.5 * slope:
                _move(x, model.order, work.dx, slope / (slope - ahead) - 1.0)
                slope = -1.0
                continue
        # the contact penalty makes an error of position one of force, which a light and stiff body feels
        firm = firm_way(count, work)
        enough = min(tolerance, max(_FIRM * firm, _FINEST * parameters.edge))
        before, long, was_exact, exact, whole, astray = plain, length, exact, False, False, False
        was_settled, settled = settled, work.turned[0] == 0
        ready = settled and iteration >= trusted and firm < np.inf
        renew = left or work.memo[FACTORED] == 0.0 or work.memo[FACTOR_INERTIA] != inertia
        renew = renew or (not was_exact and (careful or missing > 0))
        largest = 0.0
        for attempt in range(2):
            if renew:
                safe = careful and not ready
                ahead, often = -np.inf if left else closer, not careful and renewed > _OFTEN
                keep = missing > 0 and not left and often
                renewed += missing > 0
                if not refactor(x, x0, model, parameters, tree, tools, count, inertia, share, safe, ahead, keep, work):
                    return INDEFINITE, iteration
                since = 0
            for i in range(len(work.r)):
                work.d[i] = work.r[i]
            solve(tree, work.values, work.d, work.factoring)
            largest = plain = _largest(work.d)
            length = np.sqrt(dot(work.d, work.d))
            astray = was_exact and not renew and not length < (1.0 - _ENOUGH * part) * long
            if astray:
                break
            slow = _too_slow(largest, first, enough, since)
            exact = ready and _is_worth(plain, before, enough, was_exact)
            # what a factor has of contacts that are open makes corrections small before forces are
            doubtful = work.gone[0] > 0 and (work.memo[FACTOR_KEEPS] > 0.0 or iteration > _SOON)
            doubtful = doubtful and not careful and plain <= enough
            stale = doubtful and work.gone[1] > 0 and work.memo[N_FACTORS] == made and attempt == 0
            whole = exact or (doubtful and not stale)
            if whole:
                solve_with_changes(model, parameters, tree, count, work)
                largest = _largest(work.d)
            if was_exact:
                slow = missing > 0 or (part == 1.0 and was_settled and settled and plain > _STALE * before)
            slow = slow or stale
            if not slow or attempt > 0 or renew:
                break
            renew = True
        if astray:
            # contacts changed on the way that were taken to stay: go half of it back, or to where it came from
            exact = part > _SHORTEST
            back = 0.5 * part if exact else part
            _move(x, model.order, work.dx, -back)
            plain, length, settled, known, part = before, long, was_settled, -1, part - back
            if not exact:
                part, trusted = 1.0, iteration + _PROBATION
            continue
        part = 1.0
        if not np.isfinite(largest):
            return NOT_FINITE, iteration
        if guessed > _FAR * parameters.edge and not careful and largest > 0.5 * guessed:
            guessed = _back_to(x0, x, count, work)
            continue
        guessed = 0.0
        if since == 0:
            known, first = -1, largest
        since += 1
        left = False
        known = accelerate(-1 if careful or whole else known, work.d, work.d_last, work.dx, work.q, work.s)
        moved = _largest(work.dx)
        if moved > limit:
            for i in range(len(work.dx)):
                work.dx[i] *= limit / moved
        slope = dot(work.r, work.dx) if careful and not whole else -1.0
        _move(x, model.order, work.dx, 1.0)
        if any_held(count, work):
            since = 0  # what comes next are other forces
            continue
        # one correction says nothing of how fast they shrink, so that one alone must be much smaller
        if largest <= (enough if since > 1 else _FIRST * enough) and moved <= enough:
            left = work.memo[FACTOR_TOUCHES] > 0.0 and firm == np.inf
            if not left:
                return CONVERGED, iteration
    # points that open and close by turns may keep it from what contacts ask for: the tolerance itself is met
    near = not careful and since > 1 and largest <= tolerance and moved <= tolerance
    return CONVERGED if near else STALLED, most


@njit(cache=True, error_model="numpy")
def seam_compliance(scheme, model, parameters, tree, now, x, inputs, work, inverse):
    """d(seam_x)/d(seam_force) at the end x of a step from `now`, contacts included.

    inverse (3s, 3s) [m/N] updated in place, where the seam is eliminated last; returns whether the matrix could be
    factored.
    """
    x0, tools = now.x, inputs.tools
    inertia, share = begin(scheme, inputs.dt, inputs.past, x0, now.v, now.history, work.x_hat)
    resist(scheme, inputs.dt, share, x0, model, parameters, work)
    count = find_candidates(
        x0, now.v, inputs.dt, model, parameters, tools, now.contact, parameters.edge, inertia, 1.0, work
    )
    residual(x, x0, model, parameters, tools, count, inertia, share, work)
    for c in range(count):
        # the derivative proper: no resistance along a slip (0 where the contact sticks or is open has no effect)
        work.contact[c, RELAXED] = 1.0
    good = refactor(x, x0, model, parameters, tree, tools, count, inertia, share, False, -np.inf, False, work)
    if good and tree.seam_front >= 0:
        seam_inverse(tree, work.values, work.seam_block, inverse, work.ints)
    return good
