"""One step of a body of particles: substeps of prediction, sweeps, contact and velocities.

A substep of length h (Macklin et al. 2019, "Small steps in physics simulation"):
    v <- v + h g,  x* = x + h v;  sweeps over springs, strains, bends, tools, layers;  v = (x - x_n)/h/(1 + c h)
Multipliers begin at zero in each substep.
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.tool_motion import tool_motions, tool_pose
from softseam_services.tools.kernels import tool_travel

from .bending import add_bend_forces, prepare_bends, project_bends
from .constraint import add_constraint_forces, project_constraints
from .contact import bounce, list_contacts, note_approach, project_contacts, settle_contacts
from .distance import add_distance_forces, prepare_distances, project_distances
from .grip import carry, list_held, list_holding, settle_held
from .neo_hookean import begin_pairs
from .neo_hookean import project_pairs as project_neo_hookean
from .self_contact import list_pairs, project_pairs
from .strain import project_strains
from .tetrahedron import soften

CROWDED, TOOL_WORK, TOUCHING = 0, 1, 2
N_OUTCOMES = 3


@njit(cache=True, error_model="numpy")
def _predict(xw, x_prev, v, n, gravity, h):
    """Velocities and positions under gravity alone; held particles wait to be carried. All in place."""
    for i in range(n):
        free = xw[i, 3] > 0.0
        for axis in range(3):
            x_prev[i, axis] = xw[i, axis]
            if free:
                v[i, axis] += h * gravity[axis]
                xw[i, axis] += h * v[i, axis]


@njit(cache=True, error_model="numpy")
def _farthest(xw, x_listed, n):
    """Square of the longest way of any particle since x_listed (n, 3) [m^2]; NaN counts as none."""
    longest = 0.0
    for i in range(n):
        dx, dy, dz = xw[i, 0] - x_listed[i, 0], xw[i, 1] - x_listed[i, 1], xw[i, 2] - x_listed[i, 2]
        longest = max(longest, dx * dx + dy * dy + dz * dz)
    return longest


@njit(cache=True, error_model="numpy")
def _note(xw, x_listed, n):
    """Remember where particles are as contacts are listed: x_listed (n, 3) in place."""
    for i in range(n):
        x_listed[i, 0], x_listed[i, 1], x_listed[i, 2] = xw[i, 0], xw[i, 1], xw[i, 2]


@njit(cache=True, error_model="numpy")
def _velocities(xw, x_prev, v, n, h, drag):
    """v = (x - x_n)/h/(1 + c h): of clamped and held particles without drag, which their holder overcomes."""
    for i in range(n):
        scale = 1.0 / (h * (1.0 + drag * h)) if xw[i, 3] > 0.0 else 1.0 / h
        for axis in range(3):
            v[i, axis] = (xw[i, axis] - x_prev[i, axis]) * scale


@njit(cache=True, error_model="numpy")
def advance_step(
    x,
    v,
    held,
    local,
    mass,
    weight,
    x_rest,
    gravity,
    drag,
    springs,
    bends,
    solid,
    hyper,
    joined,
    compliance,
    kind,
    shape,
    tool_reach,
    friction,
    position,
    orientation,
    position_next,
    orientation_next,
    radius,
    restitution,
    layers,
    dt,
    n_substeps,
    n_sweeps,
    stretch_share,
    bending_share,
    margin,
    work,
    contacts,
    pairs,
    poses,
    mean,
    felt,
    wrench,
    outcome,
):
    """Advance particles by dt; x, v (n, 3) updated in place.

    held, local     who holds each particle and where, see `take_hold`
    weight          (n,)  inverse masses, 0 for clamped particles [1/kg]
    springs         nodes, row, rest, compliance, inverse, soft, lambda, which of `distance`
    bends           nodes, row, coefficient, compliance, inverse, soft, lambda, which of `bending`
    solid           nodes, row, inverse, compliance, soft, lambda of `strain`
    joined          families, particle, parameter, soft, lambda, workspaces of `constraint`; compliance (m,)
    hyper           nodes, inverse, compliance, soft, lambda, gamma, pull, workspace of `neo_hookean`
    layers          (apart, friction): pairs at least so far apart at rest keep 2 radius [m]; apart = 0 for none
    stretch_share, bending_share  stiffness of classic PBD, 0 for XPBD
    margin          way that a particle may make before contacts are listed anew [m]
    work            xw, x_prev, x_listed, ids, v_prev, force, and the workspaces of springs and bends
    contacts        particle, tool, push;  pairs  cube, start, order, first, second;  poses  position, orientation,
                    motion
    mean, felt, wrench, outcome   contact force on particles (n, 3) [N], its size by tool (n, t), wrenches (t, 6) and
                    N_OUTCOMES figures, all overwritten
    """
    xw, x_prev, x_listed, ids, v_prev, force, ws_springs, ws_bends = work
    particle, tool, push = contacts
    cube, start, order, first, second = pairs
    place, turn, motion = poses
    n, h = len(x), dt / n_substeps
    for i in range(n):
        xw[i, 0], xw[i, 1], xw[i, 2] = x[i, 0], x[i, 1], x[i, 2]
        xw[i, 3] = 0.0 if held[i] >= 0.0 else weight[i]
    n_held = list_held(held, ids)
    s_nodes, s_row, s_rest, s_compliance, s_inverse, s_soft, s_lambda, s_which = springs
    b_nodes, b_row, b_coefficient, b_compliance, b_inverse, b_soft, b_lambda, b_which = bends
    prepare_distances(xw, s_nodes, s_compliance, h, stretch_share, s_inverse, s_soft)
    t_nodes, t_row, t_inverse, t_compliance, t_soft, t_lambda = solid
    soften(t_compliance, h, t_soft)
    p_nodes, p_inverse, p_compliance, p_soft, p_lambda, p_gamma, p_pull, ws_pairs = hyper
    soften(p_compliance, h, p_soft)
    prepare_bends(xw, b_nodes, b_coefficient, b_compliance, h, bending_share, b_inverse, b_soft)
    j_families, j_particle, j_parameter, j_soft, j_lambda, ws_x, ws_p, ws_g = joined
    for j in range(len(compliance)):
        j_soft[j] = compliance[j] / (h * h)
    n_springs, n_bends = 0, 0
    if n_held > 0:
        n_springs = list_holding(s_nodes, s_row, held, s_which)
        n_bends = list_holding(b_nodes, b_row, held, b_which)
    travel = tool_travel(tool_reach, position, orientation, position_next, orientation_next, x) / n_substeps
    mean[:] = 0.0
    felt[:] = 0.0
    wrench[:] = 0.0
    outcome[:] = 0.0
    share = 1.0 / n_substeps
    listed, count, n_pairs = 0, 0, 0
    tool_pose(0.0, position, orientation, position_next, orientation_next, place[0], turn[0])
    for s in range(n_substeps):
        now, then = s % 2, (s + 1) % 2
        fraction = (s + 1) * share
        tool_pose(fraction, position, orientation, position_next, orientation_next, place[then], turn[then])
        tool_motions(place[now], turn[now], place[then], turn[then], motion)
        for k in range(n_held):
            for axis in range(3):
                v_prev[k, axis] = v[ids[k], axis]
        _predict(xw, x_prev, v, n, gravity, h)
        carry(xw, n_held, ids, held, local, place[then], turn[then])
        if s == 0 or np.sqrt(_farthest(xw, x_listed[0], n)) + (s - listed) * travel >= 0.5 * margin:
            listed = s
            _note(xw, x_listed[0], n)
            reach = radius + margin
            count = list_contacts(xw, xw, n, kind, shape, tool_reach, place[then], turn[then], reach, particle, tool)
        if layers[0] > 0.0 and (s == 0 or np.sqrt(_farthest(xw, x_listed[1], n)) >= 0.5 * margin):
            _note(xw, x_listed[1], n)
            reach = 2.0 * radius + margin
            n_pairs = list_pairs(xw, n, x_rest, reach, layers[0], cube, start, order, first, second)
            if n_pairs > len(first):
                n_pairs = len(first)
                outcome[CROWDED] = 1.0
        push[:count] = 0.0
        s_lambda[:] = 0.0
        b_lambda[:] = 0.0
        t_lambda[:] = 0.0
        j_lambda[:] = 0.0
        begin_pairs(ws_pairs, xw, p_nodes, p_inverse, p_soft, p_gamma, p_lambda, p_pull)
        for _ in range(n_sweeps):
            project_distances(ws_springs, xw, s_nodes, s_rest, s_inverse, s_soft, s_lambda)
            project_strains(xw, t_nodes, t_row, t_inverse, t_soft, 1.0, t_lambda)
            project_neo_hookean(ws_pairs, xw, p_nodes, p_inverse, p_soft, p_gamma, p_lambda)
            project_bends(ws_bends, xw, b_nodes, b_coefficient, b_inverse, b_soft, b_lambda)
            project_constraints(xw, j_families, j_particle, j_parameter, j_soft, j_lambda, ws_x, ws_p, ws_g)
            if n_pairs > 0:
                outcome[TOUCHING] = project_pairs(xw, x_prev, n_pairs, first, second, 2.0 * radius, layers[1])
            project_contacts(
                xw, x_prev, count, particle, tool, kind, shape, friction, place[then], turn[then], motion, radius, push
            )
        if restitution > 0.0:
            note_approach(v, x_prev, count, particle, tool, motion, h, push)
        _velocities(xw, x_prev, v, n, h, drag)
        if restitution > 0.0:
            speed = 2.0 * h * np.sqrt(gravity[0] ** 2 + gravity[1] ** 2 + gravity[2] ** 2)
            bounce(v, x_prev, count, particle, tool, motion, h, restitution, speed, push)
        outcome[TOOL_WORK] += settle_contacts(
            xw, x_prev, mass, count, particle, tool, place[then], motion, h, share, push, mean, felt, wrench
        )
        if n_held > 0:
            add_distance_forces(xw, n_springs, s_which, s_nodes, s_row, s_lambda, h, force)
            add_bend_forces(n_bends, b_which, b_nodes, b_row, b_coefficient, b_lambda, h, force)
            add_constraint_forces(xw, j_families, j_particle, j_parameter, j_soft, j_lambda, ws_x, ws_p, ws_g, h, force)
            outcome[TOOL_WORK] += settle_held(
                *(xw, x_prev, v, v_prev, mass, gravity, 0.0, force, n_held, ids, held, place[then], motion),
                *(h, share, mean, felt, wrench),
            )
            force[:] = 0.0
    for i in range(n):
        x[i, 0], x[i, 1], x[i, 2] = xw[i, 0], xw[i, 1], xw[i, 2]
    return count
