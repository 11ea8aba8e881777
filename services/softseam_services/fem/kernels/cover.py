"""How much of a patch of a block's surface a box tool covers.

The box touches with the face whose outward normal is most opposed to the patch's. Along each of the two axes beside it
the patch, a parallelogram with half sides a and b, spans 2 (|a_i| + |b_i|); the covered fraction is the product of the
two overlaps with the face: exact where sides are along the axes of the tool, and continuous in its pose always. Patches
of a box are alike; faces of other cells are quadrangles m + s u + t v + s t w with a = u + t w and b = v + s w.
"""

from __future__ import annotations

import numpy as np

from softseam_services.compiled_once import njit
from softseam_services.tools.kernels import overlap, rotate_back, side_gap

CARRY_POWER = 8
"""of a face's covered fraction: the part of a normal force that the next step begins with"""


@njit(cache=True, error_model="numpy")
def _seen(x, node, position, orientation):
    """A node in the frame of a tool."""
    return rotate_back(orientation, x[node, 0] - position[0], x[node, 1] - position[1], x[node, 2] - position[2])


@njit(cache=True, error_model="numpy")
def covered(x, nodes, point, patches, patch, shape, position, orientation):
    """What a box covers around a point (3,): share of its patch, share of its face of a cell, side of the box.

    x (n, 3), nodes (9,) as `FacePoints.face_nodes`, patches along each side of the face, patch (2,) this one's middle
    s, t; side is axis + 3 (outward along +axis), -1 where nothing is covered
    """
    u0, u1, u2 = rotate_back(
        orientation,
        0.5 * (x[nodes[2], 0] - x[nodes[1], 0]),
        0.5 * (x[nodes[2], 1] - x[nodes[1], 1]),
        0.5 * (x[nodes[2], 2] - x[nodes[1], 2]),
    )
    v0, v1, v2 = rotate_back(
        orientation,
        0.5 * (x[nodes[4], 0] - x[nodes[3], 0]),
        0.5 * (x[nodes[4], 1] - x[nodes[3], 1]),
        0.5 * (x[nodes[4], 2] - x[nodes[3], 2]),
    )
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    axis, normal = 0, n0
    if abs(n1) > abs(normal):
        axis, normal = 1, n1
    if abs(n2) > abs(normal):
        axis, normal = 2, n2
    p = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    # On the far half of the box the surface of the body is not what this face presses.
    if p[axis] * normal > 0.0:
        return 0.0, 0.0, -1
    share = whole = 1.0
    if nodes[5] == nodes[0]:
        m = _seen(x, nodes[0], position, orientation)
        reach = (abs(u0) + abs(v0), abs(u1) + abs(v1), abs(u2) + abs(v2))
        for beside in range(3):
            if beside != axis:
                share *= overlap(p[beside], reach[beside] / patches, shape[beside])
                whole *= overlap(m[beside], reach[beside], shape[beside])
        return share, whole, (axis if normal > 0.0 else axis + 3) if share > 0.0 else -1
    u, v = (u0, u1, u2), (v0, v1, v2)
    p0, p1 = _seen(x, nodes[5], position, orientation), _seen(x, nodes[6], position, orientation)
    p2, p3 = _seen(x, nodes[7], position, orientation), _seen(x, nodes[8], position, orientation)
    for beside in range(3):
        if beside != axis:
            a, b, c, d = p0[beside], p1[beside], p2[beside], p3[beside]
            w = 0.25 * ((a - b) - (c - d))
            reach_here = abs(u[beside] + patch[1] * w) + abs(v[beside] + patch[0] * w)
            share *= overlap(p[beside], reach_here / patches, shape[beside])
            low, high = min(a, b, c, d), max(a, b, c, d)
            whole *= overlap(0.5 * (low + high), 0.5 * (high - low), shape[beside])
    side = axis if normal > 0.0 else axis + 3
    return share, whole, side if share > 0.0 else -1


@njit(cache=True, error_model="numpy")
def entered(x, nodes, point, patches, patch, shape, position, orientation, position_next, orientation_next, deep):
    """`covered` at the end of a step, of a box that covered nothing when it began and is in deeper than `deep` [m].

    Covered it must be where its side is that deep, or it came in beside that side: share 0, side -1. So they are where
    the step ends less deep, too: the next one begins with what is covered there.
    """
    share, whole, side = covered(x, nodes, point, patches, patch, shape, position_next, orientation_next)
    if side < 0:
        return 0.0, 0.0, -1
    before = side_gap(side, shape, position, orientation, point)[0]
    gap = side_gap(side, shape, position_next, orientation_next, point)[0]
    if before < -deep or gap >= -deep:
        return 0.0, 0.0, -1
    there = np.empty(3)
    for i in range(3):
        there[i] = position[i] + (before + deep) / (before - gap) * (position_next[i] - position[i])
    if covered(x, nodes, point, patches, patch, shape, there, orientation_next)[2] != side:
        return 0.0, 0.0, -1
    return share, whole, side


@njit(cache=True, error_model="numpy")
def faced_side(shape, position, orientation, point):
    """Side of a box, as of `covered`, that a point (3,) outside faces, of one inside the nearest; -1 past an edge."""
    p = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    side, least, beyond = -1, np.inf, 0
    for axis in range(3):
        depth = shape[axis] - abs(p[axis])
        beyond += depth < 0.0
        if depth < least:
            least = depth
            side = axis + 3 if p[axis] > 0.0 else axis
    return side if beyond < 2 else -1
