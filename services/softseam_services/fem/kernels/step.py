"""One step of a region, and everything that the reply reports."""

import numpy as np

from softseam_services.body.body import SAME
from softseam_services.fem.integrators.scheme import STATIC, SYMPLECTIC_EULER, begin, finish
from softseam_services.fem.integrators.symplectic_euler import march
from softseam_services.jit import njit
from softseam_services.tools.kernels import cell_distances, tool_travel

from .candidates import find_candidates
from .contact import acting_place, augment, evaluate_contacts, next_anchor, patch_edges, point_position
from .contact_changes import add_resistance
from .contact_columns import ANCHOR, GAP, NORMAL, OPEN, PRESSURE, RELAXED, SLIDE, TRACTION
from .contact_work import add_tool_way, find_turn, is_stored_at, note_stored_at, stored_energy, yields
from .elements import strain_energy
from .linear_answer import move_on
from .newton import (
    CONVERGED,
    INDEFINITE,
    N_CANDIDATES,
    farthest,
    newton,
    refactor,
    residual,
    seam_compliance,
    seam_pull,
)
from .point_volumes import FIRST, WATCHED, loses_volume, watch_cells
from .quadrature_blending import FOLLOWS, share_cells
from .viscous_start import resist

# entries of `out`
KINETIC, STRAIN, GRAVITY, TOOL_WORK, SEAM_WORK, MOMENTUM, ANGULAR = 0, 1, 2, 3, 4, 5, 8
PENETRATION, SLIPPED, N_CONTACTS, N_ITERATIONS, LOWEST, HIGHEST = 11, 12, 13, 14, 15, 18
N_OUT = 21

# what `advance` is to do
STEP, DERIVE, CORRECT, RETRACE = 0, 1, 2, 3

# Points deeper than this after the iteration get their multipliers updated within the step [m].
_DEEP = 20e-6
# Beyond what tools and nodes travel, points closer to a tool than this share of a cell edge may touch it.
_REACH = 0.05


@njit(cache=True, error_model="numpy")
def _record_contacts(now, end, count, model, parameters, tools, work, result):
    """Forces, slip and anchors of the candidates into the state's end; wrenches, work and counts into the result."""
    x, contact0, contact, wrench, out = end.x, now.contact, end.contact, result.wrench, result.out
    contact[:] = 0.0
    wrench[:] = 0.0
    out[PENETRATION] = out[SLIPPED] = out[N_CONTACTS] = out[TOOL_WORK] = 0.0
    arm, begun, turn, way = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    known = is_stored_at(now.x, tools.position, tools.orientation, work)
    for c in range(count):
        point, tool = work.pair[c, 0], work.pair[c, 1]
        row, touched = work.contact[c], False
        for i in range(3):
            touched = touched or contact0[point, tool, i] != 0.0
        stored, work.stored[point, tool] = work.stored[point, tool], 0.0
        if touched and yields(c, work):
            if not known:
                position, orientation = tools.position[tool], tools.orientation[tool]
                stored = stored_energy(c, now.x, position, orientation, model, parameters, tools, work)
            out[TOOL_WORK] += stored
        if work.state[c] == OPEN:
            continue
        out[N_CONTACTS] += 1.0
        out[PENETRATION] = max(out[PENETRATION], -row[GAP])
        for i in range(3):
            contact[point, tool, i] = row[PRESSURE] * row[NORMAL + i] + row[TRACTION + i]
        slipped = 0.0
        for i in range(3):
            if touched:
                contact[point, tool, 3 + i] = contact0[point, tool, 3 + i] + row[SLIDE + i]
            slipped += contact[point, tool, 3 + i] ** 2
        if tools.followed[tool]:
            out[SLIPPED] = max(out[SLIPPED], np.sqrt(slipped))
        point_position(x, model, parameters, point, arm)
        next_anchor(c, arm, work, contact[point, tool, ANCHOR:])
        fx, fy, fz = contact[point, tool, 0], contact[point, tool, 1], contact[point, tool, 2]
        acting_place(c, now.x, model, parameters, work, begun)
        acting_place(c, x, model, parameters, work, arm)
        for i in range(3):
            way[i] = arm[i] - begun[i]
            arm[i] -= tools.position_next[tool, i]
        if yields(c, work):
            position, orientation = tools.position_next[tool], tools.orientation_next[tool]
            stored = stored_energy(c, x, position, orientation, model, parameters, tools, work)
            work.stored[point, tool] = stored
            out[TOOL_WORK] -= stored
            for i in range(3):
                out[TOOL_WORK] += row[TRACTION + i] * way[i]
                way[i] = 0.0
            find_turn(tools, tool, turn)
            add_tool_way(tools, tool, turn, arm, 1.0, way)
            for i in range(3):
                out[TOOL_WORK] += row[PRESSURE] * row[NORMAL + i] * way[i]
        else:
            out[TOOL_WORK] += fx * way[0] + fy * way[1] + fz * way[2]
        wrench[tool, 0] -= fx
        wrench[tool, 1] -= fy
        wrench[tool, 2] -= fz
        wrench[tool, 3] -= arm[1] * fz - arm[2] * fy
        wrench[tool, 4] -= arm[2] * fx - arm[0] * fz
        wrench[tool, 5] -= arm[0] * fy - arm[1] * fx
    note_stored_at(x, tools.position_next, tools.orientation_next, work)


