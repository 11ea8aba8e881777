"""How much a box covers of what a surface point stands for: contact where the box's edge crosses faces of blocks.

The side of a box that presses is the one at which most of the surface near the box looks. Each face is divided in
patches; with half sides a and b at its middle (s, t) a patch is covered by the product of the two intervals' overlaps
with the side, seen in the box's frame, and counts for the corners by their functions N_i(s, t), bilinear. Of the
stiffness of all faces around a point, k = sum SOFT (E A/h) N_i, A as the side sees it, the share c is covered.
Where c = 1 the point touches as ever. Where 0 < c < 1 it touches the plane of the side with the compliance
alpha = 1/(k c) - 1/k,                                                                                            (1)
what yields about a traction on the covered part, less what the point itself shows about one on all of it: 0 where all
is covered, infinite where nothing is. So the force follows the poses without steps.
"""

from __future__ import annotations

import numpy as np

from softseam_services.compiled_once import njit
from softseam_services.tools.kernels import overlap, rotate_back

PATCHES = 4
"""along each edge of a face"""
ROUNDOFF = 1e-9
"""of a covered share"""


@njit(cache=True, error_model="numpy")
def find_shares(x, shape, position, orientation, edges):
    """Sides that cover points in part, and compliances, where body and tools stand: edges.side and give in place.

    x (n, 3) positions of the nodes [m]; shape (t, w), position (t, 3) and orientation (t, 4) as in `tool_gap`
    """
    held, faces = edges.held, edges.faces
    corner, votes = np.empty((4, 3)), np.empty(6)
    for tool in range(len(edges.edged)):
        if not edges.edged[tool]:
            continue
        held[:] = 0.0
        side, votes[:] = edges.side[:, tool], 0.0
        side[:] = -1
        for face in range(len(faces)):
            _see(x, faces, face, position[tool], orientation[tool], corner)
            _vote(corner, shape[tool], edges.edge[face], edges.stiffness[face], votes)
        pressing = int(np.argmax(votes))
        if votes[pressing] == 0.0:
            continue
        for face in range(len(faces)):
            _see(x, faces, face, position[tool], orientation[tool], corner)
            stiffness = edges.stiffness[face] * _facing(corner, pressing, shape[tool])
            if stiffness > 0.0:
                _add_face(corner, pressing, shape[tool], stiffness, edges.point[face], held)
        for point in range(len(held)):
            covered, k = held[point, 0], held[point, 1]
            if ROUNDOFF * k < covered < (1.0 - ROUNDOFF) * k:
                side[point] = pressing
                edges.give[point, tool] = (1.0 / covered - 1.0 / k) / edges.whole[point]  # eq. (1)


@njit(cache=True, error_model="numpy")
def _see(x, faces, face, position, orientation, corner):
    """Corners of a face in the frame of a tool (4, 3), in place."""
    px, py, pz = position[0], position[1], position[2]
    for i in range(4):
        node = faces[face, i]
        own = rotate_back(orientation, x[node, 0] - px, x[node, 1] - py, x[node, 2] - pz)
        corner[i, 0], corner[i, 1], corner[i, 2] = own


@njit(cache=True, error_model="numpy")
def _vote(corner, shape, edge, stiffness, votes):
    """Add a face to the votes (6,) of the side that it looks at most, where it is within an edge of that side."""
    n = _normal(corner)
    axis = 0 if abs(n[0]) >= max(abs(n[1]), abs(n[2])) else 1 if abs(n[1]) >= abs(n[2]) else 2
    for a in range(3):
        middle = 0.25 * (corner[0, a] + corner[1, a] + corner[2, a] + corner[3, a])
        beyond = abs(middle) - shape[a]
        if beyond > edge or (a == axis and (beyond < -edge or middle * n[a] > 0.0)):
            return
    votes[axis if n[axis] > 0.0 else axis + 3] += stiffness


