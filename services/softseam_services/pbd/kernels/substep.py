"""One macro step: m substeps of prediction, sweeps, contact and velocity update, all in one call.

With A the acceleration that constraints (blocks and contacts) gave the nodes, implicit Euler in carried form:
x* = x + h v + h^2 (g + a_seam + A);  sweep from x*;  A += (x - x*)/h^2;  v = (x - x_n)/h                       (1)
which is v += h (g + a_seam + A) with the new A: the mean of the substeps' contact forces times dt is their impulse.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import cell_distances

from . import trust
from .block import of_batch
from .contact import account_pairs, begin_pairs
from .damping import damping_share, note_shapes
from .hanging import follow
from .hold import find_held_blocks
from .lanes import copy_rows
from .memory import begun_before, remembers
from .monitor import batch_residuals, residual
from .pairs import acting_weight, find_pairs, look_ahead, place_points, store_pairs
from .relax import relax
from .renew import renew, renewed_every
from .stored import stored_energy
from .summary import LEAST_J, RESIDUAL, SEAM_WORK, STORED, STRAIN, STRETCH, TOOL_WORK, summarise
from .sweep import batch_energies, block_forces, remember, strain_energy
from .thread_team import done, first_range, next_range, wait_for
from .tool_motion import tool_motions, tool_pose

LEAST, LEAST_BATCHES = 256, 8
"""nodes and batches that a thread takes at least"""


@njit(cache=True, error_model="numpy")
def carried(model, parameters, state, xw, pull):
    """A of eq. (1) from the blocks' forces in pull (n + 8, 4) [N], updated in place, and the contacts', into state.a.

    Once a step: added up over the substeps alone, the roundings of (x - x*)/h^2 grow into a force on the whole body.
    """
    indptr, node, weight, tilt = model.indptr, model.node, parameters.weight, parameters.tilt
    force, lean, a = state.force, state.lean, state.a
    for point in range(len(force)):
        for tool in range(force.shape[1]):
            s, t = lean[point, tool, 0], lean[point, tool, 1]
            for c in range(3):
                f = force[point, tool, c]
                if f != 0.0:
                    for entry in range(indptr[point], indptr[point + 1]):
                        pull[node[entry], c] += acting_weight(entry, weight, tilt, s, t) * f
    for i in range(len(a)):
        for c in range(3):
            a[i, c] = xw[i, 3] * pull[i, c]


@njit(cache=True, error_model="numpy")
def predict(xw, x_star, x, v, a, push, keep, h, first, end):
    """x* of eq. (1) into xw and x_star for the nodes first .. end - 1; push (n, 3) = g + a_seam [m/s^2].

    keep v in place of v: what mass-proportional damping of rate r leaves in a substep, exp(-r h). Clamped nodes, and
    those that hang on others, stay.
    """
    for i in range(first, end):
        if xw[i, 3] == 0.0:
            continue
        for c in range(3):
            moved = x[i, c] + h * (keep * v[i, c] + h * (push[i, c] + a[i, c]))
            x_star[i, c] = moved
            xw[i, c] = moved


@njit(cache=True, error_model="numpy")
def finish(xw, x_star, x, v, a, h, first, end):
    """A, v and x of the nodes first .. end - 1 at the end of the substep, eq. (1); updated in place."""
    per_h = 1.0 / h
    per_hh = per_h * per_h
    for i in range(first, end):
        if xw[i, 3] == 0.0:
            continue
        for c in range(3):
            now = xw[i, c]
            a[i, c] += (now - x_star[i, c]) * per_hh
            v[i, c] = (now - x[i, c]) * per_h
            x[i, c] = now


@njit(cache=True, error_model="numpy")
def open_step(model, parameters, state, inputs, scratch, dt, h):
    """What a step of dt [s] in substeps of h [s] begins with: positions, pushes, pairs that may touch. Returns what the
    seam's forces did so far, less what they do at the end [J]."""
    x, v = state.x, state.v
    contacts, seam, gravity = scratch.contacts, model.seam, parameters.gravity
    xw, push, pull, seam_force = scratch.xw, scratch.push, scratch.pull, inputs.seam_force
    n = len(x)
    seam_work = 0.0
    state.force_mean[:] = 0.0
    for i in range(n):
        free = xw[i, 3] > 0.0
        for c in range(3):
            push[i, c] = gravity[c] if free else 0.0
            xw[i, c] = x[i, c]
    for s in range(len(seam)):
        i = seam[s]
        for c in range(3):
            push[i, c] += xw[i, 3] * seam_force[s, c]
    for s in range(len(seam)):
        for c in range(3):
            seam_work -= seam_force[s, c] * x[seam[s], c]
    pull[:] = 0.0
    place_points(model, parameters, xw, contacts.point_x)
    fastest = 0.0
    for i in range(n):
        square = v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2
        fastest = max(fastest, square)
    way = dt * np.sqrt(fastest)
    travel = look_ahead(parameters, inputs, contacts, x, way)
    find_pairs(model, parameters, state, inputs, contacts, parameters.margin + 2.0 * (way + travel), h * h)
    copy_rows(contacts.found_at, xw)
    copy_rows(scratch.softness, parameters.softness)
    find_held_blocks(model, parameters, contacts)
    tool_pose(
        *(0.0, inputs.position, inputs.orientation, inputs.position_next, inputs.orientation_next),
        *(contacts.position[1], contacts.orientation[1]),
    )
    if state.monitor[trust.STORED] < 0.0:
        state.monitor[trust.STORED] = stored_energy(model, parameters, contacts, xw)
    return seam_work


