"""Grippers: tools that hold particles where they took them, in the tool's own frame."""

from softseam_services.jit import njit
from softseam_services.pbd.kernels.lanes import four, three
from softseam_services.tools.kernels import rotate, rotate_back, tool_gap

from .contact import push_tool


@njit(cache=True, error_model="numpy")
def take_hold(parameters, state, inputs):
    """Let tools that begin to grip take the free particles within reach, and those that stop let theirs go.

    What is asked is inputs.gripping; grips (t,) says what was before, held (n,) the tool of each particle or -1, local
    (n, 3) the place in that tool's frame [m]: these three of the state are updated in place.
    """
    kind, shape, reach, weight = parameters.kind, parameters.shape, parameters.hold, parameters.weight
    x, held, local, grips = state.x, state.held, state.local, state.grips
    for t in range(len(kind)):
        wanted = inputs.gripping[t] != 0
        if wanted and grips[t] == 0.0:
            place, turn = three(inputs.position, t), four(inputs.orientation, t)
            for i in range(len(held)):
                if held[i] >= 0.0 or weight[i] == 0.0:
                    continue
                if tool_gap(kind[t], shape[t], place, turn, three(x, i))[0] > reach:
                    continue
                held[i] = t
                local[i, 0], local[i, 1], local[i, 2] = rotate_back(
                    turn, x[i, 0] - place[0], x[i, 1] - place[1], x[i, 2] - place[2]
                )
        elif not wanted and grips[t] != 0.0:
            for i in range(len(held)):
                if held[i] == t:
                    held[i] = -1.0
        grips[t] = 1.0 if wanted else 0.0


@njit(cache=True, error_model="numpy")
def list_held(held, ids):
    """Ids of held particles into ids (n,) in place; returns how many."""
    count = 0
    for i in range(len(held)):
        if held[i] >= 0.0:
            ids[count] = i
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def carry(xw, count, ids, held, local, position, orientation):
    """Put held particles where their tools are at these poses; xw (n + 8, 4) in place."""
    for k in range(count):
        i = ids[k]
        t = int(held[i])
        x, y, z = rotate(four(orientation, t), local[i, 0], local[i, 1], local[i, 2])
        xw[i, 0], xw[i, 1], xw[i, 2] = position[t, 0] + x, position[t, 1] + y, position[t, 2] + z


@njit(cache=True, error_model="numpy")
def settle_held(parameters, state, scratch, outputs, count, then, h, share):
    """Book what tools did to the particles they hold: f = m (a - g) - forces of the constraints; returns work [J].

    scratch.force (n + 8, 3) of constraints on particles [N], zeroed for the held ones; see `settle_contacts` for the
    others
    """
    mass, gravity, contacts, force = parameters.mass, parameters.gravity, scratch.contacts, scratch.force
    xw, x_prev, v, v_prev = scratch.xw, scratch.x_prev, state.v, scratch.v_prev
    position, motion, mean, felt, wrench = (
        contacts.position[then],
        contacts.motion,
        outputs.mean,
        outputs.felt,
        outputs.wrench,
    )
    work = 0.0
    for k in range(count):
        i = scratch.ids[k]
        t = int(state.held[i])
        fx = mass[i] * ((v[i, 0] - v_prev[k, 0]) / h - gravity[0]) - force[i, 0]
        fy = mass[i] * ((v[i, 1] - v_prev[k, 1]) / h - gravity[1]) - force[i, 1]
        fz = mass[i] * ((v[i, 2] - v_prev[k, 2]) / h - gravity[2]) - force[i, 2]
        force[i, 0], force[i, 1], force[i, 2] = 0.0, 0.0, 0.0
        work += push_tool(three(xw, i), three(x_prev, i), (fx, fy, fz), t, position, motion, share, wrench)
        mean[i, 0] += share * fx
        mean[i, 1] += share * fy
        mean[i, 2] += share * fz
        felt[i, t] += share * (abs(fx) + abs(fy) + abs(fz))
    return work
