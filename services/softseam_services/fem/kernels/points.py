"""Forces, energies and stresses of any element with any material, cell by cell, element by element, point by point.

  U = sum_q w_q psi(F_q) + fill mu/2 sum_ab S_ab x_a . x_b,   F_q = sum_a x_a (x) grad N_a                        (1)
  f_ia = sum_q w_q P_ij dN_a,j + fill mu sum_b S_ab x_ib                                                          (2)
psi at F_bar where a group of points has one volume ratio (kernels/mean_volume.py). A cell counts with its `part`, which
is 1 unless two elements share the cell. `rule` is a `fem.rule.Rule`.

State of a material that has any is an octant's. A point sees the mean of the octants that it stands for, by
`rule.share`; an octant takes over the mean of its points' next states, by their shares and weights. work.material_state
is that at the start of the step, and work.material_dt its length; 0 to look at what the state is.
"""

import numpy as np

from softseam_services.body.materials import with_state
from softseam_services.body.materials.point import energy, stress
from softseam_services.jit import njit

from .cells import gather
from .mean_volume import mean_pressure, modify, positive_volume, volume_gradient


@njit(cache=True, error_model="numpy")
def respond(model, rule, work, cell, point, parameters, F, state, P, A, following, definite):
    """Energy density, and what the step dissipated, at a point of a cell, numbered through its elements [Pa].

    P (3, 3), A (9, 9) and following (n,) in place; state (n,): workspace. definite: as of `with_state.respond`
    """
    _look_up(model, rule, work, cell, point, state)
    return with_state.respond(model.respond, F, state, work.material_dt[0], parameters, P, A, following, definite)


@njit(cache=True, error_model="numpy")
def _respond_stress(model, rule, work, cell, point, parameters, F, P, own):
    """P (3, 3) of `respond` alone, in place; own: workspace, see `own_arrays`."""
    state, following, A = own
    _look_up(model, rule, work, cell, point, state)
    with_state.stress_at_end(model.respond, F, state, work.material_dt[0], parameters, P, A, following)


@njit(cache=True, error_model="numpy")
def _look_up(model, rule, work, cell, point, state):
    """state (n,) <- what the octants remember that a point stands for."""
    n_points = rule.share.shape[1]
    share = rule.share[point // n_points, point % n_points]
    state[:] = 0.0
    for octant in range(8):
        for n in range(model.n_state):
            state[n] += share[octant] * work.material_state[cell, octant, n]


@njit(cache=True, error_model="numpy")
def point_gradients(xe, rule, cell, group, per_group, F):
    """F (k, 3, 3) at the points of a group in a cell with nodes xe (3, 27), updated in place."""
    n_points, n_nodes = rule.gradient.shape[2], rule.gradient.shape[4]
    shape = rule.shape[cell]
    at = 0
    for element in range(group * per_group, (group + 1) * per_group):
        nodes = rule.nodes[element]
        for q in range(n_points):
            G = rule.gradient[shape, element, q]
            for i in range(3):
                f0 = f1 = f2 = 0.0
                for a in range(n_nodes):
                    x = xe[i, nodes[a]]
                    f0 += x * G[0, a]
                    f1 += x * G[1, a]
                    f2 += x * G[2, a]
                F[at, i, 0], F[at, i, 1], F[at, i, 2] = f0, f1, f2
            at += 1


@njit(cache=True, error_model="numpy")
def group_volumes(F, weight, additive, H, J):
    """J (k,) and H = dJ/dF (k, 3, 3) of a group in place; returns J_bar and the sum of weights (k,)."""
    total = volume = 0.0
    for at in range(len(F)):
        J[at] = volume_gradient(F[at], additive, H[at])
        total += weight[at]
        volume += weight[at] * J[at]
    return volume / total, total


@njit(cache=True, error_model="numpy")
def own_arrays(model):
    """Workspace of a material with state: its state at a point and what follows (n,), A (9, 9)."""
    return np.empty(model.n_state), np.empty(model.n_state), np.empty((9, 9))


@njit(cache=True, error_model="numpy")
def _determinant(F):
    return (
        F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1])
        + F[0, 1] * (F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2])
        + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    )