@njit(cache=True, error_model="numpy")
def _follow_contacts(x0, x, count, model, parameters, tools, work, result):
    """The step was moved on by work.d: wrenches and the tools' work follow as the factor has contacts, in place.

    With K the stiffness that the factor holds at a point, its force changes by -K d, so that the momentum of the moved
    step balances exactly. Contact itself, in the state, stays as it was solved.
    """
    begun, place, moved, force = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    wrench, out, still, turn, way = result.wrench, result.out, np.zeros(3), np.empty(3), np.empty(3)
    for c in range(count):
        point, tool, row, lean = work.pair[c, 0], work.pair[c, 1], work.contact[c], work.lean[c]
        touches = work.state[c] != OPEN
        by_energy = touches and yields(c, work)
        if touches:
            _moved_by(work.d, model, parameters, point, moved)
            for i in range(3):
                f = row[TRACTION + i] + (0.0 if by_energy else row[PRESSURE] * row[NORMAL + i])
                out[TOOL_WORK] += f * (moved[0, i] + lean[0] * moved[1, i] + lean[1] * moved[2, i])
        if by_energy:
            position, orientation = tools.position_next[tool], tools.orientation_next[tool]
            stored = stored_energy(c, x, position, orientation, model, parameters, tools, work)
            out[TOOL_WORK] += work.stored[point, tool] - stored
            work.stored[point, tool] = stored
        if work.factored_state[point, tool] == OPEN:
            continue
        _moved_by(work.d, model, parameters, point, moved)
        force[:] = 0.0
        add_resistance(-1.0, work.factored[point, tool], work.factored_patch[point, tool], still, moved, force)
        _frame(x0, model, parameters, point, begun)
        _frame(x, model, parameters, point, place)
        for each in range(3):
            for i in range(3):
                begun[each, i] = place[each, i] - begun[each, i]
        for i in range(3):
            wrench[tool, i] -= force[0, i]
            place[0, i] -= tools.position_next[tool, i]
        find_turn(tools, tool, turn)
        for each in range(3):
            along = 0.0
            for i in range(3):
                along += force[each, i] * row[NORMAL + i] if by_energy else 0.0
                way[i] = 0.0
            add_tool_way(tools, tool, turn, place[each], 1.0 if each == 0 else 0.0, way)
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                pressed = along * row[NORMAL + i]
                out[TOOL_WORK] += (force[each, i] - pressed) * begun[each, i] + pressed * way[i]
                wrench[tool, 3 + i] -= place[each, j] * force[each, k] - place[each, k] * force[each, j]
    note_stored_at(x, tools.position_next, tools.orientation_next, work)


@njit(cache=True, error_model="numpy")
def _moved_by(step, model, parameters, point, moved):
    """moved (3, 3) <- what a surface point and the edges of its patch move by where nodes move by `step`, in the order
    of the factor."""
    moved[:] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place = 3 * model.order[model.point_node[entry]]
        if place >= 0:
            for i in range(3):
                moved[0, i] += parameters.point_weight[entry] * step[place + i]
                moved[1, i] += parameters.point_tilt[entry, 0] * step[place + i]
                moved[2, i] += parameters.point_tilt[entry, 1] * step[place + i]


@njit(cache=True, error_model="numpy")
def _frame(x, model, parameters, point, place):
    """place (3, 3) <- a surface point, and the edges of its patch, where nodes are at x (n, 3) [m]."""
    point_position(x, model, parameters, point, place[0])
    patch_edges(x, model, parameters, point, place[1:])


