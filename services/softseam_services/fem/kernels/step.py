"""One step of a region: attempts, sub-steps as the last resort, and everything that the reply reports."""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.fem.kernels.cells import strain_energy
from softseam_services.fem.kernels.contact import (
    GAP,
    NORMAL,
    OPEN,
    PRESSURE,
    SLIDE,
    TRACTION,
    augment,
    evaluate_contacts,
    find_candidates,
)
from softseam_services.fem.kernels.fronts import seam_inverse
from softseam_services.fem.kernels.newton import CONVERGED, newton, newton_carefully, refactor, residual
from softseam_services.tools.kernels import cell_distances

# entries of `out`
KINETIC, STRAIN, GRAVITY, TOOL_WORK, SEAM_WORK, MOMENTUM, ANGULAR = 0, 1, 2, 3, 4, 5, 8
PENETRATION, SLIPPED, N_CONTACTS, N_ITERATIONS, N_SUBSTEPS, LOWEST, HIGHEST = 11, 12, 13, 14, 15, 16, 19
N_OUT = 22

_CAREFUL_ITERATIONS = 60
_MOST_HALVINGS = 5
_MOST_AUGMENTATIONS = 4
# Points deeper than this after the iteration get their multipliers updated within the step [m].
_DEEP = 20e-6


@njit(cache=True, error_model="numpy")
def _tool_travel(tools):
    """Longest way of a tool's position in the step [m]."""
    longest = 0.0
    for tool in range(len(tools.kind)):
        square = 0.0
        for i in range(3):
            d = tools.position_next[tool, i] - tools.position[tool, i]
            square += d * d
        longest = max(longest, square)
    return np.sqrt(longest)


@njit(cache=True, error_model="numpy")
def _substep(x0, v0, contact0, dt, model, tree, tools, tolerance, most, careful, work, memo, x):
    """From x0, v0 over dt: x (n, 3) is the first guess, and the result in place. Returns status, iterations, count."""
    fastest = 0.0
    for node in range(len(x0)):
        for i in range(3):
            work.x_hat[node, i] = x0[node, i] + dt * v0[node, i]
            fastest = max(fastest, abs(v0[node, i]))
    reach = 0.25 * model.edge + _tool_travel(tools) + 2.0 * dt * fastest
    total = 0
    augmentations = 0
    count = find_candidates(x0, model, tools, contact0, reach, work)
    while True:
        if careful:
            status, iterations = newton_carefully(x, model, tree, tools, count, dt, tolerance, most, work, memo)
        else:
            status, iterations = newton(x, model, tree, tools, count, dt, tolerance, most, work, memo)
        total += iterations
        if status != CONVERGED:
            return status, total, count
        farthest = 0.0
        for node in range(len(x0)):
            square = 0.0
            for i in range(3):
                square += (x[node, i] - x0[node, i]) ** 2
            farthest = max(farthest, square)
        if np.sqrt(farthest) > reach:
            # a node went farther than the search for contacts looked
            reach = 2.0 * np.sqrt(farthest)
            count = find_candidates(x0, model, tools, contact0, reach, work)
            continue
        evaluate_contacts(x, model, tools, count, work)
        deepest = 0.0
        for c in range(count):
            deepest = max(deepest, -work.contact[c, GAP])
        if deepest < _DEEP or augmentations == _MOST_AUGMENTATIONS:
            return CONVERGED, total, count
        augmentations += 1
        augment(count, work)


