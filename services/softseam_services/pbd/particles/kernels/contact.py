"""Particles against rigid tools: a particle keeps `radius` from every tool, with Coulomb friction and restitution.

A candidate is a particle and a tool that may meet before candidates are listed again. In each sweep its normal push N
and its friction T [m] are projected so that, together over the sweeps of a substep, gap >= radius, N >= 0 and |T| <=
mu N, with T against the way that the particle made relative to the tool's material since the substep began: a resting
particle sticks exactly, a sliding one is braked by mu N. The force of the substep is mass/h^2 (N n + T).
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.lanes import four, three
from softseam_services.pbd.kernels.tool_motion import twelve
from softseam_services.tools.kernels import tool_gap

N_PUSH = 8
"""columns of a candidate's push: N, T (3), normal (3), approach"""


@njit(cache=True, error_model="numpy")
def list_contacts(parameters, contacts, xw, then, within):
    """Candidates: free particles within a distance [m] of a tool at its pose `then`; returns how many, in place."""
    kind, shape, position, orientation = parameters.kind, parameters.shape, contacts.position, contacts.orientation
    count = 0
    for t in range(len(kind)):
        place, turn = three(position[then], t), four(orientation[then], t)
        reach = parameters.reach[t] + max(within, 0.0)
        square = reach * reach
        for i in range(len(parameters.mass)):
            dx, dy, dz = xw[i, 0] - place[0], xw[i, 1] - place[1], xw[i, 2] - place[2]
            if dx * dx + dy * dy + dz * dz > square:
                continue
            if xw[i, 3] > 0.0 and tool_gap(kind[t], shape[t], place, turn, three(xw, i))[0] < within:
                contacts.particle[count], contacts.tool[count] = i, t
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def project_contacts(parameters, contacts, xw, x_prev, count, then):
    """Project every candidate once. Tools are at their pose `then`, motion leads there (see `tool_motions`).

    xw (n + 8, 4) updated in place; x_prev (n, 3) at the start of the substep; push (candidates, N_PUSH) in place
    """
    kind, shape, friction, radius = parameters.kind, parameters.shape, parameters.friction, parameters.radius
    factor = parameters.friction_factor
    particle, tool, push, motion = contacts.particle, contacts.tool, contacts.push, contacts.motion
    position, orientation = contacts.position[then], contacts.orientation[then]
    for c in range(count):
        i, t = particle[c], tool[c]
        gap, nx, ny, nz = tool_gap(kind[t], shape[t], three(position, t), four(orientation, t), three(xw, i))
        before = push[c, 0]
        normal = max(0.0, before + radius - gap)
        if normal == 0.0 and before == 0.0:
            continue
        push[c, 0] = normal
        push[c, 4], push[c, 5], push[c, 6] = nx, ny, nz
        change = normal - before
        xw[i, 0] += change * nx
        xw[i, 1] += change * ny
        xw[i, 2] += change * nz
        mu = friction[t] * factor[i]
        if mu == 0.0:
            continue
        m = twelve(motion, 0, t)
        px, py, pz = x_prev[i, 0], x_prev[i, 1], x_prev[i, 2]
        rx = xw[i, 0] - (m[0] * px + m[1] * py + m[2] * pz + m[9])
        ry = xw[i, 1] - (m[3] * px + m[4] * py + m[5] * pz + m[10])
        rz = xw[i, 2] - (m[6] * px + m[7] * py + m[8] * pz + m[11])
        along = rx * nx + ry * ny + rz * nz
        tx, ty, tz = push[c, 1] - rx + along * nx, push[c, 2] - ry + along * ny, push[c, 3] - rz + along * nz
        size = np.sqrt(tx * tx + ty * ty + tz * tz)
        if size > mu * normal:
            scale = mu * normal / size
            tx, ty, tz = scale * tx, scale * ty, scale * tz
        xw[i, 0] += tx - push[c, 1]
        xw[i, 1] += ty - push[c, 2]
        xw[i, 2] += tz - push[c, 3]
        push[c, 1], push[c, 2], push[c, 3] = tx, ty, tz


@njit(cache=True, error_model="numpy")
def note_approach(contacts, v, x_prev, count, h):
    """Normal speed of each touching particle relative to its tool before the substep, into push[:, 7] [m/s]."""
    particle, tool, push, motion = contacts.particle, contacts.tool, contacts.push, contacts.motion
    for c in range(count):
        if push[c, 0] > 0.0:
            i = particle[c]
            m = twelve(motion, 0, tool[c])
            px, py, pz = x_prev[i, 0], x_prev[i, 1], x_prev[i, 2]
            ux = v[i, 0] - (m[0] * px + m[1] * py + m[2] * pz + m[9] - px) / h
            uy = v[i, 1] - (m[3] * px + m[4] * py + m[5] * pz + m[10] - py) / h
            uz = v[i, 2] - (m[6] * px + m[7] * py + m[8] * pz + m[11] - pz) / h
            push[c, 7] = ux * push[c, 4] + uy * push[c, 5] + uz * push[c, 6]


