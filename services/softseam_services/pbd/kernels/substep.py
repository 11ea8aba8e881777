"""One macro step: m substeps of prediction, sweeps, contact and velocity update, all in one call.

With A the acceleration that constraints (blocks and contacts) gave the nodes, implicit Euler in carried form:
x* = x + h v + h^2 (g + a_seam + A);  sweep from x*;  A += (x - x*)/h^2;  v = (x - x_n)/h                       (1)
which is v += h (g + a_seam + A) with the new A: the mean of the substeps' contact forces times dt is their impulse.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.tools.kernels import cell_distances, tool_travel

from .contact import account_pairs, begin_pairs
from .pairs import find_pairs, place_points, store_pairs
from .relax import relax
from .summary import LEAST_J, SEAM_WORK, STRAIN, TOOL_WORK, summarise
from .sweep import block_forces, strain_energy
from .tool_motion import tool_motions, tool_pose


@njit(cache=True, error_model="numpy")
def carried(ws, xw, nodes, stress, constants, indptr, node, weight, force, pull, a):
    """A of eq. (1) from the stresses of the blocks and the contact forces, into a (n, 3).

    Once a step: added up over the substeps alone, the roundings of (x - x*)/h^2 grow into a force on the whole body.
    pull (n + 8, 4) is scratch.
    """
    pull[:] = 0.0
    block_forces(ws, nodes, stress, constants, pull)
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
    law,
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
    pull,
    point_x,
    newest,
    pair_start,
    pair_rows,
    pairs,
    pose,
    quaternion,
    motion,
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
    carried(ws, xw, nodes, stress, constants, indptr, node, weight, force, pull, a)
    place_points(xw, indptr, node, weight, point_x)
    fastest = 0.0
    for i in range(n):
        square = v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2
        fastest = max(fastest, square)
    reach = margin + 2.0 * dt * np.sqrt(fastest)
    travel = tool_travel(kind, shape, position, orientation, position_next, orientation_next, x)
    find_pairs(
        kind,
        shape,
        position,
        orientation,
        point_x,
        active,
        indptr,
        node,
        weight,
        point_softness,
        force,
        slip,
        reach + 2.0 * travel,
        h * h,
        n,
        newest,
        pair_start,
        pair_rows,
        pairs,
    )
    tool_pose(0.0, position, orientation, position_next, orientation_next, pose[1], quaternion[1])
    for substep in range(n_substeps):
        pose[0] = pose[1]
        quaternion[0] = quaternion[1]
        fraction = (substep + 1) / n_substeps
        tool_pose(fraction, position, orientation, position_next, orientation_next, pose[1], quaternion[1])
        tool_motions(pose[0], quaternion[0], pose[1], quaternion[1], motion)
        begin_pairs(
            xw,
            indptr,
            node,
            weight,
            kind,
            shape,
            pose[0],
            quaternion[0],
            h,
            pair_start,
            pair_rows,
            pairs,
        )
        predict(xw, x_star, x, v, a, push, h)
        relax(
            ws,
            xw,
            nodes,
            volume,
            softness,
            stress,
            constants,
            law,
            indptr,
            node,
            weight,
            kind,
            shape,
            friction,
            pose[1],
            quaternion[1],
            motion,
            pair_start,
            pair_rows,
            pairs,
            n_sweeps,
            kappa,
            h,
        )
        finish(xw, x_star, x, v, a, h)
        account_pairs(
            xw,
            indptr,
            node,
            weight,
            pose[1],
            motion,
            1.0 / n_substeps,
            pair_start,
            pair_rows,
            pairs,
        )
    tool_work = store_pairs(pair_start, pair_rows, pairs, force, slip, force_mean, wrench)
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
        kind,
        shape,
        near,
        pose[1],
        quaternion[1],
        force,
        pair_start,
        pair_rows,
        pairs,
        n_substeps,
        result,
    )
    result[STRAIN], result[LEAST_J] = strain_energy(ws, xw, nodes, volume, constants, law)
    result[TOOL_WORK], result[SEAM_WORK] = tool_work, seam_work
    cell_distances(x, cell_nodes, kind, shape, pose[1], quaternion[1], near, node_gap, cell_distance)