@njit(cache=True, error_model="numpy")
def _record_contacts(x, count, contact0, model, tools, work, contact, wrench, out):
    """Forces and slip of the candidates into contact (p, t, 6); wrenches, work and counts are added to."""
    contact[:] = 0.0
    wrench[:] = 0.0
    out[PENETRATION] = out[SLIPPED] = out[N_CONTACTS] = 0.0
    for c in range(count):
        if work.state[c] == OPEN:
            continue
        point, tool = work.pair[c, 0], work.pair[c, 1]
        row = work.contact[c]
        out[N_CONTACTS] += 1.0
        out[PENETRATION] = max(out[PENETRATION], -row[GAP])
        touched = False
        for i in range(3):
            contact[point, tool, i] = row[PRESSURE] * row[NORMAL + i] + row[TRACTION + i]
            touched = touched or contact0[point, tool, i] != 0.0
        slipped = 0.0
        for i in range(3):
            if touched:
                contact[point, tool, 3 + i] = contact0[point, tool, 3 + i] + row[SLIDE + i]
            slipped += contact[point, tool, 3 + i] ** 2
        if tools.near[tool]:
            out[SLIPPED] = max(out[SLIPPED], np.sqrt(slipped))
        arm = np.zeros(3)
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            for i in range(3):
                arm[i] += model.point_weight[entry] * x[model.point_node[entry], i]
        fx, fy, fz = contact[point, tool, 0], contact[point, tool, 1], contact[point, tool, 2]
        out[TOOL_WORK] += (
            fx * (arm[0] - work.start[c, 0]) + fy * (arm[1] - work.start[c, 1]) + fz * (arm[2] - work.start[c, 2])
        )
        for i in range(3):
            arm[i] -= tools.position_next[tool, i]
        wrench[tool, 0] -= fx
        wrench[tool, 1] -= fy
        wrench[tool, 2] -= fz
        wrench[tool, 3] -= arm[1] * fz - arm[2] * fy
        wrench[tool, 4] -= arm[2] * fx - arm[0] * fz
        wrench[tool, 5] -= arm[0] * fy - arm[1] * fx


@njit(cache=True, error_model="numpy")
def _interpolate_tools(whole, part, first, last):
    """Poses of `whole` at the fractions first and last of the step into `part`, updated in place."""
    for tool in range(len(whole.kind)):
        for i in range(3):
            d = whole.position_next[tool, i] - whole.position[tool, i]
            part.position[tool, i] = whole.position[tool, i] + first * d
            part.position_next[tool, i] = whole.position[tool, i] + last * d
        size0 = size1 = 0.0
        for i in range(4):
            d = whole.orientation_next[tool, i] - whole.orientation[tool, i]
            part.orientation[tool, i] = whole.orientation[tool, i] + first * d
            part.orientation_next[tool, i] = whole.orientation[tool, i] + last * d
            size0 += part.orientation[tool, i] ** 2
            size1 += part.orientation_next[tool, i] ** 2
        for i in range(4):
            part.orientation[tool, i] /= np.sqrt(size0)
            part.orientation_next[tool, i] /= np.sqrt(size1)


@njit(cache=True, error_model="numpy")
def _attempt(x0, v0, contact0, dt, pieces, start, model, tree, whole, part, tolerance, most, careful, work, memo,
             x, v, contact, wrench, out):  # fmt: skip
    """The step in `pieces` equal parts; x, v, contact, wrench and out are the result. Returns the status."""
    n_nodes = len(x0)
    xa, va, ca = x0, v0, contact0
    if pieces > 1:
        xa, va, ca = x0.copy(), v0.copy(), contact0.copy()
    h = dt / pieces
    out[TOOL_WORK] = out[N_ITERATIONS] = 0.0
    for piece in range(pieces):
        if pieces > 1:
            _interpolate_tools(whole, part, piece / pieces, (piece + 1) / pieces)
        tools = part if pieces > 1 else whole
        if pieces > 1 or careful:
            x[:] = xa
        else:
            x[:] = start
        status, iterations, count = _substep(
            xa, va, ca, h, model, tree, tools, tolerance, most, careful, work, memo, x
        )
        if status != CONVERGED and pieces > 1:
            x[:] = xa
            status, more, count = _substep(
                xa, va, ca, h, model, tree, tools, tolerance, _CAREFUL_ITERATIONS, True, work, memo, x
            )
            iterations += more
        out[N_ITERATIONS] += iterations
        if status != CONVERGED:
            return status
        _record_contacts(x, count, ca, model, tools, work, contact, wrench, out)
        for node in range(n_nodes):
            for i in range(3):
                v[node, i] = (x[node, i] - xa[node, i]) / h
        if piece + 1 < pieces:
            xa[:] = x
            va[:] = v
            ca[:] = contact
    out[N_SUBSTEPS] = pieces
    return CONVERGED