@njit(cache=True, error_model="numpy")
def _facing(corner, side, shape):
    """Cosine between a face's inward normal and a side's outward one; 0 where it looks away, or lies on the far half
    of the box, where the surface of the body is not what this side presses. Over a quarter of the box before that it
    fades: beside the edge of a thin box the surface rises so far."""
    n, axis = _normal(corner), side % 3
    sign = 1.0 if side >= 3 else -1.0
    middle = corner[0, axis] + corner[1, axis] + corner[2, axis] + corner[3, axis]
    if sign * n[axis] >= 0.0 or sign * middle <= 0.0:
        return 0.0
    near = min(1.0, 0.5 * sign * middle / shape[axis])
    return near * abs(n[axis]) / np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])


@njit(cache=True, error_model="numpy")
def _normal(corner):
    """Outward, of the length of eight times the area."""
    u0, u1, u2 = _along(corner, 0), _along(corner, 1), _along(corner, 2)
    v0, v1, v2 = _across(corner, 0), _across(corner, 1), _across(corner, 2)
    return u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0


@njit(cache=True, error_model="numpy")
def _along(corner, axis):
    return corner[2, axis] + corner[3, axis] - corner[0, axis] - corner[1, axis]


@njit(cache=True, error_model="numpy")
def _across(corner, axis):
    return corner[1, axis] + corner[3, axis] - corner[0, axis] - corner[2, axis]


@njit(cache=True, error_model="numpy")
def _within(corner, axis, half):
    """1 where the corners lie within -+ half along the axis, 0 where all lie beyond one end, else 0.5."""
    low = min(min(corner[0, axis], corner[1, axis]), min(corner[2, axis], corner[3, axis]))
    high = max(max(corner[0, axis], corner[1, axis]), max(corner[2, axis], corner[3, axis]))
    return 1.0 if low >= -half and high <= half else 0.0 if low >= half or high <= -half else 0.5


@njit(cache=True, error_model="numpy")
def _add_face(corner, side, shape, stiffness, point, held):
    """Add a face of this stiffness [N/m] to what its points (4,) hold; held (p, 2) in place."""
    i, j = (side + 1) % 3, (side + 2) % 3
    whole = _within(corner, i, shape[i]) * _within(corner, j, shape[j])
    if whole == 0.0 or whole == 1.0:
        for c in range(4):
            _hold(point[c], 0.25 * stiffness * whole, 0.25 * stiffness, held)
        return
    per, k = 1.0 / PATCHES, stiffness / PATCHES**2
    k0, k1, k2, k3 = 0.0, 0.0, 0.0, 0.0
    for m in range(PATCHES):
        s = (2 * m + 1) * per - 1.0
        for n in range(PATCHES):
            t = (2 * n + 1) * per - 1.0
            w0, w1 = 0.25 * (1.0 - s) * (1.0 - t), 0.25 * (1.0 - s) * (1.0 + t)
            w2, w3 = 0.25 * (1.0 + s) * (1.0 - t), 0.25 * (1.0 + s) * (1.0 + t)
            share = k
            for a in (i, j):
                middle = w0 * corner[0, a] + w1 * corner[1, a] + w2 * corner[2, a] + w3 * corner[3, a]
                u = 0.25 * ((1.0 - t) * (corner[2, a] - corner[0, a]) + (1.0 + t) * (corner[3, a] - corner[1, a]))
                v = 0.25 * ((1.0 - s) * (corner[1, a] - corner[0, a]) + (1.0 + s) * (corner[3, a] - corner[2, a]))
                share *= overlap(middle, per * (abs(u) + abs(v)), shape[a])
            k0, k1, k2, k3 = k0 + share * w0, k1 + share * w1, k2 + share * w2, k3 + share * w3
    for c in range(4):
        _hold(point[c], k0 if c == 0 else k1 if c == 1 else k2 if c == 2 else k3, 0.25 * stiffness, held)


@njit(cache=True, error_model="numpy")
def _hold(point, covered, all_of_it, held):
    if point >= 0:
        held[point, 0] += covered
        held[point, 1] += all_of_it
