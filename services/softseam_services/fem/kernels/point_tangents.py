"""Tangents of any element with any material, added to the fronts.

  K_ia,kb = sum_q w_q dN_a,j A_ij,kn dN_b,n + delta_ik fill mu S_ab,  A = dP/dF                                   (1)
Where a group of points has one volume ratio J_bar (kernels/mean_volume.py, eq. 4), with g = dJ_bar/dx,
v = sum_q w_q c_q : dF_q/dx and s = sum_q w_q e_q of the terms c, e with dJ_bar, K has besides
  v g^T + g v^T + s g g^T.                                                                                        (2)
"""

import numpy as np

from softseam_services.body.materials.point import stress, tangent
from softseam_services.jit import njit

from .cells import gather
from .mean_volume import mean_pressure, modify, modify_tangent
from .points import group_volumes, own_arrays, point_gradients, respond


@njit(cache=True, error_model="numpy")
def add_point(A, G, w, n_nodes, K):
    """K[a, 3 i + k, b] += w dN_a,j A_ij,kn dN_b,n for b >= a of the first n_nodes; A (9, 9), G (3, m), K (m, 9, m)
    updated in place."""
    for a in range(n_nodes):
        g0, g1, g2 = w * G[0, a], w * G[1, a], w * G[2, a]
        for i in range(3):
            for k in range(3):
                c0 = g0 * A[3 * i, 3 * k] + g1 * A[3 * i + 1, 3 * k] + g2 * A[3 * i + 2, 3 * k]
                c1 = g0 * A[3 * i, 3 * k + 1] + g1 * A[3 * i + 1, 3 * k + 1] + g2 * A[3 * i + 2, 3 * k + 1]
                c2 = g0 * A[3 * i, 3 * k + 2] + g1 * A[3 * i + 1, 3 * k + 2] + g2 * A[3 * i + 2, 3 * k + 2]
                row = K[a, 3 * i + k]
                for b in range(a, n_nodes):
                    row[b] += c0 * G[0, b] + c1 * G[1, b] + c2 * G[2, b]


@njit(cache=True, error_model="numpy")
def scatter(K, nodes, tree, cell, values):
    """Add K (n, 9, n), b >= a, to the panels of the cell's nodes, in place."""
    n_nodes, n_free = len(nodes), tree.cell_free[cell]
    rank, column, height = tree.cell_rank[cell], tree.cell_column[cell], tree.cell_height[cell]
    for a in range(n_nodes):
        ra = rank[nodes[a]]
        if ra >= n_free:
            continue
        for b in range(a, n_nodes):
            rb = rank[nodes[b]]
            if rb >= n_free:
                continue
            if rb >= ra:
                row = tree.cell_row[cell, ra, rb]
                for i in range(3):
                    to = column[ra] + i * height[ra] + row
                    for k in range(3):
                        values[to + k] += K[a, 3 * i + k, b]
            else:
                row = tree.cell_row[cell, rb, ra]
                for k in range(3):
                    to = column[rb] + k * height[rb] + row
                    for i in range(3):
                        values[to + i] += K[a, 3 * i + k, b]


@njit(cache=True, error_model="numpy")
def add_coupling(v, g, s, K):
    """Eq. (2): K[a, 3 i + k, b] <- for b >= a; v, g (n, 3), K (n, 9, n) overwritten."""
    n_nodes = len(v)
    for a in range(n_nodes):
        for i in range(3):
            for k in range(3):
                for b in range(a, n_nodes):
                    K[a, 3 * i + k, b] = v[a, i] * g[b, k] + g[a, i] * v[b, k] + s * g[a, i] * g[b, k]