@njit(cache=True, error_model="numpy")
def group_stresses(model, rule, work, cell, first, parameters, averaged, F, weight, F_bar, H, J, own, P):
    """P (k, 3, 3) with which eq. (2) holds at the points of a group of a cell, updated in place; parameters of each.

    first: number of the group's first point in the cell; own: workspace of a material with state, see `own_arrays`
    """
    kind, additive = model.kind, model.linear
    if not averaged:
        for at in range(len(F)):
            if model.n_state > 0:
                _respond_stress(model, rule, work, cell, first + at, parameters[at], F[at], P[at], own)
            else:
                stress(kind, parameters[at], F[at], P[at])
        return
    J_bar, total = group_volumes(F, weight, additive, H, J)
    a_bar = 1.0 if additive else positive_volume(J_bar)[1]
    pull = 0.0
    for at in range(len(F)):
        theta = modify(F[at], J[at], J_bar, additive, F_bar)
        if model.n_state > 0:
            _respond_stress(model, rule, work, cell, first + at, parameters[at], F_bar, P[at], own)
        else:
            stress(kind, parameters[at], F_bar, P[at])
        p = mean_pressure(P[at], F_bar, additive)
        pull += weight[at] * p
        back = p if additive else p * positive_volume(J[at])[1]
        for i in range(3):
            for j in range(3):
                P[at, i, j] = theta * P[at, i, j] - back * H[at, i, j]
    pull *= a_bar / total
    for at in range(len(F)):
        for i in range(3):
            for j in range(3):
                P[at, i, j] += pull * H[at, i, j]