@njit(cache=True, error_model="numpy")
def _summarise(x0, x, v, seam_force, pulled, model, parameters, work, out):
    """Energies, momenta, bounds and the seam's work into `out`; pulled: what lies beyond the seam pulls on it, too."""
    kinetic = gravity = 0.0
    for i in range(3):
        out[MOMENTUM + i] = out[ANGULAR + i] = 0.0
        out[LOWEST + i], out[HIGHEST + i] = np.inf, -np.inf
    for node in range(len(model.order)):
        mass = parameters.mass[node]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            kinetic += 0.5 * mass * v[node, i] * v[node, i]
            gravity -= mass * parameters.acceleration[i] * (x[node, i] - parameters.x_rest[node, i])
            out[MOMENTUM + i] += mass * v[node, i]
            out[ANGULAR + i] += mass * (x[node, j] * v[node, k] - x[node, k] * v[node, j])
            out[LOWEST + i] = min(out[LOWEST + i], x[node, i])
            out[HIGHEST + i] = max(out[HIGHEST + i], x[node, i])
    out[KINETIC], out[GRAVITY] = kinetic, gravity
    out[STRAIN] = strain_energy(x, model, parameters, work)
    out[SEAM_WORK] = 0.0
    if pulled:
        seam_pull(x, model, work)
    for s in range(len(model.seam)):
        for i in range(3):
            force = seam_force[s, i]
            if pulled:
                force += work.seam_actual[s, i]
            work.seam_actual[s, i] = force
            out[SEAM_WORK] += force * (x[model.seam[s], i] - x0[model.seam[s], i])


