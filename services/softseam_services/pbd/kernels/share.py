"""How much a box covers of what a surface point stands for: contact where the box's edge crosses faces of blocks.

The side of a box that presses is the one at which most of the surface near the box looks. Each face is divided in
patches; with half sides a and b at its middle (s, t) a patch is covered by the product of the two intervals' overlaps
with the side, seen in the box's frame, and counts for the corners by their functions N_i(s, t), bilinear. Of the
stiffness of all faces around a point, k = sum SOFT (E A/h) N_i, A as the side sees it, the share c is covered.
Where c = 1 the point touches as ever. Where 0 < c < 1 it touches the plane of the side with the compliance
alpha = 1/(k c) - 1/k,                                                                                            (1)
what yields about a traction on the covered part, less what the point itself shows about one on all of it: 0 where all
is covered, infinite where nothing is. So the force follows the poses without steps. A strip yields by the logarithm of
its width (Johnson, Contact Mechanics, 1985, 2.5) and no more by its inverse, so of a side that is narrower than q = w/h
blocks eq. (1) counts by
m = min(1, STRIP q ln(1/q)/(1 - q)).                                                                              (2)
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import overlap, rotate_back

PATCHES = 4
"""along each edge of a face"""
ALL_PATCHES = (1 << PATCHES**2) - 1
STRIP = 1.5
"""compliance of a strip narrower than a block, in ln(1/q)/k: see the decision note"""
ROUNDOFF = 1e-9
"""of a covered share"""


@njit(cache=True, error_model="numpy")
def find_shares(model, parameters, x, position, orientation, shares):
    """Sides that cover points in part, compliances and covered patches, where body and tools stand: `shares` in place.

    x (n, 3) positions of the nodes [m]; position (t, 3) and orientation (t, 4) as in `tool_gap`
    """
    held, faces = shares.held, model.face_nodes
    shape, stiffness_of, edge_of = parameters.shape, parameters.face_stiffness, parameters.face_edge
    corner, votes = np.empty((4, 3)), np.empty(6)
    for tool in range(len(parameters.edged)):
        if not parameters.edged[tool]:
            continue
        held[:] = 0.0
        side, votes[:] = shares.side[:, tool], 0.0
        side[:] = -1
        shares.patches[:, tool] = 0
        for face in range(len(faces)):
            _see(x, faces, face, position[tool], orientation[tool], corner)
            _vote(corner, shape[tool], edge_of[face], stiffness_of[face], votes)
        pressing = int(np.argmax(votes))
        if votes[pressing] == 0.0:
            continue
        for face in range(len(faces)):
            _see(x, faces, face, position[tool], orientation[tool], corner)
            stiffness = stiffness_of[face] * _facing(corner, pressing)
            if stiffness > 0.0:
                above = _above(corner, pressing, shape[tool], edge_of[face])
                counts = above, _strip(pressing, shape[tool], edge_of[face])
                bits = _add_face(corner, pressing, shape[tool], stiffness, counts, model.face_point[face], held)
                shares.patches[face, tool] = bits if above > 0.0 else 0
        for point in range(len(held)):
            covered, k = held[point, 0], held[point, 1]
            if ROUNDOFF * k < covered < (1.0 - ROUNDOFF) * k:
                side[point] = pressing
                give = (1.0 / covered - 1.0 / k) / parameters.whole[point]  # eq. (1)
                shares.give[point, tool] = give * (held[point, 2] / k)


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
    pressing = axis if n[axis] > 0.0 else axis + 3
    for a in range(3):
        beyond = abs(0.25 * (corner[0, a] + corner[1, a] + corner[2, a] + corner[3, a])) - shape[a]
        if beyond > edge or (a == axis and (beyond < -edge or _above(corner, pressing, shape, edge) == 0.0)):
            return
    votes[pressing] += stiffness


@njit(cache=True, error_model="numpy")
def _facing(corner, side):
    """Cosine between a face's inward normal and a side's outward one; 0 where it looks away."""
    n = _normal(corner)
    along = n[side % 3] if side < 3 else -n[side % 3]
    return max(0.0, along) / np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])


@njit(cache=True, error_model="numpy")
def _above(corner, side, shape, edge):
    """1 where a face may be what this side presses, 0 where all of it lies deeper than half the box, or, in thinner
    boxes, than an edge [m] of its block; over half of that depth it fades.

    The highest corner decides: a face that hangs over the edge of a thin box is deep at the corners outside, while
    those inside rest on the side. A point that is covered in part sinks in: at a pad smaller than a block by half an
    edge.
    """
    axis, sign = side % 3, 1.0 if side >= 3 else -1.0
    highest = max(
        max(sign * corner[0, axis], sign * corner[1, axis]), max(sign * corner[2, axis], sign * corner[3, axis])
    )
    return min(1.0, max(0.0, 2.0 - 2.0 * (shape[axis] - highest) / max(shape[axis], edge)))


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
def _strip(side, shape, edge):
    """m of eq. (2), of a box of half edges shape on a face of a block of this edge [m]."""
    q = 2.0 * min(shape[(side + 1) % 3], shape[(side + 2) % 3]) / edge
    return min(1.0, STRIP * q * np.log(1.0 / q) / (1.0 - q)) if q < 1.0 else 1.0


@njit(cache=True, error_model="numpy")
def _add_face(corner, side, shape, stiffness, counts, point, held):
    """Add a face of this stiffness [N/m], of which what is covered counts with `_above`, and yields with `_strip`, to
    what its points (4,) hold; held (p, 3) in place.

    Returns which of its patches are covered, at least in part, as bits.
    """
    i, j = (side + 1) % 3, (side + 2) % 3
    whole = _within(corner, i, shape[i]) * _within(corner, j, shape[j])
    if whole == 0.0 or whole == 1.0:
        for c in range(4):
            _hold(point[c], 0.25 * stiffness * whole, 0.25 * stiffness, counts, held)
        return ALL_PATCHES if whole == 1.0 else 0
    per, k = 1.0 / PATCHES, stiffness / PATCHES**2
    k0, k1, k2, k3, bits = 0.0, 0.0, 0.0, 0.0, 0
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
            bits += (share > 0.0) << (PATCHES * m + n)
            k0, k1, k2, k3 = k0 + share * w0, k1 + share * w1, k2 + share * w2, k3 + share * w3
    for c in range(4):
        _hold(point[c], k0 if c == 0 else k1 if c == 1 else k2 if c == 2 else k3, 0.25 * stiffness, counts, held)
    return bits


@njit(cache=True, error_model="numpy")
def _hold(point, covered, all_of_it, counts, held):
    """What is covered and does not count stands for nothing: what is covered beside it is no smaller share for that."""
    if point >= 0:
        above, strip = counts
        left = all_of_it - (1.0 - above) * covered
        held[point, 0] += above * covered
        held[point, 1] += left
        held[point, 2] += strip * left


@njit(cache=True, error_model="numpy")
def slip_of_patches(model, parameters, force, slip, shares):
    """Largest slip of a covered patch on a tool that is near [m], each between the corners of its face that touch.

    A corner beside the tool slips by more than anything that the tool holds. force and slip (p, t, 3)
    """
    largest = 0.0
    s = np.empty((4, 3))
    touches = np.empty(4)
    for tool in range(len(parameters.near)):
        if not (parameters.near[tool] and parameters.edged[tool]):
            continue
        for face in range(len(model.face_nodes)):
            bits = shares.patches[face, tool]
            if bits == 0:
                continue
            soft = False
            for c in range(4):
                point = model.face_point[face, c]
                soft = soft or (point >= 0 and shares.side[point, tool] >= 0)
            if not soft:
                continue
            for c in range(4):
                point = model.face_point[face, c]
                touches[c] = 0.0
                for a in range(3):
                    s[c, a] = slip[point, tool, a] if point >= 0 else 0.0
                    if point >= 0 and force[point, tool, a] != 0.0:
                        touches[c] = 1.0
            largest = max(largest, _patches_slip(bits, touches, s))
    return np.sqrt(largest)


@njit(cache=True, error_model="numpy")
def _patches_slip(bits, touches, s):
    """Square of the largest slip of a face's covered patches [m^2], s (4, 3) being that of its corners."""
    largest = 0.0
    for m in range(PATCHES):
        u = (m + 0.5) / PATCHES
        for n in range(PATCHES):
            if not bits >> (PATCHES * m + n) & 1:
                continue
            v = (n + 0.5) / PATCHES
            w0, w1 = touches[0] * (1.0 - u) * (1.0 - v), touches[1] * (1.0 - u) * v
            w2, w3 = touches[2] * u * (1.0 - v), touches[3] * u * v
            total, square = w0 + w1 + w2 + w3, 0.0
            for a in range(3):
                square += (w0 * s[0, a] + w1 * s[1, a] + w2 * s[2, a] + w3 * s[3, a]) ** 2
            if total > 0.0:
                largest = max(largest, square / (total * total))
    return largest
