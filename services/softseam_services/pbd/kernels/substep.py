"""One macro step: m substeps of prediction, sweeps, contact and velocity update, all in one call.

With A the acceleration that constraints (blocks and contacts) gave the nodes, implicit Euler in carried form:
x* = x + h v + h^2 (g + a_seam + A);  sweep from x*;  A += (x - x*)/h^2;  v = (x - x_n)/h                       (1)
which is v += h (g + a_seam + A) with the new A: the mean of the substeps' contact forces times dt is their impulse.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.tools.kernels import cell_distances, tool_gap, tool_travel

from .contact import carry_point, find_pairs, place_points
from .relax import relax
from .sweep import block_forces, strain_energy

(KINETIC, STRAIN, GRAVITY, TOOL_WORK, SEAM_WORK, PENETRATION, SLIP, N_CONTACTS, LEAST_J, PUSHED) = range(10)
MOMENTUM, ANGULAR, BOUNDS, N_PAIRS = 10, 13, 16, 22
N_RESULTS = 23


@njit(cache=True, error_model="numpy")
def tool_pose(fraction, position, orientation, position_next, orientation_next, position_out, orientation_out):
    """Poses at a fraction of the step: positions linear, quaternions linear and normalised; outputs in place."""
    for tool in range(len(position)):
        for a in range(3):
            position_out[tool, a] = (1.0 - fraction) * position[tool, a] + fraction * position_next[tool, a]
        dot = 0.0
        for a in range(4):
            dot += orientation[tool, a] * orientation_next[tool, a]
        sign = 1.0 if dot >= 0.0 else -1.0
        square = 0.0
        for a in range(4):
            q = (1.0 - fraction) * orientation[tool, a] + sign * fraction * orientation_next[tool, a]
            orientation_out[tool, a] = q
            square += q * q
        scale = 1.0 / np.sqrt(square)
        for a in range(4):
            orientation_out[tool, a] *= scale


@njit(cache=True, error_model="numpy")
def carried(xw, nodes, stress, constants, indptr, node, weight, force, pull, a):
    """A of eq. (1) from the stresses of the blocks and the contact forces, into a (n, 3).

    Once a step: added up over the substeps alone, the roundings of (x - x*)/h^2 grow into a force on the whole body.
    pull (n + 8, 3) is scratch.
    """
    pull[:] = 0.0
    block_forces(nodes, stress, constants, pull)
    for point in range(len(force)):
        for tool in range(force.shape[1]):
            for c in range(3):
                f = force[point, tool, c]
                if f != 0.0:
                    for entry in range(indptr[point], indptr[point + 1]):
                        pull[node[entry], c] += weight[entry] * f
    for i in range(len(a)):
        for c in range(3):
            a[i, c] = xw[i, 3] * pull[i, c]


@njit(cache=True, error_model="numpy")
def predict(xw, x_star, x, v, a, push, h):
    """x* of eq. (1) into xw and x_star; clamped nodes have v = a = push = 0. push (n, 3) = g + a_seam [m/s^2]."""
    for i in range(len(x)):
        for c in range(3):
            moved = x[i, c] + h * (v[i, c] + h * (push[i, c] + a[i, c]))
            x_star[i, c] = moved
            xw[i, c] = moved


@njit(cache=True, error_model="numpy")
def finish(xw, x_star, x, v, a, h):
    """A, v and x at the end of the substep, eq. (1); updated in place."""
    per_h = 1.0 / h
    per_hh = per_h * per_h
    for i in range(len(x)):
        for c in range(3):
            now = xw[i, c]
            a[i, c] += (now - x_star[i, c]) * per_hh
            v[i, c] = (now - x[i, c]) * per_h
            x[i, c] = now


@njit(cache=True, error_model="numpy")
def account(
    xw,
    indptr,
    node,
    weight,
    pair_start,
    pair_point,
    position,
    orientation,
    position_prev,
    orientation_prev,
    force,
    slipped,
    slip,
    force_mean,
    wrench,
    share,
):
    """Add one substep to the mean contact forces (p, t, 3), the mean wrenches on the tools (t, 6) and the slips
    (p, t, 3); share = 1/m. Returns the work of the tools [J]."""
    work = 0.0
    x = np.empty(3)
    for tool in range(len(position)):
        p, turn, p_prev, turn_prev = position[tool], orientation[tool], position_prev[tool], orientation_prev[tool]
        for pair in range(pair_start[tool], pair_start[tool + 1]):
            point = pair_point[pair]
            fx, fy, fz = force[point, tool, 0], force[point, tool, 1], force[point, tool, 2]
            if fx == 0.0 and fy == 0.0 and fz == 0.0:
                slip[point, tool, 0], slip[point, tool, 1], slip[point, tool, 2] = 0.0, 0.0, 0.0
                continue
            x[0], x[1], x[2] = 0.0, 0.0, 0.0
            for entry in range(indptr[point], indptr[point + 1]):
                i, n = node[entry], weight[entry]
                x[0] += n * xw[i, 0]
                x[1] += n * xw[i, 1]
                x[2] += n * xw[i, 2]
            # Where the tool's material under the point was at the start of the substep.
            bx, by, bz = carry_point(p, turn, p_prev, turn_prev, x)
            work += fx * (x[0] - bx) + fy * (x[1] - by) + fz * (x[2] - bz)
            fx, fy, fz = share * fx, share * fy, share * fz
            force_mean[point, tool, 0] += fx
            force_mean[point, tool, 1] += fy
            force_mean[point, tool, 2] += fz
            for a in range(3):
                slip[point, tool, a] += slipped[point, tool, a]
            wrench[tool, 0] -= fx
            wrench[tool, 1] -= fy
            wrench[tool, 2] -= fz
            wrench[tool, 3] -= (x[1] - p[1]) * fz - (x[2] - p[2]) * fy
            wrench[tool, 4] -= (x[2] - p[2]) * fx - (x[0] - p[0]) * fz
            wrench[tool, 5] -= (x[0] - p[0]) * fy - (x[1] - p[1]) * fx
    return work


@njit(cache=True, error_model="numpy", nogil=True)
def advance_step(
    # state, updated in place
    x,
    v,
    a,
    stress,
    force,
    slip,
    # blocks and nodes
    nodes,
    volume,
    softness,
    constants,
    linear,
    mass,
    x_rest,
    gravity,
    cell_nodes,
    # points
    indptr,
    node,
    weight,
    point_softness,
    active,
    # tools
    kind,
    shape,
    friction,
    near,
    position,
    orientation,
    position_next,
    orientation_next,
    # seam
    seam,
    seam_force,
    # scratch
    ws,
    xw,
    x_star,
    push,
    point_x,
    pair_start,
    pair_point,
    depth,
    slipped,
    pose,
    quaternion,
    node_gap,
    # results, overwritten
    force_mean,
    wrench,
    cell_distance,
    result,
    # numbers
    dt,
    n_substeps,
    n_sweeps,
    kappa,
    margin,
):
    """Advance the state by dt; shapes as in `PbdSolver`. The results are those of `Advanced`."""
    n = len(x)
    h = dt / n_substeps
    force_mean[:] = 0.0
    wrench[:] = 0.0
    tool_work = 0.0
    for i in range(n):
        free = xw[i, 3] > 0.0
        for c in range(3):
            push[i, c] = gravity[c] if free else 0.0
            xw[i, c] = x[i, c]
    for s in range(len(seam)):
        i = seam[s]
        for c in range(3):
            push[i, c] += xw[i, 3] * seam_force[s, c]
    seam_work = 0.0
    for s in range(len(seam)):
        for c in range(3):
            seam_work -= seam_force[s, c] * x[seam[s], c]
    carried(xw, nodes, stress, constants, indptr, node, weight, force, np.empty((n + 8, 3)), a)
    place_points(xw, indptr, node, weight, point_x)
    fastest = 0.0
    for i in range(n):
        square = v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2
        fastest = max(fastest, square)
    reach = margin + 2.0 * dt * np.sqrt(fastest)
    travel = tool_travel(kind, shape, position, orientation, position_next, orientation_next, x)
    find_pairs(
        kind, shape, position, orientation, point_x, active, force, reach + 2.0 * travel, pair_start, pair_point, depth
    )
    tool_pose(0.0, position, orientation, position_next, orientation_next, pose[1], quaternion[1])
    for substep in range(n_substeps):
        pose[0] = pose[1]
        quaternion[0] = quaternion[1]
        fraction = (substep + 1) / n_substeps
        tool_pose(fraction, position, orientation, position_next, orientation_next, pose[1], quaternion[1])
        predict(xw, x_star, x, v, a, push, h)
        relax(
            ws,
            xw,
            x,
            nodes,
            volume,
            softness,
            stress,
            constants,
            linear,
            indptr,
            node,
            weight,
            point_softness,
            pair_start,
            pair_point,
            depth,
            kind,
            shape,
            friction,
            pose[1],
            quaternion[1],
            pose[0],
            quaternion[0],
            force,
            slipped,
            n_sweeps,
            kappa,
            h,
        )
        finish(xw, x_star, x, v, a, h)
        tool_work += account(
            xw,
            indptr,
            node,
            weight,
            pair_start,
            pair_point,
            pose[1],
            quaternion[1],
            pose[0],
            quaternion[0],
            force,
            slipped,
            slip,
            force_mean,
            wrench,
            1.0 / n_substeps,
        )
    for s in range(len(seam)):
        for c in range(3):
            seam_work += seam_force[s, c] * x[seam[s], c]
    place_points(xw, indptr, node, weight, point_x)
    summarise(
        x,
        v,
        mass,
        x_rest,
        gravity,
        point_x,
        pair_start,
        pair_point,
        kind,
        shape,
        near,
        pose[1],
        quaternion[1],
        force,
        slip,
        result,
    )
    result[STRAIN], result[LEAST_J] = strain_energy(ws, xw, nodes, volume, constants, linear)
    # A bound of the work that it took to push points out that were inside a tool at the start.
    for tool in range(len(kind)):
        for pair in range(pair_start[tool], pair_start[tool + 1]):
            if depth[pair] > 0.0:
                f = force_mean[pair_point[pair], tool]
                result[PUSHED] += n_substeps * depth[pair] * np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    result[TOOL_WORK], result[SEAM_WORK], result[N_PAIRS] = tool_work, seam_work, pair_start[len(kind)]
    cell_distances(x, cell_nodes, kind, shape, pose[1], quaternion[1], near, node_gap, cell_distance)


@njit(cache=True, error_model="numpy")
def summarise(
    x,
    v,
    mass,
    x_rest,
    gravity,
    point_x,
    pair_start,
    pair_point,
    kind,
    shape,
    near,
    position,
    orientation,
    force,
    slip,
    result,
):
    """Energies, momenta, bounds and contact figures at the end of the step into result (N_RESULTS,)."""
    result[:] = 0.0
    result[BOUNDS : BOUNDS + 3] = np.inf
    result[BOUNDS + 3 : BOUNDS + 6] = -np.inf
    for i in range(len(x)):
        m = mass[i]
        for c in range(3):
            d, e = (c + 1) % 3, (c + 2) % 3
            result[KINETIC] += 0.5 * m * v[i, c] * v[i, c]
            result[GRAVITY] -= m * gravity[c] * (x[i, c] - x_rest[i, c])
            result[MOMENTUM + c] += m * v[i, c]
            result[ANGULAR + c] += m * (x[i, d] * v[i, e] - x[i, e] * v[i, d])
            result[BOUNDS + c] = min(result[BOUNDS + c], x[i, c])
            result[BOUNDS + 3 + c] = max(result[BOUNDS + 3 + c], x[i, c])
    for tool in range(len(kind)):
        tool_shape, place, turn = shape[tool], position[tool], orientation[tool]
        for pair in range(pair_start[tool], pair_start[tool + 1]):
            point = pair_point[pair]
            gap = tool_gap(kind[tool], tool_shape, place, turn, point_x[point])[0]
            result[PENETRATION] = max(result[PENETRATION], -gap)
            fx, fy, fz = force[point, tool, 0], force[point, tool, 1], force[point, tool, 2]
            if fx != 0.0 or fy != 0.0 or fz != 0.0:
                # A point that touches two tools counts for the first.
                first = True
                for other in range(tool):
                    f = force[point, other]
                    first = first and f[0] == 0.0 and f[1] == 0.0 and f[2] == 0.0
                result[N_CONTACTS] += 1.0 if first else 0.0
                if near[tool]:
                    s = slip[point, tool]
                    result[SLIP] = max(result[SLIP], np.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]))
