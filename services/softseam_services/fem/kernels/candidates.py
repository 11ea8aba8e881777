"""Candidates for contact: which points may touch which tools in a step, and what each begins with (contact.py).

On an embedded surface a tool presses by p = -r g with r = 20 E A/h (body/contact_points.py), and nothing is carried
over (c = 0). So it is inside faces, with the r of tools/kernels/patch.py. There are more points than a face has
freedoms, and a gap of zero at all of them would flatten what curves within a cell (docs/decisions/43, 45).
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX, PLANE
from softseam_services.tools.edged import PATCHES
from softseam_services.tools.kernels import (
    SLOW,
    rotate,
    rotate_back,
    sag_under,
    side_along,
    side_gap,
    swept_gap,
    tool_gap,
)

from .contact import coefficient, point_position
from .contact_columns import ANCHOR, AT_NODE, EDGED, OPEN, SPREAD, SWEPT

_NOBODY, SEVERAL = -1, -2
_ALIKE = 0.9
"""of the cosine of two normals: those of one side"""
_ORIGIN, _UPRIGHT = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


_LAST = 1 / 32
"""pace of the shortest parts of a step: there what yields is let in by and by, too, which feeds the body, but gets
through (`step` in fem/step.py)"""


@njit(cache=True, error_model="numpy")
def firmness(model, parameters, point, inertia):
    """Factor on r at a node that keeps it at FIRM times the inertia of what the node stands for [1]."""
    return max(1.0, parameters.swiftness[point] * inertia)


@njit(cache=True, error_model="numpy")
def _turn_along(tools, tool, vector, out):
    """out (3,) <- a vector that turns with the tool, from the step's start to its end."""
    vx, vy, vz = rotate_back(tools.orientation[tool], vector[0], vector[1], vector[2])
    out[0], out[1], out[2] = rotate(tools.orientation_next[tool], vx, vy, vz)


@njit(cache=True, error_model="numpy")
def _turns(tools, tool):
    """Whether a tool turns in this step."""
    for i in range(4):
        if tools.orientation[tool, i] != tools.orientation_next[tool, i]:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _normal(tools, tool, side, position, orientation, xp):
    """Of the tool in this pose (3,), (4,) at a point (3,); of this side of a box, where it is not -1."""
    if side < 0:
        _, nx, ny, nz = tool_gap(tools.kind[tool], tools.shape[tool], position, orientation, xp)
    else:
        _, nx, ny, nz = side_gap(side, tools.shape[tool], position, orientation, xp)
    return nx, ny, nz


@njit(cache=True, error_model="numpy")
def _turn_force(tools, tool, side, xp, force):
    """force (3,): its part along the normal of the step's start goes on along that of its end, for a roller's normal
    stays where the body is; the rest turns along with the tool, as the anchor does. Updated. side: of a box, or -1
    """
    nx, ny, nz = _normal(tools, tool, side, tools.position[tool], tools.orientation[tool], xp)
    ex, ey, ez = _normal(tools, tool, side, tools.position_next[tool], tools.orientation_next[tool], xp)
    along = force[0] * nx + force[1] * ny + force[2] * nz
    force[0] -= along * nx
    force[1] -= along * ny
    force[2] -= along * nz
    _turn_along(tools, tool, force, force)
    force[0] += along * ex
    force[1] += along * ey
    force[2] += along * ez


@njit(cache=True, error_model="numpy")
def meets(tools, tool, start, end, slow, plane):
    """Whether a point on its way through the step, of more than `slow` [m], meets a tool that it may pass; plane (4,)
    <- where, in its frame."""
    position, turn = tools.position[tool], tools.orientation[tool]
    at = rotate_back(turn, start[0] - position[0], start[1] - position[1], start[2] - position[2])
    position, turn = tools.position_next[tool], tools.orientation_next[tool]
    to = rotate_back(turn, end[0] - position[0], end[1] - position[1], end[2] - position[2])
    met, gap, nx, ny, nz = swept_gap(tools.kind[tool], tools.shape[tool], _ORIGIN, _UPRIGHT, at, to, slow)
    if met:
        plane[0], plane[1], plane[2], plane[3] = nx, ny, nz, nx * to[0] + ny * to[1] + nz * to[2] - gap
    return met