@njit(cache=True, error_model="numpy")
def _report(now, end, inputs, pulled, model, parameters, work, result):
    """What the reply reports of the end of a step but contact, in place."""
    x, tools = end.x, inputs.tools
    _summarise(now.x, x, end.v, inputs.seam_force, pulled, model, parameters, work, result.out)
    for s in range(len(model.seam)):
        for i in range(3):
            result.seam_x[s, i] = x[model.seam[s], i]
    cell_distances(
        x, model.cell_nodes, tools.kind, tools.shape, tools.position_next, tools.orientation_next, tools.followed,
        work.node_gap, result.distance,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _flies_on(x, x0, v0, dt, edge):
    """Whether x (n, 3) is x0 + dt v0, and not what an exchange or an attempt before this one has found."""
    for node in range(len(x0)):
        for i in range(3):
            if abs(x[node, i] - (x0[node, i] + dt * v0[node, i])) > SAME * edge:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _reach(x0, v0, dt, parameters, tools):
    """How near to a tool's end a point is when a step begins to be a candidate, unless nodes go farther [m]."""
    fastest = 0.0
    for node in range(len(x0)):
        for i in range(3):
            fastest = max(fastest, abs(v0[node, i]))
    travel = tool_travel(
        tools.reach, tools.position, tools.orientation, tools.position_next, tools.orientation_next, x0
    )
    return _REACH * parameters.edge + travel + 2.0 * dt * fastest


@njit(cache=True, error_model="numpy")
def _retrace(scheme, model, parameters, now, end, inputs, with_factor, work):
    """Candidates, contact and residual of a step that was taken, at its end, and with_factor the matrix there.

    It was solved with the last of work.augmented_force, where there is one. Returns a status and the candidates.
    """
    x0, x, tools = now.x, end.x, inputs.tools
    inertia, share = begin(scheme, inputs.dt, inputs.past, x0, now.v, now.history, work.x_hat)
    resist(scheme, inputs.dt, share, x0, model, parameters, work)
    reach, way = _reach(x0, now.v, inputs.dt, parameters, tools), farthest(x0, x)
    if way > reach:
        reach = 2.0 * way
    count = find_candidates(
        x0, now.v, inputs.dt, model, parameters, tools, now.contact, reach, inertia, inputs.pace, work
    )
    if loses_volume(model):
        watch_cells(FIRST, x, model, parameters, work)
    if work.augmentations[0] > 0:
        multiplier = work.augmented_force[work.augmentations[0] - 1]
        for c in range(count):
            for i in range(3):
                work.multiplier[c, i] = multiplier[work.pair[c, 0], work.pair[c, 1], i]
    residual(x, x0, model, parameters, tools, count, inertia, share, work)
    good = True
    if with_factor:
        for c in range(count):
            work.contact[c, RELAXED] = 1.0
        tree = model.tree
        good = refactor(x, x0, model, parameters, tree, tools, count, inertia, share, False, -np.inf, False, work)
    return CONVERGED if good else INDEFINITE, count


@njit(cache=True, error_model="numpy")
def _keep_augmentation(x, count, work):
    """Keep where the step was solved, and the multipliers that it is solved with next: its derivatives need them."""
    at = work.augmentations[0]
    for node in range(len(x)):
        for i in range(3):
            work.augmented_x[at, node, i] = x[node, i]
    multiplier = work.augmented_force[at]
    multiplier[:] = 0.0
    for c in range(count):
        for i in range(3):
            multiplier[work.pair[c, 0], work.pair[c, 1], i] = work.multiplier[c, i]
    work.augmentations[0] = at + 1


@njit(cache=True, error_model="numpy", forceinline=True)
def _implicit(scheme, model, parameters, now, end, inputs, settings, work):
    """x, v and history of the step's end by Newton's method; returns status, iterations and candidates of contact."""
    dt, past, tools, tree = inputs.dt, inputs.past, inputs.tools, model.tree
    x0, v0, history, x = now.x, now.v, now.history, end.x
    inertia, share = begin(scheme, dt, past, x0, v0, history, work.x_hat)
    resist(scheme, dt, share, x0, model, parameters, work)
    reach = _reach(x0, v0, dt, parameters, tools)
    total = augmentations = count = 0
    search, flies = True, _flies_on(x, x0, v0, dt, parameters.edge)
    while True:
        if search:
            count = find_candidates(
                x0, v0, dt, model, parameters, tools, now.contact, reach, inertia, inputs.pace, work
            )
            search = False
            work.augmentations[0] = 0
        status, iterations = newton(x, x0, model, parameters, tree, tools, count, inertia, share, settings, flies, work)
        flies = False  # from here on, x is a solution of something
        total += iterations
        if status != CONVERGED:
            return status, total, count
        way = farthest(x0, x)
        if way > reach:
            # a node went farther than the search for contacts looked
            reach = 2.0 * way
            search = True
            continue
        if loses_volume(model) and watch_cells(FIRST, x, model, parameters, work) > 0:
            # cells that were left out got to where they count
            continue
        evaluate_contacts(x, model, parameters, tools, count, work)
        deepest = 0.0
        for c in range(count):
            if work.hold[c, 1] == 1.0:
                deepest = max(deepest, -work.contact[c, GAP])
        if deepest < _DEEP or augmentations == len(work.augmented_x):
            break
        augmentations += 1
        augment(count, work)
        _keep_augmentation(x, count, work)
    finish(scheme, dt, past, x0, v0, history, x, end.v, end.history)
    return CONVERGED, total, count


@njit(cache=True, error_model="numpy", nogil=True)
def advance(scheme, model, parameters, now, end, inputs, settings, work, result, task):
    """One step from `now` into `end`, whose x is the first guess; returns a status of `newton`.

    task: STEP; or DERIVE, in its place its `seam_compliance` at the end, into result.compliance; or CORRECT, move the
    step that was taken last on by its linear answer to inputs.push, inputs.seam_force being what acts then; or RETRACE,
    look at a step that was taken again, see `_retrace`, with the matrix where settings.most is not 0.
    Kernels of their own would be compiled from the same hundred and forty functions once more.

    end and result are valid where the status is CONVERGED; result.out[N_ITERATIONS] and work.memo always.
    """
    if task == DERIVE:
        inverse = result.compliance
        good = seam_compliance(scheme, model, parameters, model.tree, now, end.x, inputs, work, inverse)
        return CONVERGED if good else INDEFINITE
    if task == CORRECT:
        move_on(model, model.tree, work, inputs.push, inputs.dt, end.x, end.v)
        _follow_contacts(now.x, end.x, int(work.memo[N_CANDIDATES]), model, parameters, inputs.tools, work, result)
        _report(now, end, inputs, False, model, parameters, work, result)
        return CONVERGED
    x0 = now.x
    load = inputs.past if scheme.kind == STATIC else 1.0
    for node in range(len(x0)):
        for i in range(3):
            work.force[node, i] = load * parameters.mass[node] * parameters.acceleration[i]
    for s in range(len(model.seam)):
        for i in range(3):
            work.force[model.seam[s], i] += inputs.seam_force[s, i]
    end.passed[0] = now.passed[0] + share_cells(
        x0, now.share, 1.0 if scheme.kind == STATIC else FOLLOWS, model, parameters, work, end.share
    )
    work.watched[:] = False
    work.watches[0] = 0
    if loses_volume(model):
        # a march does not look again
        watch_cells(-np.inf if scheme.kind == SYMPLECTIC_EULER else WATCHED, x0, model, parameters, work)
    count = 0
    if task == RETRACE:
        status, count = _retrace(scheme, model, parameters, now, end, inputs, settings.most > 0, work)
        work.memo[N_CANDIDATES] = count
        return status
    if scheme.kind == SYMPLECTIC_EULER:
        longest = scheme.parameters[1]
        status, iterations = march(longest, x0, now.v, inputs.dt, model, parameters, work, end.x, end.v)
    else:
        status, iterations, count = _implicit(scheme, model, parameters, now, end, inputs, settings, work)
    result.out[N_ITERATIONS] = iterations
    if status != CONVERGED:
        return status
    work.memo[N_CANDIDATES] = count
    _record_contacts(now, end, count, model, parameters, inputs.tools, work, result)
    _report(now, end, inputs, work.seam_coupled[0] == 1, model, parameters, work, result)
    return CONVERGED