@njit(cache=True, error_model="numpy", aside=())
def add_cell_tangents(x, model, rule, part, tree, work, definite):
    """Add part K at x, every cell into its front of work.values (lower triangle), updated in place.

    definite: positive semi-definite; work.xe is overwritten
    """
    gather(x, model.cell_nodes, work.xe)
    n_elements, n_nodes = rule.nodes.shape
    averaged = len(rule.group_nodes) > 0
    per_group = n_elements // len(rule.group_nodes) if averaged else 1
    n_points = rule.gradient.shape[2]
    size = per_group * n_points
    F, H, J, P = np.empty((size, 3, 3)), np.empty((size, 3, 3)), np.empty(size), np.empty((3, 3))
    F_bar, A, coupled = np.empty((3, 3)), np.empty((9, 9)), np.empty(9)
    K = np.empty((n_nodes, 9, n_nodes))
    n_shared = rule.group_nodes.shape[1]
    Kg, v, g = np.empty((n_shared, 9, n_shared)), np.empty((27, 3)), np.empty((27, 3))
    vg, gg = np.empty((n_shared, 3)), np.empty((n_shared, 3))
    state, following, _ = own_arrays(model)
    for cell in range(len(model.cell_nodes)):
        if part[cell] == 0.0:
            continue
        shape = rule.shape[cell]
        for group in range(n_elements // per_group):
            point_gradients(work.xe[cell], rule, cell, group, per_group, F)
            weight = rule.weight[cell, group * size : (group + 1) * size]
            parameters = rule.parameters[rule.blend[cell], group * size : (group + 1) * size]
            J_bar, total, mean_p, s = 1.0, 1.0, 0.0, 0.0
            if averaged:
                v[:], g[:] = 0.0, 0.0
                J_bar, total = group_volumes(F, weight, model.linear, H, J)
                for at in range(size):
                    modify(F[at], J[at], J_bar, model.linear, F_bar)
                    if model.n_state > 0:
                        point = group * size + at
                        respond(model, rule, work, cell, point, parameters[at], F_bar, state, P, A, following, definite)
                    else:
                        stress(model.kind, parameters[at], F_bar, P)
                    mean_p += weight[at] / total * mean_pressure(P, F_bar, model.linear)
            at = 0
            for element in range(group * per_group, (group + 1) * per_group):
                nodes = rule.nodes[element]
                K[:] = 0.0
                if rule.stabilised:
                    scale = part[cell] * rule.fill[cell, element]
                    for a in range(n_nodes):
                        for b in range(a, n_nodes):
                            value = scale * rule.stabilisation[shape, element, a, b]
                            K[a, 0, b] = K[a, 4, b] = K[a, 8, b] = value
                for q in range(n_points):
                    G, w = rule.gradient[shape, element, q], part[cell] * weight[at]
                    if averaged:
                        theta = modify(F[at], J[at], J_bar, model.linear, F_bar)
                        if model.n_state > 0:
                            point = group * size + at
                            respond(
                                model, rule, work, cell, point, parameters[at], F_bar, state, P, A, following, definite
                            )
                        else:
                            stress(model.kind, parameters[at], F_bar, P)
                            tangent(model.kind, parameters[at], F_bar, A, definite)
                        s += w * modify_tangent(
                            A, P, F[at], F_bar, H[at], J[at], J_bar, theta, mean_p, model.linear, definite, coupled
                        )
                        for a in range(n_nodes):
                            for i in range(3):
                                along = coupled[3 * i] * G[0, a] + coupled[3 * i + 1] * G[1, a]
                                v[nodes[a], i] += w * (along + coupled[3 * i + 2] * G[2, a])
                                along = H[at, i, 0] * G[0, a] + H[at, i, 1] * G[1, a] + H[at, i, 2] * G[2, a]
                                g[nodes[a], i] += weight[at] / total * along
                    elif model.n_state > 0:
                        point = group * size + at
                        respond(model, rule, work, cell, point, parameters[at], F[at], state, P, A, following, definite)
                    else:
                        tangent(model.kind, parameters[at], F[at], A, definite)
                    add_point(A, G, w, n_nodes, K)
                    at += 1
                scatter(K, nodes, tree, cell, work.values)
            if averaged:
                shared = rule.group_nodes[group]
                for a in range(n_shared):
                    vg[a], gg[a] = v[shared[a]], g[shared[a]]
                add_coupling(vg, gg, s, Kg)
                scatter(Kg, shared, tree, cell, work.values)