@njit(cache=True, error_model="numpy")
def _comes_in(tools, tool, end, plane):
    """Whether a point (3,) that met a tool in the plane (4,) ends inside it, and nearest to where it came in."""
    position, turn = tools.position_next[tool], tools.orientation_next[tool]
    to = rotate_back(turn, end[0] - position[0], end[1] - position[1], end[2] - position[2])
    gap, nx, ny, nz = tool_gap(tools.kind[tool], tools.shape[tool], _ORIGIN, _UPRIGHT, to)
    return gap < 0.0 and nx * plane[0] + ny * plane[1] + nz * plane[2] > _ALIKE


@njit(cache=True, error_model="numpy")
def faced_side(shape, position, orientation, point):
    """Side of a box that a point (3,) outside faces, of one inside the nearest; -1 past an edge."""
    p = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    side, least, beyond = -1, np.inf, 0
    for axis in range(3):
        depth = shape[axis] - abs(p[axis])
        beyond += depth < 0.0
        if depth < least:
            least = depth
            side = axis + 3 if p[axis] > 0.0 else axis
    return side if beyond < 2 else -1


@njit(cache=True, error_model="numpy")
def _passes(thin, dt, v, model, parameters, point, xp, tools, tool):
    """Whether a point, at xp (3,) as the step begins, may go by more than half of a tool's half thickness [m], as the
    tool sees it."""
    ahead, away = np.empty(3), np.empty(3)
    point_position(v, model, parameters, point, ahead)
    for i in range(3):
        away[i] = xp[i] - tools.position[tool, i]
    _turn_along(tools, tool, away, away)
    square = 0.0
    for i in range(3):
        square += (xp[i] + dt * ahead[i] - away[i] - tools.position_next[tool, i]) ** 2
    return square > 0.25 * thin * thin


@njit(cache=True, error_model="numpy")
def find_holders(model, multiplier, n_nodes):
    """Which tool holds points that hang on a node (n,): `_NOBODY`, its number, or `SEVERAL`."""
    holder = np.full(n_nodes, _NOBODY, dtype=np.int16)
    for point in range(len(model.point_face)):
        for tool in range(multiplier.shape[1]):
            # number by number, because a view of a row costs as much as all the rest
            f0, f1, f2 = multiplier[point, tool, 0], multiplier[point, tool, 1], multiplier[point, tool, 2]
            if f0 == 0.0 and f1 == 0.0 and f2 == 0.0:
                continue
            for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
                node = model.point_node[entry]
                if holder[node] == _NOBODY:
                    holder[node] = tool
                elif holder[node] != tool:
                    holder[node] = SEVERAL
    return holder


