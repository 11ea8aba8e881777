"""Viscosity of Kelvin and Voigt: forces of the body as if it had been at rest where the step begins.

What a step knows of its start is made once, by `kernels/viscous_start.py`.

With F_r = F_t F_0^-1 what a point has deformed by since the start of the step, at x_t = x0 + share (x1 - x0) of the
integrators, the step's viscous potential is the neo-Hookean energy of that alone, of the material's mu and lambda:
  V = c sum w (mu/2 |F_r|^2 - mu ln J_r + lambda/2 ln^2 J_r),  c = tau'/(share dt)                              (1)
where tau' = tau - (2 share - 1) dt is what is left to add to what they lose themselves: oscillations of omega show
zeta = tau omega/2, up to a step of tau. To first order in the step the Kirchhoff stress is Newton's,
  J sigma = tau' (2 mu D + lambda tr(D) I),  D the rate of deformation,                                         (2)
whatever the body's law and stress, and tau' K v in small strain. V is least, and 0, where F_r is a turn, and no stress
of the body is carried from one step to the next.

Two limits. The power of (2) is never a gain, but what a step does is dV/dx_t . (x1 - x0), of which V >= 0 says nothing:
a step that contracts by e evenly while it turns by theta gains where theta^2 > 3 e, and groups (below) may whose points
strain much and unevenly: there V may be below 0. And x_t is on the chord, shorter than the way of a turn: with
share < 1 (midpoint) a body that turns with omega [1/s] is pushed outward across its axis, as if it were squeezed by
  tau' (1 - share) omega^2 dt/2                                                                                 (2b)
in both directions. With share = 1 a turn is free.

The first term of (1), 1/2 sum_ab T_ab x_a . x_b, is quadratic, T = c sum w mu F_0^-T grad N_a . F_0^-T grad N_b. The
stabilisation S of an element has what is not even in the motion since: with g the mean gradients, u_a = F_g^-1 x0_a,
F_g = sum x0_a g_a^T,
  x_r = x_t (I - g u^T),  V += c/2 fill mu sum_ab S_ab x_r,a . x_r,b                                            (3)
which vanishes where the element has turned and stretched evenly. A group with one volume ratio J_bar has
(lambda + 2 mu/3)/2 ln^2 of it, and -2 mu/3 for lambda in (1). The `linear` law has tau' K v, with gradients at rest.
Points at less than a fifth of their volume when the step begins have none of their own in it.
"""

import numpy as np

from softseam_services.body.materials.neo_hookean import J_MIN
from softseam_services.jit import njit

from .cells import gather, least_square_stretch
from .mean_volume import positive_volume, volume_gradient
from .point_tangents import add_coupling, scatter
from .points import point_gradients


@njit(cache=True, error_model="numpy")
def _slope(mu, lam, J, J0):
    """s and ds, the derivatives by J of what eq. (1) has of J, over c."""
    j, a, da = positive_volume(J)
    pull = lam * np.log(j / J0) - mu
    return pull * a, pull * da + lam * a * a


@njit(cache=True, error_model="numpy")
def _mean_volume(cell, first, end, J, model, parameters, work):
    """kappa [Pa], its group's s and ds as `_slope`, and the sum of weights; J (k,) of points first .. end - 1."""
    rule = parameters.viscous
    total = now = before = kappa = 0.0
    for at in range(first, end):
        w, material = rule.weight[cell, at], rule.moduli[rule.blend[cell], at]
        total += w
        now += w * J[at - first]
        before += w * work.volume[cell, at]
        kappa += w * (material[1] + 2.0 / 3.0 * material[0])
    kappa /= total
    if model.linear:
        return kappa * now / total, kappa, total
    if before < J_MIN * total:
        return 0.0, 0.0, total
    s, ds = _slope(0.0, kappa, now / total, before / total)
    return s, ds, total


