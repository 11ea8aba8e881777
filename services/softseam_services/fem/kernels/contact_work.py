"""The work of contact in a step.

Where a point keeps a gap of zero, by a multiplier, and of all friction, it is the force at the end of the step times
the way of the place where it acts. What yields by p = -r g, or F of tools/kernels/patch.py, is the slope of an energy V
of where body and tool are, and does what its tool's motion puts in, less what V gains,

  W = sum p n . d - (V_1 - V_0),                                                                                 (1)

with d the way of the tool at that place. So a tool at rest does no net work, whatever comes by it. By p n . (x_1 - x_0)
it did: where a body slides by what is round, or an edge, the normal at the end of the step has turned, and is not at a
right angle to the chord of the way. On a ball of radius R a point of mass m and speed v is fed m v^4 h^2/(2 R^2) a step
so, exactly the m |dv|^2/2 that implicit Euler takes: its speed stays. Neither is real, and by (1) neither is booked.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import patch_energy, press_energy, tool_gap

from .contact import patch_edges, point_position
from .contact_columns import NORMAL, OPEN, PRESSURE, TRACTION


@njit(cache=True, error_model="numpy", forceinline=True)
def yields(c, work):
    """Whether a candidate presses by an energy, and carries nothing over."""
    return work.hold[c, 1] == 0.0


@njit(cache=True, error_model="numpy")
def stored_energy(c, x, position, orientation, model, parameters, tools, work):
    """V of a candidate that yields [J], with nodes at x (n, 3) and its tool in the pose (3,), (4,)."""
    point, tool = work.pair[c, 0], work.pair[c, 1]
    kind, shape, sag = tools.kind[tool], tools.shape[tool], work.hold[c, 4]
    place = np.empty(3)
    point_position(x, model, parameters, point, place)
    if tools.places[tool] > 0 and model.point_face[point] >= 0:
        edges = np.empty((2, 3))
        patch_edges(x, model, parameters, point, edges)
        stored = patch_energy(
            kind, shape, position, orientation, place, edges[0], edges[1], sag, tools.places[tool]
        )  # fmt: skip
    else:
        stored = press_energy(-tool_gap(kind, shape, position, orientation, place)[0], sag)
    return work.hold[c, 0] * stored


@njit(cache=True, error_model="numpy")
def is_stored_at(x, position, orientation, work):
    """Whether work.stored is of nodes at x (n, 3) and tools in these poses (t, 3), (t, 4), as a rule where a step
    begins: there the one before it ended."""
    for tool in range(len(position)):
        for i in range(3):
            if work.stored_poses[tool, i] != position[tool, i]:
                return False
        for i in range(4):
            if work.stored_poses[tool, 3 + i] != orientation[tool, i]:
                return False
    for node in range(len(x)):
        for i in range(3):
            if work.stored_x[node, i] != x[node, i]:
                return False
    return True


@njit(cache=True, error_model="numpy")
def note_stored_at(x, position, orientation, work):
    """work.stored is of nodes and tools there."""
    work.stored_x[:] = x
    work.stored_poses[:, :3] = position
    work.stored_poses[:, 3:] = orientation


@njit(cache=True, error_model="numpy")
def find_turn(tools, tool, turn):
    """turn (3,) <- how far a tool turns in the step, about each axis [rad]; returns whether it does."""
    q, p = tools.orientation[tool], tools.orientation_next[tool]
    if q[0] == p[0] and q[1] == p[1] and q[2] == p[2] and q[3] == p[3]:
        turn[:] = 0.0
        return False
    cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    square = 0.0
    for i in range(3):
        j, k = 1 + (i + 1) % 3, 1 + (i + 2) % 3
        turn[i] = q[0] * p[1 + i] - p[0] * q[1 + i] - (p[j] * q[k] - p[k] * q[j])
        square += turn[i] ** 2
    sine = np.sqrt(square)
    angle = 2.0 * np.arctan2(sine if cosine >= 0.0 else -sine, abs(cosine))
    for i in range(3):
        turn[i] *= angle / sine if sine > 0.0 else 2.0
    return True


@njit(cache=True, error_model="numpy")
def add_tool_way(tools, tool, turn, arm, shift, way):
    """way (3,) += shift times the tool's own, and turn (3,) x arm (3,): of what is at `arm` of it at the end [m]."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        way[i] += shift * (tools.position_next[tool, i] - tools.position[tool, i]) + turn[j] * arm[k] - turn[k] * arm[j]


@njit(cache=True, error_model="numpy")
def force_moment(count, x, model, parameters, work, centre, moment):
    """moment (3, 3) <- sum of f (x_p - centre)^T of those forces on points whose work is that of their chords [N m]."""
    moment[:] = 0.0
    arm = np.empty(3)
    for c in range(count):
        if work.state[c] == OPEN:
            continue
        row, pressed = work.contact[c], not yields(c, work)
        point_position(x, model, parameters, work.pair[c, 0], arm)
        for i in range(3):
            f = row[TRACTION + i] + (row[PRESSURE] * row[NORMAL + i] if pressed else 0.0)
            for j in range(3):
                moment[i, j] += f * (arm[j] - centre[j])