@njit(cache=True, error_model="numpy")
def find_candidates(x, v, dt, model, parameters, tools, multiplier, reach, inertia, pace, work):
    """Pairs whose gap to the tool at the end of the step is below `reach`, that carry a force, or that the factor has.

    x (n, 3), v (n, 3) positions and velocities at the start, dt: of the step, multiplier (p, t, 9) contact state at the
    start, inertia: of `firmness`, pace: share of the penetration and of the offset that the step may take out; fills
    work.pair, begun, offset, multiplier, hold, side and plane, and resets the states; returns how many.
    """
    n_tools = len(tools.kind)
    xp, away, ahead = np.empty(3), np.empty(3), np.empty(3)
    count = 0
    holder = find_holders(model, multiplier, len(x))
    for point in range(len(model.point_face)):
        if parameters.point_stiffness[point] == 0.0:
            continue
        point_position(x, model, parameters, point, xp)
        face = model.point_face[point]
        alone = True
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            alone = alone and holder[model.point_node[entry]] != SEVERAL
        for tool in range(n_tools):
            # on faces with points of their own a tool that is round, or has an edge, touches at these; others at nodes
            if face >= AT_NODE and model.at_faces[tool] != (face >= 0):
                continue
            kind, shape = tools.kind[tool], tools.shape[tool]
            position, turn = tools.position_next[tool], tools.orientation_next[tool]
            f0, f1, f2 = multiplier[point, tool, 0], multiplier[point, tool, 1], multiplier[point, tool, 2]
            touched = f0 != 0.0 or f1 != 0.0 or f2 != 0.0
            sag, side = 0.0, -1
            carry = 0.0 if face >= 0 or face == SPREAD else 1.0
            gap, edged = tool_gap(kind, shape, position, turn, xp)[0], False
            if face >= 0:
                edged = tools.places[tool] > 0
                if edged:
                    gap -= 0.5 * parameters.face_edge[face]  # no part of the patch is farther from its middle
                sag = tools.bends[tool] * sag_under(tools.half_width[tool], 0.5 * parameters.face_edge[face])
            if gap < reach or touched or work.factored_state[point, tool] != OPEN:
                if edged:
                    side = EDGED
                thin = min(shape[0], shape[1], shape[2]) if kind == BOX else np.inf
                if kind == BOX and (
                    carry == 1.0 or (thin < reach and _passes(thin, dt, v, model, parameters, point, xp, tools, tool))
                ):
                    side = faced_side(shape, tools.position[tool], tools.orientation[tool], xp)
                    # what is pressed deep into a thin box stays on the side that presses it
                    inside = tool_gap(kind, shape, tools.position[tool], tools.orientation[tool], xp)[0] < 0.0
                    if inside and touched and coefficient(parameters, point, tool) < 1.0:
                        side = side_along(tools.orientation[tool], f0, f1, f2)
                slow = SLOW * tools.reach[tool]
                if edged:  # a wall is as thick as two places of a patch, or thicker
                    slow = max(slow, parameters.face_edge[face] / (PATCHES * tools.places[tool]))
                if (side == -1 or edged) and kind != PLANE and not touched and reach > slow:
                    point_position(v, model, parameters, point, ahead)
                    for i in range(3):
                        ahead[i] = xp[i] + dt * ahead[i]
                    met = meets(tools, tool, xp, ahead, slow, work.plane[count])
                    if met and not (edged and _comes_in(tools, tool, ahead, work.plane[count])):
                        side = SWEPT
                work.pair[count, 0] = point
                work.pair[count, 1] = tool
                for i in range(3):
                    away[i] = xp[i] - tools.position[tool, i]
                _turn_along(tools, tool, away, work.begun[count])
                for i in range(3):
                    work.begun[count, i] += tools.position_next[tool, i]
                    away[i] = xp[i] - multiplier[point, tool, ANCHOR + i] if touched and alone else 0.0
                _turn_along(tools, tool, away, work.offset[count])
                work.multiplier[count, 0] = f0
                work.multiplier[count, 1] = f1
                work.multiplier[count, 2] = f2
                if touched and _turns(tools, tool):
                    _turn_force(tools, tool, side, xp, work.multiplier[count])
                work.state[count] = OPEN
                work.contact[count] = 0.0
                work.lean[count] = 0.0
                work.spread[count] = 0.0
                firm = firmness(model, parameters, point, inertia) if carry > 0.0 else 1.0
                work.hold[count, 0] = firm * parameters.point_stiffness[point]
                work.hold[count, 1] = carry
                work.hold[count, 2] = 0.0
                work.hold[count, 3] = pace
                work.hold[count, 4] = sag
                if pace < 1.0 and (carry > 0.0 or pace <= _LAST):
                    position, turn = tools.position[tool], tools.orientation[tool]
                    if side < 0:
                        gap = tool_gap(kind, shape, position, turn, xp)[0]
                    else:
                        gap = side_gap(side, shape, position, turn, xp)[0]
                    work.hold[count, 2] = (1.0 - pace) * min(0.0, gap)
                work.side[count] = side
                count += 1
    return count