@njit(cache=True, error_model="numpy")
def bounce(parameters, contacts, v, x_prev, count, h, rest_speed):
    """Give touching particles that came faster than rest_speed [m/s] that share of their speed back; v in place.

    v_n = -e v_n(before), relative to the tool (Mueller et al. 2020, "Detailed rigid body simulation with extended
    position based dynamics"); slower ones are at rest, or gravity would make them tremble.
    """
    particle, tool, push, motion = contacts.particle, contacts.tool, contacts.push, contacts.motion
    for c in range(count):
        approach = push[c, 7]
        if push[c, 0] > 0.0 and approach < -rest_speed:
            i = particle[c]
            m = twelve(motion, 0, tool[c])
            px, py, pz = x_prev[i, 0], x_prev[i, 1], x_prev[i, 2]
            nx, ny, nz = push[c, 4], push[c, 5], push[c, 6]
            ux = v[i, 0] - (m[0] * px + m[1] * py + m[2] * pz + m[9] - px) / h
            uy = v[i, 1] - (m[3] * px + m[4] * py + m[5] * pz + m[10] - py) / h
            uz = v[i, 2] - (m[6] * px + m[7] * py + m[8] * pz + m[11] - pz) / h
            change = -parameters.restitution * approach - (ux * nx + uy * ny + uz * nz)
            if change > 0.0:
                v[i, 0] += change * nx
                v[i, 1] += change * ny
                v[i, 2] += change * nz


@njit(cache=True, error_model="numpy")
def settle_contacts(parameters, state, contacts, outputs, x, x_prev, count, then, h, share):
    """Book a substep's contacts: mean force on particles (n, 3) [N], largest share of it by tool, wrenches; returns
    work.

    share is the substep's of the step; felt (n, t) [N] sums |force| by tool; wrench (t, 6) about the tools' positions,
    of the body on the tools; what a solid's particles slid is added to state.slip (n, t, 3) [m]. The work is what tools
    do on the particles in the substep [J].
    """
    particle, tool, push, motion = contacts.particle, contacts.tool, contacts.push, contacts.motion
    mass, position, force, felt, wrench = (
        parameters.mass,
        contacts.position[then],
        outputs.mean,
        outputs.felt,
        outputs.wrench,
    )
    work, slips = 0.0, len(state.slip) > 0
    for c in range(count):
        i, t = particle[c], tool[c]
        if slips:
            _slide(push[c], three(x, i), three(x_prev, i), twelve(motion, 0, t), state.slip[i, t])
        if push[c, 0] == 0.0:
            continue
        scale = mass[i] / (h * h)
        fx = scale * (push[c, 0] * push[c, 4] + push[c, 1])
        fy = scale * (push[c, 0] * push[c, 5] + push[c, 2])
        fz = scale * (push[c, 0] * push[c, 6] + push[c, 3])
        work += push_tool(three(x, i), three(x_prev, i), (fx, fy, fz), t, position, motion, share, wrench)
        force[i, 0] += share * fx
        force[i, 1] += share * fy
        force[i, 2] += share * fz
        felt[i, t] += share * np.sqrt(fx * fx + fy * fy + fz * fz)
    return work


@njit(cache=True, error_model="numpy")
def _slide(push, at, before, m, slip):
    """Add the way along the tool in a substep, from `before` to `at`, of a particle that it pushes to slip (3,) [m], in
    place; zero where it does not. m (12,): motion of the tool."""
    if push[0] == 0.0:
        slip[:] = 0.0
        return
    px, py, pz = before
    sx = at[0] - (m[0] * px + m[1] * py + m[2] * pz + m[9])
    sy = at[1] - (m[3] * px + m[4] * py + m[5] * pz + m[10])
    sz = at[2] - (m[6] * px + m[7] * py + m[8] * pz + m[11])
    along = sx * push[4] + sy * push[5] + sz * push[6]
    slip[0] += sx - along * push[4]
    slip[1] += sy - along * push[5]
    slip[2] += sz - along * push[6]


@njit(cache=True, error_model="numpy")
def push_tool(at, before, f, t, position, motion, share, wrench):
    """Add what a force f (3,) of tool t on a particle does to the tool to wrench (t, 6); returns the tool's work."""
    ax, ay, az = at[0] - position[t, 0], at[1] - position[t, 1], at[2] - position[t, 2]
    wrench[t, 0] -= share * f[0]
    wrench[t, 1] -= share * f[1]
    wrench[t, 2] -= share * f[2]
    wrench[t, 3] -= share * (ay * f[2] - az * f[1])
    wrench[t, 4] -= share * (az * f[0] - ax * f[2])
    wrench[t, 5] -= share * (ax * f[1] - ay * f[0])
    m = twelve(motion, 0, t)
    px, py, pz = before
    return (
        f[0] * (m[0] * px + m[1] * py + m[2] * pz + m[9] - px)
        + f[1] * (m[3] * px + m[4] * py + m[5] * pz + m[10] - py)
        + f[2] * (m[6] * px + m[7] * py + m[8] * pz + m[11] - pz)
    )