@njit(cache=True, error_model="numpy")
def pull_blocks(model, parameters, state, scratch, parts, team, worker, before, stretch, ws):
    """Forces of the blocks into scratch.pull (n + 8, 4) [N]. Returns before and stretch as they are then."""
    for part in range(len(parts) - 1):
        begin, n_batches = parts[part], parts[part + 1] - parts[part]
        first, end = first_range(team, before, stretch, n_batches, worker, LEAST_BATCHES)
        while first < end:
            block_forces(ws, model.blocks, state.stress, parameters.constants, scratch.pull, begin + first, begin + end)
            first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
        before, stretch = before + n_batches, stretch + 1
    return before, stretch


@njit(cache=True, error_model="numpy")
def open_substep(model, parameters, state, inputs, scratch, dt, h, substep, n_substeps):
    """Tools, forces on the seam and pairs as a substep begins. Returns what those forces did, as of `open_step`."""
    contacts, seam, xw, push, x = scratch.contacts, model.seam, scratch.xw, scratch.push, state.x
    pose, quaternion, seam_growth = contacts.position, contacts.orientation, inputs.seam_growth
    seam_work = 0.0
    copy_rows(pose[0], pose[1])
    copy_rows(quaternion[0], quaternion[1])
    fraction = (substep + 1) / n_substeps
    tool_pose(
        *(fraction, inputs.position, inputs.orientation, inputs.position_next, inputs.orientation_next),
        *(pose[1], quaternion[1]),
    )
    tool_motions(pose[0], quaternion[0], pose[1], quaternion[1], contacts.motion)
    begun_before(parameters.constants.table, dt * fraction)
    if substep > 0:
        for s in range(len(seam_growth)):
            i = seam[s]
            for c in range(3):
                push[i, c] += xw[i, 3] * seam_growth[s, c]
                seam_work -= seam_growth[s, c] * x[i, c]
    begin_pairs(model, parameters, contacts, xw, state.a, h)
    return seam_work


@njit(cache=True, error_model="numpy")
def renew_all(model, parameters, state, scratch, h, substep, n_substeps, team, worker, before, stretch, ws):
    """What blocks that relax remember where so many substeps of h [s] are over, and what folds it for those to come, of
    n. Returns before and stretch then."""
    every = renewed_every(parameters, h, n_substeps)
    if every == 0 or (substep % every > 0 and substep < n_substeps):
        return before, stretch
    elapsed = 0.0 if substep == 0 else h * ((substep - 1) % every + 1)
    ahead = min(every, n_substeps - substep)
    middle = 0.5 * (ahead + 1) * h if ahead > 0 else 0.0
    first, end = first_range(team, before, stretch, len(model.blocks), worker, LEAST_BATCHES)
    while first < end:
        renew(
            *(ws, scratch.xw, model.blocks, parameters.constants, state.memory, elapsed, ahead * h, middle),
            *(first, end),
        )
        first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
    return before + len(model.blocks), stretch + 1


@njit(cache=True, error_model="numpy")
def predict_all(model, parameters, state, scratch, h, substep, n_substeps, share, team, worker, before, stretch, ws):
    """x* of all nodes, and what damping, by its `damping_share`, notes of shapes. Returns before and stretch then."""
    before, stretch = renew_all(
        model, parameters, state, scratch, h, substep, n_substeps, team, worker, before, stretch, ws
    )
    nodes, n = model.blocks, len(state.x)
    keep = np.exp(-parameters.mass_rate * h)
    if share > 0.0:
        first, end = first_range(team, before, stretch, len(nodes), worker, LEAST_BATCHES)
        while first < end:
            note_shapes(
                *(ws, scratch.xw, nodes, parameters.volume, parameters.constants, parameters.law, scratch.asked),
                *(scratch.frame, first, end),
            )
            first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
        before, stretch = before + len(nodes), stretch + 1
    first, end = first_range(team, before, stretch, n, worker, LEAST)
    while first < end:
        predict(scratch.xw, scratch.x_star, state.x, state.v, state.a, scratch.push, keep, h, first, end)
        first, end = next_range(team, stretch, worker, end - first, LEAST)
    return before + n, stretch + 1


@njit(cache=True, error_model="numpy")
def finish_all(state, scratch, h, team, worker, before, stretch):
    """The end of a substep, of all nodes. Returns before and stretch as they are then."""
    n = len(state.x)
    first, end = first_range(team, before, stretch, n, worker, LEAST)
    while first < end:
        finish(scratch.xw, scratch.x_star, state.x, state.v, state.a, h, first, end)
        first, end = next_range(team, stretch, worker, end - first, LEAST)
    return before + n, stretch + 1


