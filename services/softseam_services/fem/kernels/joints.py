"""Forces, tangents and energies of joints: groups of octants with one deformation gradient, and ties (`fem.joints`).

f_ia = sum_g w_g P_ij g_a,j + sum_n k_n t_na d_ni,   d_n = sum_a t_na x_a = x_n - sum_a N_a(xi_n) x_a          (1)
K_ia,kb = sum_g w_g g_a,j A_ij,kl g_b,l + delta_ik sum_n k_n t_na t_nb,   A = dP/dF                            (2)
"""

import numpy as np

from softseam_services.body.materials.point import energy, stress, tangent
from softseam_services.jit import njit

from .point_tangents import add_point, scatter


@njit(cache=True, error_model="numpy")
def _gather(x, joints, joint, xe):
    """xe (3, m) <- places of the joint's nodes relative to the root cell's centre; returns how many there are."""
    nodes = joints.nodes[joint]
    centre, n = nodes[13], 0
    while n < len(nodes) and nodes[n] >= 0:
        for i in range(3):
            xe[i, n] = x[nodes[n], i] - x[centre, i]
        n += 1
    return n


@njit(cache=True, error_model="numpy")
def _deformation(xe, n, G, F):
    """F (3, 3) <- sum_a x_a (x) g_a."""
    for i in range(3):
        for j in range(3):
            f = 0.0
            for a in range(n):
                f += xe[i, a] * G[j, a]
            F[i, j] = f


@njit(cache=True, error_model="numpy")
def _apart(xe, tied, follow, d):
    """d (3,) of eq. (1)."""
    for i in range(3):
        d[i] = xe[i, tied]
        for a in range(27):
            d[i] -= follow[a] * xe[i, a]


@njit(cache=True, error_model="numpy", aside=())
def subtract_forces(x, model, parameters, work, r):
    """r <- r - f(x), eq. (1), in elimination order; work.fe, with the forces of cells on their nodes, gains them.

    x (n, 3), r (3 n_free,) updated in place
    """
    joints, numbers = model.joints, parameters.joints
    most = joints.nodes.shape[1]
    xe, fe, F, P, d = np.empty((3, most)), np.empty((3, most)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for joint in range(len(joints.cell)):
        n = _gather(x, joints, joint, xe)
        fe[:] = 0.0
        for group in range(joints.group[joint], joints.group[joint + 1]):
            G, w = numbers.gradient[group], numbers.weight[group]
            _deformation(xe, n, G, F)
            stress(model.kind, numbers.parameters[group], F, P)
            for i in range(3):
                p0, p1, p2 = w * P[i, 0], w * P[i, 1], w * P[i, 2]
                for a in range(n):
                    fe[i, a] += p0 * G[0, a] + p1 * G[1, a] + p2 * G[2, a]
        for tie in range(joints.tie[joint], joints.tie[joint + 1]):
            tied, follow, k = joints.tied[tie], numbers.follow[tie], numbers.stiffness[tie]
            _apart(xe, tied, follow, d)
            for i in range(3):
                fe[i, tied] += k * d[i]
                for a in range(27):
                    fe[i, a] -= k * d[i] * follow[a]
        for a in range(n):
            place, home = joints.place[joint, a], joints.home[joint, a]
            for i in range(3):
                work.fe[home // 27, i, home % 27] += fe[i, a]
                if place >= 0:
                    r[3 * place + i] -= fe[i, a]


@njit(cache=True, error_model="numpy", aside=())
def add_tangents(x, model, parameters, work, definite):
    """Add K of eq. (2) to the fronts in work.values, updated in place; definite: positive semi-definite."""
    joints, numbers = model.joints, parameters.joints
    most = joints.nodes.shape[1]
    xe, F, A = np.empty((3, most)), np.empty((3, 3)), np.empty((9, 9))
    K, t, local = np.empty((most, 9, most)), np.empty(most), np.arange(most)
    for joint in range(len(joints.cell)):
        n = _gather(x, joints, joint, xe)
        K[:n] = 0.0
        for group in range(joints.group[joint], joints.group[joint + 1]):
            G = numbers.gradient[group]
            _deformation(xe, n, G, F)
            tangent(model.kind, numbers.parameters[group], F, A, definite)
            add_point(A, G, numbers.weight[group], n, K)
        for tie in range(joints.tie[joint], joints.tie[joint + 1]):
            t[:n] = 0.0
            for a in range(27):
                t[a] = -numbers.follow[tie, a]
            t[joints.tied[tie]] += 1.0
            for a in range(n):
                pull = numbers.stiffness[tie] * t[a]
                if pull != 0.0:
                    for b in range(a, n):
                        value = pull * t[b]
                        K[a, 0, b] += value
                        K[a, 4, b] += value
                        K[a, 8, b] += value
        scatter(K, local[:n], joints, joint, work.values)


@njit(cache=True, error_model="numpy", aside=(float,))
def strain_energy(x, model, parameters, work):
    """Energy [J] whose gradient is f; work.energy (c,) of the root cells += theirs."""
    joints, numbers = model.joints, parameters.joints
    xe, F, d, total = np.empty((3, joints.nodes.shape[1])), np.empty((3, 3)), np.empty(3), 0.0
    for joint in range(len(joints.cell)):
        n, own = _gather(x, joints, joint, xe), 0.0
        for group in range(joints.group[joint], joints.group[joint + 1]):
            _deformation(xe, n, numbers.gradient[group], F)
            own += numbers.weight[group] * energy(model.kind, numbers.parameters[group], F)
        for tie in range(joints.tie[joint], joints.tie[joint + 1]):
            _apart(xe, joints.tied[tie], numbers.follow[tie], d)
            own += 0.5 * numbers.stiffness[tie] * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        work.energy[joints.cell[joint]] += own
        total += own
    return total
