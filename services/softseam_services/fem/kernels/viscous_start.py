"""What the viscosity of a step (kernels/viscosity.py, whose equations these are) knows of the step's start."""

import numpy as np

from softseam_services.body.materials.neo_hookean import J_MIN
from softseam_services.fem.integrators.scheme import viscous_share
from softseam_services.jit import njit

from .cells import gather
from .mean_volume import volume_gradient
from .points import point_gradients

_FLAT = 1e-3  # of a mean deformation gradient: below, what is even in a motion is not known, and S damps nothing


@njit(cache=True, error_model="numpy")
def resist(scheme, dt, share, x0, model, parameters, work):
    """work.viscous <- c of eq. (1); where it is not 0, work.resistance <- T and work.origin, work.volume from x0."""
    c = work.viscous[0] = viscous_share(scheme, dt, share)
    if c != 0.0:
        _resist(c, x0, model, parameters, work)


@njit(cache=True, error_model="numpy", aside=())
def _resist(c, x0, model, parameters, work):
    """work.resistance <- T of eq. (1) and work.origin, work.volume from x0."""
    rule = parameters.viscous
    n_elements, n_points, m = rule.gradient.shape[1], rule.gradient.shape[2], rule.nodes.shape[1]
    gather(x0, model.cell_nodes, work.xe)
    F, g, u, Y = np.empty((n_points, 3, 3)), np.empty((3, m)), np.empty((3, m)), np.empty((3, m))
    for cell in range(len(model.cell_nodes)):
        gradient = rule.gradient[rule.shape[cell]]
        for element in range(n_elements):
            T, first = work.resistance[cell, element], element * n_points
            for a in range(m):
                for b in range(m):
                    T[a, b] = 0.0
            point_gradients(work.xe[cell], rule, cell, element, 1, F)
            for q in range(n_points):
                at, G = first + q, gradient[element, q]
                mu, origin = rule.moduli[rule.blend[cell], at, 0], work.origin[cell, at]
                J = work.volume[cell, at] = 1.0 if model.linear else volume_gradient(F[q], False, origin)
                if J < J_MIN:
                    continue
                for i in range(3):
                    if model.linear:
                        origin[i, 0], origin[i, 1], origin[i, 2] = 0.0, 0.0, 0.0
                        origin[i, i] = 1.0
                    o0, o1, o2 = origin[i, 0] / J, origin[i, 1] / J, origin[i, 2] / J
                    origin[i, 0], origin[i, 1], origin[i, 2] = o0, o1, o2
                    for a in range(m):
                        g[i, a] = o0 * G[0, a] + o1 * G[1, a] + o2 * G[2, a]
                _add_product(c * rule.weight[cell, at] * mu, g, g, T)
            if rule.stabilised:
                S, fill = rule.stabilisation[rule.shape[cell], element], c * rule.fill[cell, element]
                weight = rule.weight[cell, first : first + n_points]
                if not (model.linear or _even_motion(weight, gradient[element], F, g, u)):
                    continue
                for a in range(m):
                    for b in range(m):
                        T[a, b] += fill * S[a, b]
                if not model.linear:
                    _subtract_even(fill, work.xe[cell], rule.nodes[element], S, g, u, Y, T)


@njit(cache=True, error_model="numpy")
def _add_product(w, g, h, T):
    """T (m, m) += w g^T h for g, h (3, m), in place."""
    for i in range(3):
        for a in range(len(T)):
            scaled = w * g[i, a]
            for b in range(len(T)):
                T[a, b] += scaled * h[i, b]


@njit(cache=True, error_model="numpy")
def _even_motion(weight, gradient, F, g, inverse):
    """g (3, m) of eq. (3) and F_g^-1 into the first columns of inverse, in place; False where that is not known.

    weight (q,), gradient (q, 3, m) and F (q, 3, 3) of an element's points
    """
    mean, H, total = np.zeros((3, 3)), np.empty((3, 3)), 0.0
    for q in range(len(weight)):
        total += weight[q]
    for i in range(3):
        for a in range(g.shape[1]):
            g[i, a] = 0.0
        for q in range(len(weight)):
            w = weight[q] / total
            for j in range(3):
                mean[i, j] += w * F[q, i, j]
            for a in range(g.shape[1]):
                g[i, a] += w * gradient[q, i, a]
    J = volume_gradient(mean, False, H)
    for i in range(3):
        for j in range(3):
            inverse[i, j] = H[j, i] / J
    return J > _FLAT


@njit(cache=True, error_model="numpy")
def _subtract_even(scale, xe, nodes, S, g, u, Y, T):
    """T (m, m) += scale ((I - g u^T) S (I - u g^T) - S) = -scale (g^T Y + Y^T g), Y = u S - u S u^T g/2; in place.

    xe (3, 27), nodes (m,), S (m, m), g (3, m); u (3, m) with F_g^-1 in it, and Y (3, m), are overwritten
    """
    m = len(nodes)
    i00, i01, i02, i10, i11, i12 = u[0, 0], u[0, 1], u[0, 2], u[1, 0], u[1, 1], u[1, 2]
    i20, i21, i22 = u[2, 0], u[2, 1], u[2, 2]
    for a in range(m):
        x, y, z = xe[0, nodes[a]], xe[1, nodes[a]], xe[2, nodes[a]]
        u[0, a], u[1, a], u[2, a] = (
            i00 * x + i01 * y + i02 * z,
            i10 * x + i11 * y + i12 * z,
            i20 * x + i21 * y + i22 * z,
        )
        Y[0, a] = Y[1, a] = Y[2, a] = 0.0
    for a in range(m):
        x, y, z = u[0, a], u[1, a], u[2, a]
        for b in range(m):
            Y[0, b] += x * S[a, b]
            Y[1, b] += y * S[a, b]
            Y[2, b] += z * S[a, b]
    for i in range(3):
        q0 = q1 = q2 = 0.0
        for a in range(m):
            q0, q1, q2 = q0 + Y[i, a] * u[0, a], q1 + Y[i, a] * u[1, a], q2 + Y[i, a] * u[2, a]
        for a in range(m):
            Y[i, a] -= 0.5 * (q0 * g[0, a] + q1 * g[1, a] + q2 * g[2, a])
    _add_product(-scale, g, Y, T)
    _add_product(-scale, Y, g, T)