@njit(cache=True, error_model="numpy")
def _gather_motion(x, x0, model, work):
    """work.xe <- places of the nodes in their cells; of the linear law what they have moved since x0."""
    gather(x, model.cell_nodes, work.xe)
    if model.linear:
        gather(x0, model.cell_nodes, work.fe)
        for cell in range(len(work.xe)):
            for i in range(3):
                for a in range(27):
                    work.xe[cell, i, a] -= work.fe[cell, i, a]


@njit(cache=True, error_model="numpy")
def _multiply(T, xe, nodes, f):
    """f (3, m) <- T x of an element's nodes in xe (3, 27); T (m, m) is symmetric."""
    f[:] = 0.0
    for b in range(len(nodes)):
        row = T[b]
        for i in range(3):
            x = xe[i, nodes[b]]
            for a in range(len(nodes)):
                f[i, a] += row[a] * x


@njit(cache=True, error_model="numpy", aside=())
def subtract_viscous(x, x0, model, parameters, work, r):
    """r <- r - dV/dx at x (n, 3) of a step from x0, in elimination order; work.xe and work.fe are overwritten."""
    rule, c = parameters.viscous, work.viscous[0]
    n_elements, n_points, m = rule.gradient.shape[1], rule.gradient.shape[2], rule.nodes.shape[1]
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    size = per_group * n_points
    F, H, J = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty(size)
    own = np.empty((n_elements, 3, m))
    _gather_motion(x, x0, model, work)
    for cell in range(len(model.cell_nodes)):
        xe, fe = work.xe[cell], work.fe[cell]
        for element in range(n_elements):
            _multiply(work.resistance[cell, element], xe, rule.nodes[element], own[element])
        for group in range(n_elements // per_group):
            first = group * size
            point_gradients(xe, rule, cell, group, per_group, F)
            for at in range(size):
                J[at] = volume_gradient(F[at], model.linear, H[at])
            mean_s = _mean_volume(cell, first, first + size, J, model, parameters, work)[0] if averaged else 0.0
            for at in range(size):
                element, q = group * per_group + at // n_points, at % n_points
                G, f = rule.gradient[rule.shape[cell], element, q], own[element]
                material, w = rule.moduli[rule.blend[cell], first + at], c * rule.weight[cell, first + at]
                mu = material[0]
                lam = -2.0 / 3.0 * mu if averaged else material[1]
                s, J0 = mean_s, work.volume[cell, first + at]
                if model.linear:
                    s += lam * J[at]
                elif J0 >= J_MIN:
                    s += _slope(mu, lam, J[at], J0)[0]
                for i in range(3):
                    p0, p1, p2 = w * s * H[at, i, 0], w * s * H[at, i, 1], w * s * H[at, i, 2]
                    if model.linear:
                        p0, p1, p2 = p0 + w * mu * F[at, 0, i], p1 + w * mu * F[at, 1, i], p2 + w * mu * F[at, 2, i]
                    for a in range(m):
                        f[i, a] += p0 * G[0, a] + p1 * G[1, a] + p2 * G[2, a]
        fe[:] = 0.0
        for element in range(n_elements):
            nodes = rule.nodes[element]
            for i in range(3):
                for a in range(m):
                    fe[i, nodes[a]] += own[element, i, a]
        for a in range(27):
            place = model.cell_order[cell, a]
            if place >= 0:
                r[3 * place] -= fe[0, a]
                r[3 * place + 1] -= fe[1, a]
                r[3 * place + 2] -= fe[2, a]


@njit(cache=True, error_model="numpy")
def _point_factors(mu, s, ds, F, J, origin, definite):
    """A and B of d2V = A (H : dF)^2 + B tr(H^T dF H^T dF) besides T; definite: positive semi-definite with it.

    With dF = D F that is mu |D F_r|^2 + B J^2 tr(D D) + .., |D|^2 <= |D F_r|^2 over its least square stretch.
    """
    divisor = J if abs(J) > 1e-3 else (1e-3 if J >= 0.0 else -1e-3)
    b = -s / divisor
    if not definite:
        return ds - b, b
    since = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            since[i, j] = F[i, 0] * origin[j, 0] + F[i, 1] * origin[j, 1] + F[i, 2] * origin[j, 2]
    limit = mu * least_square_stretch(since, 0) / (divisor * divisor)
    b = min(limit, max(-limit, b))
    return max(0.0, ds - b), b


@njit(cache=True, error_model="numpy")
def _add_point(A, B, h, K):
    """K[a, 3 i + k, b] += A h_ia h_kb + B h_ka h_ib for b >= a; h (3, m), K (m, 9, m) updated in place."""
    m = h.shape[1]
    for a in range(m):
        for i in range(3):
            for k in range(3):
                p, q, row = A * h[i, a], B * h[k, a], K[a, 3 * i + k]
                for b in range(a, m):
                    row[b] += p * h[k, b] + q * h[i, b]


@njit(cache=True, error_model="numpy", aside=())
def add_viscous_tangents(x, x0, model, parameters, tree, work, definite):
    """Add d2V/dx2 at x, every cell into its front of work.values (lower triangle), updated in place."""
    rule, c = parameters.viscous, work.viscous[0]
    n_elements, n_points, m = rule.gradient.shape[1], rule.gradient.shape[2], rule.nodes.shape[1]
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    size, n_shared = per_group * n_points, rule.group_nodes.shape[1]
    F, H, J = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty(size)
    K, h, even = np.empty((m, 9, m)), np.empty((3, m)), np.empty((27, 3))
    shared_K, none, shared_even = np.empty((n_shared, 9, n_shared)), np.zeros((n_shared, 3)), np.empty((n_shared, 3))
    _gather_motion(x, x0, model, work)
    for cell in range(len(model.cell_nodes)):
        for group in range(n_elements // per_group):
            first = group * size
            point_gradients(work.xe[cell], rule, cell, group, per_group, F)
            for at in range(size):
                J[at] = volume_gradient(F[at], model.linear, H[at])
            mean_s = mean_ds = total = 0.0
            if averaged:
                mean_s, mean_ds, total = _mean_volume(cell, first, first + size, J, model, parameters, work)
                even[:] = 0.0
            for element in range(group * per_group, (group + 1) * per_group):
                nodes, T = rule.nodes[element], work.resistance[cell, element]
                for a in range(m):
                    K[a] = 0.0
                    for b in range(a, m):
                        K[a, 0, b] = K[a, 4, b] = K[a, 8, b] = T[a, b]
                for q in range(n_points):
                    at = (element - group * per_group) * n_points + q
                    G, w = rule.gradient[rule.shape[cell], element, q], c * rule.weight[cell, first + at]
                    material, J0 = rule.moduli[rule.blend[cell], first + at], work.volume[cell, first + at]
                    mu = material[0]
                    lam = -2.0 / 3.0 * mu if averaged else material[1]
                    for a in range(m):
                        for i in range(3):
                            h[i, a] = H[at, i, 0] * G[0, a] + H[at, i, 1] * G[1, a] + H[at, i, 2] * G[2, a]
                            if averaged:
                                even[nodes[a], i] += rule.weight[cell, first + at] / total * h[i, a]
                    A, B = 0.0, 0.0
                    if model.linear:
                        A, B = lam, mu
                    elif J0 >= J_MIN or not definite:
                        # a point without viscosity of its own has its group's
                        s, ds = _slope(mu, lam, J[at], J0) if J0 >= J_MIN else (0.0, 0.0)
                        A, B = _point_factors(mu, s + mean_s, ds, F[at], J[at], work.origin[cell, first + at], definite)
                    _add_point(w * A, w * B, h, K)
                scatter(K, nodes, tree, cell, work.values)
            if averaged:
                shared = rule.group_nodes[group]
                for a in range(n_shared):
                    shared_even[a] = even[shared[a]]
                add_coupling(none, shared_even, c * total * (max(0.0, mean_ds) if definite else mean_ds), shared_K)
                scatter(shared_K, shared, tree, cell, work.values)