@njit(cache=True, error_model="numpy", aside=(float, int))
def subtract_forces(x, model, rule, part, work, r):
    """r <- r - part f(x), eq. (2), in elimination order; returns the least J and the cell where it occurs.

    x (n, 3), part (c,), r (3 n_free,) updated in place; work.xe and work.fe are overwritten
    """
    gather(x, model.cell_nodes, work.xe)
    n_elements, n_nodes = rule.nodes.shape
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    n_points = rule.gradient.shape[2]
    size = per_group * n_points
    F, H, P = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty((size, 3, 3))
    J, F_bar, own = np.empty(size), np.empty((3, 3)), own_arrays(model)
    least, worst = np.inf, -1
    for cell in range(len(model.cell_nodes)):
        if part[cell] == 0.0:
            continue
        xe, fe = work.xe[cell], work.fe[cell]
        fe[:] = 0.0
        shape = rule.shape[cell]
        for group in range(n_elements // per_group):
            point_gradients(xe, rule, cell, group, per_group, F)
            weight = rule.weight[cell, group * size : (group + 1) * size]
            parameters = rule.parameters[rule.blend[cell], group * size : (group + 1) * size]
            first = group * size
            group_stresses(model, rule, work, cell, first, parameters, averaged, F, weight, F_bar, H, J, own, P)
            at = 0
            for element in range(group * per_group, (group + 1) * per_group):
                nodes = rule.nodes[element]
                for q in range(n_points):
                    det = _determinant(F[at])
                    if not least <= det:
                        least, worst = det, cell
                    G, w = rule.gradient[shape, element, q], part[cell] * weight[at]
                    for i in range(3):
                        p0, p1, p2 = w * P[at, i, 0], w * P[at, i, 1], w * P[at, i, 2]
                        for a in range(n_nodes):
                            fe[i, nodes[a]] += p0 * G[0, a] + p1 * G[1, a] + p2 * G[2, a]
                    at += 1
                if rule.stabilised:
                    scale = part[cell] * rule.fill[cell, element]
                    S = rule.stabilisation[shape, element]
                    for a in range(n_nodes):
                        for i in range(3):
                            pull = 0.0
                            for b in range(n_nodes):
                                pull += S[a, b] * xe[i, nodes[b]]
                            fe[i, nodes[a]] += scale * pull
        for a in range(27):
            place = model.cell_order[cell, a]
            if place >= 0:
                r[3 * place] -= fe[0, a]
                r[3 * place + 1] -= fe[1, a]
                r[3 * place + 2] -= fe[2, a]
    return least, worst


@njit(cache=True, error_model="numpy", aside=(float,))
def strain_energy(x, model, rule, part, work):
    """Energy [J] of eq. (1), whose gradient is f; work.energy (c,) += each cell's."""
    gather(x, model.cell_nodes, work.xe)
    n_elements, n_nodes = rule.nodes.shape
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    size = per_group * rule.gradient.shape[2]
    F, H, J, F_bar = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty(size), np.empty((3, 3))
    state, following, A = own_arrays(model)
    P = np.empty((3, 3))
    total = 0.0
    for cell in range(len(model.cell_nodes)):
        if part[cell] == 0.0:
            continue
        xe = work.xe[cell]
        shape = rule.shape[cell]
        own = 0.0
        for group in range(n_elements // per_group):
            point_gradients(xe, rule, cell, group, per_group, F)
            weight = rule.weight[cell, group * size : (group + 1) * size]
            parameters = rule.parameters[rule.blend[cell], group * size : (group + 1) * size]
            J_bar = 1.0
            if averaged:
                J_bar, _ = group_volumes(F, weight, model.linear, H, J)
            for at in range(size):
                if model.n_state > 0:
                    if averaged:
                        modify(F[at], J[at], J_bar, model.linear, F_bar)
                    else:
                        F_bar[:] = F[at]
                    point = group * size + at
                    psi, _ = respond(
                        model, rule, work, cell, point, parameters[at], F_bar, state, P, A, following, False
                    )
                    own += weight[at] * psi
                elif averaged:
                    modify(F[at], J[at], J_bar, model.linear, F_bar)
                    own += weight[at] * energy(model.kind, parameters[at], F_bar)
                else:
                    own += weight[at] * energy(model.kind, parameters[at], F[at])
        if rule.stabilised:
            for element in range(n_elements):
                nodes = rule.nodes[element]
                square = 0.0
                for a in range(n_nodes):
                    for b in range(n_nodes):
                        product = 0.0
                        for i in range(3):
                            product += xe[i, nodes[a]] * xe[i, nodes[b]]
                        square += rule.stabilisation[shape, element, a, b] * product
                own += 0.5 * rule.fill[cell, element] * square
        own *= part[cell]
        work.energy[cell] += own
        total += own
    return total


@njit(cache=True, error_model="numpy", aside=())
def cauchy_stress(x, model, rule, work, out):
    """Cauchy stress xx yy zz yz xz xy of the octants, out (c, 8, 6) [Pa] updated in place; zero in an empty octant.

    The mean over the octant's points of P F^T/J, of small-strain materials P.
    """
    gather(x, model.cell_nodes, work.xe)
    n_elements = len(rule.nodes)
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    n_points = rule.gradient.shape[2]
    size = per_group * n_points
    F, H, P = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty((size, 3, 3))
    J, F_bar, volume, own = np.empty(size), np.empty((3, 3)), np.empty(8), own_arrays(model)
    out[:] = 0.0
    for cell in range(len(model.cell_nodes)):
        volume[:] = 0.0
        for group in range(n_elements // per_group):
            point_gradients(work.xe[cell], rule, cell, group, per_group, F)
            weight = rule.weight[cell, group * size : (group + 1) * size]
            parameters = rule.parameters[rule.blend[cell], group * size : (group + 1) * size]
            first = group * size
            group_stresses(model, rule, work, cell, first, parameters, averaged, F, weight, F_bar, H, J, own, P)
            for at in range(size):
                det = 1.0 if model.linear else _determinant(F[at])
                share = rule.share[group * per_group + at // n_points, at % n_points]
                for octant in range(8):
                    w = share[octant] * weight[at]
                    volume[octant] += w
                    for n in range(6):
                        i, j = (0, 1, 2, 1, 0, 0)[n], (0, 1, 2, 2, 2, 1)[n]
                        sigma = P[at, i, j]
                        if not model.linear:
                            sigma = P[at, i, 0] * F[at, j, 0] + P[at, i, 1] * F[at, j, 1] + P[at, i, 2] * F[at, j, 2]
                        out[cell, octant, n] += w * sigma / det
        for octant in range(8):
            for n in range(6):
                out[cell, octant, n] *= 1.0 / volume[octant] if model.filled[cell, octant] else 0.0


@njit(cache=True, error_model="numpy")
def remember(x, model, rule, work, end):
    """end (c, 8, n) <- what the octants remember at the end x of the step that work.material_state began; returns what
    the material dissipated in it [J]."""
    gather(x, model.cell_nodes, work.xe)
    n_elements, n_points = rule.share.shape[:2]
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    size = per_group * n_points
    F, H, J, F_bar = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty(size), np.empty((3, 3))
    P, total = np.empty((3, 3)), np.empty(8)
    state, following, A = own_arrays(model)
    lost = 0.0
    for cell in range(len(model.cell_nodes)):
        total[:] = 0.0
        end[cell] = 0.0
        for group in range(n_elements // per_group):
            point_gradients(work.xe[cell], rule, cell, group, per_group, F)
            J_bar = 1.0
            if averaged:
                weight = rule.weight[cell, group * size : (group + 1) * size]
                J_bar, _ = group_volumes(F, weight, model.linear, H, J)
            for at in range(size):
                point = group * size + at
                if averaged:
                    modify(F[at], J[at], J_bar, model.linear, F_bar)
                else:
                    F_bar[:] = F[at]
                parameters = rule.parameters[rule.blend[cell], point]
                _, dissipated = respond(
                    model, rule, work, cell, point, parameters, F_bar, state, P, A, following, False
                )
                lost += rule.weight[cell, point] * dissipated
                for octant in range(8):
                    w = rule.share[point // n_points, point % n_points, octant] * rule.weight[cell, point]
                    total[octant] += w
                    for n in range(model.n_state):
                        end[cell, octant, n] += w * following[n]
        for octant in range(8):
            if total[octant] > 0.0:
                for n in range(model.n_state):
                    end[cell, octant, n] /= total[octant]
    return lost