@njit(cache=True, error_model="numpy")
def _summarise(x0, x, v, seam_force, model, work, out):
    """Energies, momenta, bounds and the seam's work into `out`."""
    kinetic = gravity = 0.0
    for i in range(3):
        out[MOMENTUM + i] = out[ANGULAR + i] = 0.0
        out[LOWEST + i], out[HIGHEST + i] = np.inf, -np.inf
    for node in range(len(model.mass)):
        mass = model.mass[node]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            kinetic += 0.5 * mass * v[node, i] * v[node, i]
            gravity -= mass * model.acceleration[i] * (x[node, i] - model.x_rest[node, i])
            out[MOMENTUM + i] += mass * v[node, i]
            out[ANGULAR + i] += mass * (x[node, j] * v[node, k] - x[node, k] * v[node, j])
            out[LOWEST + i] = min(out[LOWEST + i], x[node, i])
            out[HIGHEST + i] = max(out[HIGHEST + i], x[node, i])
    out[KINETIC], out[GRAVITY] = kinetic, gravity
    out[STRAIN] = strain_energy(x, model, work)
    out[SEAM_WORK] = 0.0
    for s in range(len(model.seam)):
        for i in range(3):
            out[SEAM_WORK] += seam_force[s, i] * (x[model.seam[s], i] - x0[model.seam[s], i])


@njit(cache=True, error_model="numpy")
def advance(x0, v0, contact0, dt, seam_force, start, model, tree, whole, part, tolerance, most, compliance, work, memo,
            x, v, contact, wrench, out, seam_x, inverse, distance):  # fmt: skip
    """Advance from x0, v0, contact0 over dt; `start` is the first guess of x. Returns a status of `newton`.

    First with the factor at hand; then carefully from x0; then in 2, 4 ... 32 parts. On failure x, v and contact are
    those of the start.
    """
    for node in range(len(model.mass)):
        for i in range(3):
            work.force[node, i] = model.mass[node] * model.acceleration[i]
    for s in range(len(model.seam)):
        for i in range(3):
            work.force[model.seam[s], i] += seam_force[s, i]
    status = _attempt(
        x0, v0, contact0, dt, 1, start, model, tree, whole, part, tolerance, most, False, work, memo,
        x, v, contact, wrench, out,
    )  # fmt: skip
    attempt = 0
    while status != CONVERGED and attempt <= _MOST_HALVINGS:
        memo[0] = 0.0
        careful = attempt == 0
        status = _attempt(
            x0, v0, contact0, dt, 1 << attempt, start, model, tree, whole, part, tolerance,
            _CAREFUL_ITERATIONS if careful else most, careful, work, memo, x, v, contact, wrench, out,
        )  # fmt: skip
        attempt += 1
    if status != CONVERGED:
        memo[0] = 0.0
        x[:] = x0
        v[:] = v0
        contact[:] = contact0
        wrench[:] = 0.0
        out[TOOL_WORK] = 0.0
    _summarise(x0, x, v, seam_force, model, work, out)
    for s in range(len(model.seam)):
        seam_x[s] = x[model.seam[s]]
    cell_distances(
        x, model.cell_nodes, whole.kind, whole.shape, whole.position_next, whole.orientation_next, whole.near,
        work.node_gap, distance,
    )  # fmt: skip
    if compliance and status == CONVERGED:
        _compliance(x0, v0, contact0, dt, x, model, tree, whole, work, memo, inverse)
    return status


@njit(cache=True, error_model="numpy")
def _compliance(x0, v0, contact0, dt, x, model, tree, tools, work, memo, inverse):
    """d(seam_x)/d(seam_force) at the end of the step, contacts included; inverse (3s, 3s) updated in place."""
    for node in range(len(x0)):
        for i in range(3):
            work.x_hat[node, i] = x0[node, i] + dt * v0[node, i]
    count = find_candidates(x0, model, tools, contact0, model.edge, work)
    residual(x, model, tools, count, dt, work, memo)
    if refactor(x, model, tree, tools, count, dt, False, work, memo):
        seam_inverse(tree, work.values, work.seam_block, inverse, work.ints)
    else:
        inverse[:] = np.nan
