"""One step of a body of particles: substeps of prediction, sweeps, contact and velocities.

A substep of length h (Macklin et al. 2019, "Small steps in physics simulation"):
    v <- v + h g,  x* = x + h v;  sweeps over springs, strains, bends, tools, layers;  v = (x - x_n)/h/(1 + c h)
Multipliers begin at zero in each substep.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.tool_motion import tool_motions, tool_pose
from softseam_services.tools.kernels import tool_travel

from .bending import add_bend_forces, prepare_bends, project_bends
from .constraint import add_constraint_forces, project_constraints
from .contact import bounce, list_contacts, note_approach, project_contacts, settle_contacts
from .distance import add_distance_forces, prepare_distances, project_distances
from .grip import carry, list_held, settle_held
from .neo_hookean import begin_pairs
from .neo_hookean import project_pairs as project_neo_hookean
from .self_contact import list_pairs, project_pairs
from .strain import project_strains
from .tetrahedron import soften
from .volume import project_volumes

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
def _begin(model, parameters, state, scratch, h):
    """Places and weights into xw, alpha~ and inverses of all constraints; returns how many particles tools hold."""
    xw, held, of = scratch.xw, state.held, scratch.multipliers
    for i in range(len(state.x)):
        xw[i, 0], xw[i, 1], xw[i, 2] = state.x[i, 0], state.x[i, 1], state.x[i, 2]
        xw[i, 3] = 0.0 if held[i] >= 0.0 else parameters.weight[i]
    n_held = list_held(held, scratch.ids)
    share = parameters.stretch_share
    prepare_distances(xw, model.springs, parameters.spring_compliance, h, share, of.spring_inverse, of.spring_soft)
    soften(parameters.strain_compliance, h, of.strain_soft)
    soften(parameters.pair_compliance, h, of.pair_soft)
    share, coefficient = parameters.bending_share, parameters.bend_coefficient
    prepare_bends(xw, model.bends, coefficient, parameters.bend_compliance, h, share, of.bend_inverse, of.bend_soft)
    for j in range(len(parameters.compliance)):
        of.joined_soft[j] = parameters.compliance[j] / (h * h)
    return n_held


@njit(cache=True, error_model="numpy")
def _sweep(model, parameters, scratch, outputs, count, n_pairs, then):
    """Project all constraints and contacts once."""
    xw, x_prev, of, contacts = scratch.xw, scratch.x_prev, scratch.multipliers, scratch.contacts
    project_distances(
        *(scratch.spring_work, xw, model.springs, parameters.spring_rest, of.spring_inverse, of.spring_soft, of.spring)
    )
    project_strains(
        *(xw, model.tetrahedra, model.tetrahedron_row, parameters.strain_inverse, of.strain_soft, 1.0, of.strain)
    )
    project_neo_hookean(
        *(scratch.pair_work, xw, model.paired, parameters.pair_inverse, of.pair_soft, parameters.pair_gamma, of.pair)
    )
    project_volumes(
        *(scratch.volume_work, xw, model.volumes, parameters.volume_rest, parameters.volume_share, of.volume)
    )
    project_bends(
        *(scratch.bend_work, xw, model.bends, parameters.bend_coefficient, of.bend_inverse, of.bend_soft, of.bend)
    )
    project_constraints(
        *(xw, parameters.families, parameters.particle, parameters.parameter, of.joined_soft, of.joined),
        *(scratch.x, scratch.p, scratch.g),
    )
    if n_pairs > 0:
        distance, friction = 2.0 * parameters.radius, parameters.self_friction
        outputs.outcome[TOUCHING] = project_pairs(
            xw, x_prev, n_pairs, contacts.first, contacts.second, distance, friction
        )
    project_contacts(parameters, contacts, xw, x_prev, count, then)


@njit(cache=True, error_model="numpy")
def _book_held(model, parameters, state, scratch, outputs, n_held, then, h, share):
    """Forces of the constraints on what tools hold, and what these did to it; returns their work [J]."""
    xw, of, force = scratch.xw, scratch.multipliers, scratch.force
    add_distance_forces(xw, model.springs, model.spring_row, of.spring, h, force)
    add_bend_forces(model.bends, model.bend_row, parameters.bend_coefficient, of.bend, h, force)
    add_constraint_forces(
        *(xw, parameters.families, parameters.particle, parameters.parameter, of.joined_soft, of.joined),
        *(scratch.x, scratch.p, scratch.g, h, force),
    )
    work = settle_held(parameters, state, scratch, outputs, n_held, then, h, share)
    force[:] = 0.0
    return work


@njit(cache=True, error_model="numpy")
def advance_step(model, parameters, state, inputs, scratch, outputs, dt, n_substeps, n_sweeps):
    """Advance particles by dt; the state is updated in place, what comes out overwritten. Returns how many candidates
    for contact with tools there are at the end."""
    x, v, xw, x_prev = state.x, state.v, scratch.xw, scratch.x_prev
    contacts, of, outcome = scratch.contacts, scratch.multipliers, outputs.outcome
    place, turn, gravity = contacts.position, contacts.orientation, parameters.gravity
    start, start_turn, end, end_turn = (
        inputs.position,
        inputs.orientation,
        inputs.position_next,
        inputs.orientation_next,
    )
    restitution, margin = parameters.restitution, parameters.margin
    n, h = len(x), dt / n_substeps
    n_held = _begin(model, parameters, state, scratch, h)
    travel = tool_travel(parameters.reach, start, start_turn, end, end_turn, x) / n_substeps
    outputs.mean[:] = 0.0
    outputs.felt[:] = 0.0
    outputs.wrench[:] = 0.0
    outcome[:] = 0.0
    share = 1.0 / n_substeps
    listed, count, n_pairs = 0, 0, 0
    tool_pose(0.0, start, start_turn, end, end_turn, place[0], turn[0])
    for s in range(n_substeps):
        now, then = s % 2, (s + 1) % 2
        tool_pose((s + 1) * share, start, start_turn, end, end_turn, place[then], turn[then])
        tool_motions(place[now], turn[now], place[then], turn[then], contacts.motion)
        for k in range(n_held):
            for axis in range(3):
                scratch.v_prev[k, axis] = v[scratch.ids[k], axis]
        _predict(xw, x_prev, v, n, gravity, h)
        carry(xw, n_held, scratch.ids, state.held, state.local, place[then], turn[then])
        if s == 0 or np.sqrt(_farthest(xw, scratch.x_listed[0], n)) + (s - listed) * travel >= 0.5 * margin:
            listed = s
            _note(xw, scratch.x_listed[0], n)
            count = list_contacts(parameters, contacts, xw, then, parameters.radius + margin)
        if parameters.apart > 0.0 and (s == 0 or np.sqrt(_farthest(xw, scratch.x_listed[1], n)) >= 0.5 * margin):
            _note(xw, scratch.x_listed[1], n)
            n_pairs = list_pairs(parameters, contacts, xw, 2.0 * parameters.radius + margin)
            if n_pairs > len(contacts.first):
                n_pairs = len(contacts.first)
                outcome[CROWDED] = 1.0
        contacts.push[:count] = 0.0
        of.spring[:] = 0.0
        of.bend[:] = 0.0
        of.strain[:] = 0.0
        of.volume[:] = 0.0
        of.joined[:] = 0.0
        begin_pairs(
            *(scratch.pair_work, xw, model.paired, parameters.pair_inverse, of.pair_soft, parameters.pair_gamma),
            *(of.pair, scratch.pull),
        )
        for _ in range(n_sweeps):
            _sweep(model, parameters, scratch, outputs, count, n_pairs, then)
        if restitution > 0.0:
            note_approach(contacts, v, x_prev, count, h)
        _velocities(xw, x_prev, v, n, h, parameters.drag)
        if restitution > 0.0:
            speed = 2.0 * h * np.sqrt(gravity[0] ** 2 + gravity[1] ** 2 + gravity[2] ** 2)
            bounce(parameters, contacts, v, x_prev, count, h, speed)
        outcome[TOOL_WORK] += settle_contacts(parameters, state, contacts, outputs, xw, x_prev, count, then, h, share)
        if n_held > 0:
            outcome[TOOL_WORK] += _book_held(model, parameters, state, scratch, outputs, n_held, then, h, share)
    for i in range(n):
        x[i, 0], x[i, 1], x[i, 2] = xw[i, 0], xw[i, 1], xw[i, 2]
    return count