@njit(cache=True, error_model="numpy")
def look_at_blocks(model, parameters, state, scratch, h, n_substeps, share, team, worker, before, stretch, ws):
    """Energies and residuals of the blocks as a step ends, into scratch.figures, and what materials remember. Returns
    before as it is then."""
    nodes, volume, constants, law = model.blocks, parameters.volume, parameters.constants, parameters.law
    xw, figures = scratch.xw, scratch.figures
    before, stretch = renew_all(
        model, parameters, state, scratch, h, n_substeps, n_substeps, team, worker, before, stretch, ws
    )
    if len(nodes) > 0 and remembers(of_batch(constants, 0)):
        first, end = first_range(team, before, stretch, len(nodes), worker, LEAST_BATCHES)
        while first < end:
            remember(ws, xw, nodes, volume, constants, law, first, end)
            first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
        before, stretch = before + len(nodes), stretch + 1
    first, end = first_range(team, before, stretch, len(nodes), worker, LEAST_BATCHES)
    applied = scratch.asked if share > 0.0 else state.stress
    while first < end:
        batch_energies(ws, xw, nodes, volume, constants, law, first, end, figures)
        batch_residuals(ws, xw, nodes, volume, applied, constants, law, first, end, figures)
        first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
    return before + len(nodes)


@njit(cache=True, error_model="numpy")
def close_step(model, parameters, state, inputs, scratch, outputs, n_substeps, seam_work):
    """What came of a step, once blocks were looked at; seam_work as of `open_step` and `open_substep` [J]."""
    x, contacts, seam, result = state.x, scratch.contacts, model.seam, outputs.result
    seam_force, seam_growth = inputs.seam_force, inputs.seam_growth
    tool_work = store_pairs(contacts, state, outputs.wrench)
    for s in range(len(seam)):
        for c in range(3):
            seam_work += seam_force[s, c] * x[seam[s], c]
    for s in range(len(seam_growth)):
        for c in range(3):
            seam_work += (n_substeps - 1) * seam_growth[s, c] * x[seam[s], c]
    place_points(model, parameters, scratch.xw, contacts.point_x)
    follow(x, state.v, model.hanging)
    summarise(parameters, state, contacts, n_substeps, result)
    result[STRAIN], result[LEAST_J] = strain_energy(scratch.figures)
    result[RESIDUAL], result[STRETCH] = residual(scratch.figures)
    result[STORED] = stored_energy(model, parameters, contacts, scratch.xw)
    result[TOOL_WORK] = tool_work + state.monitor[trust.STORED] - result[STORED]
    result[SEAM_WORK] = seam_work
    cell_distances(
        *(x, model.cell_nodes, parameters.kind, parameters.shape, contacts.position[1], contacts.orientation[1]),
        *(parameters.followed, scratch.node_gap, outputs.distance),
    )


@njit(cache=True, error_model="numpy", nogil=True)
def advance_step(model, parameters, state, inputs, scratch, outputs, dt, n_substeps, n_sweeps, parts, team, worker, ws):
    """Advance the state by dt; what comes out is overwritten, and is that of `Advanced`.

    Run by one thread, or by two with a workspace `ws` each and the same `team`; what is not shared is worker 0's.
    """
    contacts, xw = scratch.contacts, scratch.xw
    h = dt / n_substeps
    share = damping_share(parameters.stiffness_time, parameters.lag, h, n_sweeps)
    before, stretch = 1, 0
    seam_work = 0.0
    if worker == 0:
        seam_work = open_step(model, parameters, state, inputs, scratch, dt, h)
        done(team, worker, 1)
    before, stretch = pull_blocks(model, parameters, state, scratch, parts, team, worker, before, stretch, ws)
    if worker == 0:
        wait_for(team, before)
        carried(model, parameters, state, xw, scratch.pull)
        done(team, worker, 1)
    before += 1
    for substep in range(n_substeps):
        if worker == 0:
            wait_for(team, before)
            seam_work += open_substep(model, parameters, state, inputs, scratch, dt, h, substep, n_substeps)
            done(team, worker, 1)
        before += 1
        before, stretch = predict_all(
            model, parameters, state, scratch, h, substep, n_substeps, share, team, worker, before, stretch, ws
        )
        before, stretch = relax(
            model, parameters, state.stress, scratch, substep, n_sweeps, h, parts, worker, team, before, stretch, ws
        )
        before, stretch = finish_all(state, scratch, h, team, worker, before, stretch)
        if worker == 0:
            # The positions in xw stay until the next prediction, which waits for this.
            account_pairs(model, parameters, contacts, xw, 1.0 / n_substeps)
    before = look_at_blocks(model, parameters, state, scratch, h, n_substeps, share, team, worker, before, stretch, ws)
    if worker > 0:
        return
    wait_for(team, before)
    close_step(model, parameters, state, inputs, scratch, outputs, n_substeps, seam_work)
