"""How much of a patch of a block's surface a box tool covers.

The box touches with the side whose outward normal is most opposed to the face's, or goes on with the one that pressed
the face before while that is opposed to it by half as much: a face that bends round an edge looks at two sides alike,
and would be pressed by them by turns. A point deeper than half the box does not go on with it. Along each of the two
axes beside it a patch spans what its four corners span on the curved face,

    x(s, t) = sum_kl N_k(s) N_l(t) x_kl,   N_-(s) = s (s - 1)/2,  N_0 = 1 - s^2,  N_+ = s (s + 1)/2,

and the covered fraction is the product of the two overlaps with the box: exact where sides are along the axes of the
tool, and continuous in its pose always. Patches of a face share their corners, so that together they cover it once.
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import overlap, rotate_back, side_along, side_gap

CARRY_POWER = 8
"""of a face's covered fraction: the part of a normal force that the next step begins with"""
_KEPT = 0.5
"""of how much a face looks at the side that it faces most: how much it looks at another one that goes on pressing it"""


@njit(cache=True, error_model="numpy")
def see(x, nodes, position, orientation, face):
    """face (9, 3) <- x (n, 3) of a face's nodes (9,), as `FacePoints.face_nodes`, in the frame of a tool."""
    for k in range(9):
        node = nodes[k]
        face[k, 0], face[k, 1], face[k, 2] = rotate_back(
            orientation, x[node, 0] - position[0], x[node, 1] - position[1], x[node, 2] - position[2]
        )


@njit(cache=True, error_model="numpy")
def _spanned(face, axis, patch, half):
    """Least and greatest coordinate of a patch's corners, patch +- half, on a face (9, 3)."""
    low, high = np.inf, -np.inf
    for up in (-half, half):
        t = patch[1] + up
        tm, t0, tp = 0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)
        xm = tm * face[5, axis] + t0 * face[1, axis] + tp * face[6, axis]
        x0 = tm * face[3, axis] + t0 * face[0, axis] + tp * face[4, axis]
        xp = tm * face[7, axis] + t0 * face[2, axis] + tp * face[8, axis]
        for along in (-half, half):
            s = patch[0] + along
            at = 0.5 * s * (s - 1.0) * xm + (1.0 - s * s) * x0 + 0.5 * s * (s + 1.0) * xp
            low, high = min(low, at), max(high, at)
    return low, high


@njit(cache=True, error_model="numpy")
def pressed_side(face_of, first, contact, tool, orientation):
    """Side of a box, as of `covered`, that pressed a face in the step before: the one along whose normal the face's
    forces point most, -1 where there are none. With friction of 1 or more they may point along another.

    face_of (p,): the face of each point, here that of `first` and of those right after it; contact (p, t, 9) [N]
    """
    fx = fy = fz = 0.0
    for point in range(first, len(face_of)):
        if face_of[point] != face_of[first]:
            break
        fx += contact[point, tool, 0]
        fy += contact[point, tool, 1]
        fz += contact[point, tool, 2]
    if fx == 0.0 and fy == 0.0 and fz == 0.0:
        return -1
    return side_along(orientation, fx, fy, fz)


@njit(cache=True, error_model="numpy")
def covered(face, point, patches, patch, shape, position, orientation, pressed):
    """What a box covers around a point (3,): share of its patch, share of its face of a cell, side of the box.

    face (9, 3) as `see` saw it from here, patches along each side of it, patch (2,) this one's middle s, t; side is
    axis + 3 (outward along +axis), -1 where nothing is covered; pressed: the side that it goes on with if it may, or -1
    """
    p = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    axis, normal, kept = 0, 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        n = (face[2, j] - face[1, j]) * (face[4, k] - face[3, k])
        n -= (face[2, k] - face[1, k]) * (face[4, j] - face[3, j])
        if abs(n) > abs(normal):
            axis, normal = i, n
        if pressed == (i if n > 0.0 else i + 3) and p[i] * n <= 0.0:
            kept = n
    if abs(kept) > _KEPT * abs(normal):
        axis, normal = pressed % 3, kept
    # On the far half of the box the surface of the body is not what this face presses.
    if p[axis] * normal > 0.0:
        return 0.0, 0.0, -1
    share = whole = 1.0
    for beside in range(3):
        if beside == axis:
            continue
        low = high = face[0, beside]
        for k in range(1, 9):
            low, high = min(low, face[k, beside]), max(high, face[k, beside])
        # no further beyond its nodes goes a function quadratic in s and in t: sums of |N_k| are at most 5/4 for each
        beyond, half = 9.0 / 32.0 * (high - low), shape[beside]
        if low - beyond >= half or high + beyond <= -half:
            return 0.0, 0.0, -1
        if low - beyond >= -half and high + beyond <= half:
            continue
        low, high = _spanned(face, beside, patch, 1.0 / patches)
        share *= overlap(0.5 * (low + high), 0.5 * (high - low), half)
        a, b, c, d = face[5, beside], face[6, beside], face[7, beside], face[8, beside]
        low, high = min(a, b, c, d), max(a, b, c, d)
        whole *= overlap(0.5 * (low + high), 0.5 * (high - low), half)
    side = axis if normal > 0.0 else axis + 3
    return share, whole, side if share > 0.0 else -1


@njit(cache=True, error_model="numpy")
def entered(
    x, nodes, face, point, patches, patch, shape, position, orientation, position_next, orientation_next, deep
):  # fmt: skip
    """`covered` at the end of a step, of a box that covered nothing when it began and is in deeper than `deep` [m].

    Covered it must be where its side is that deep, or it came in beside that side: share 0, side -1. So they are where
    the step ends less deep, too: the next one begins with what is covered there. face (9, 3): seen from there
    """
    share, whole, side = covered(face, point, patches, patch, shape, position_next, orientation_next, -1)
    if side < 0:
        return 0.0, 0.0, -1
    before = side_gap(side, shape, position, orientation, point)[0]
    gap = side_gap(side, shape, position_next, orientation_next, point)[0]
    if before < -deep or gap >= -deep:
        return 0.0, 0.0, -1
    there, seen = np.empty(3), np.empty((9, 3))
    for i in range(3):
        there[i] = position[i] + (before + deep) / (before - gap) * (position_next[i] - position[i])
    see(x, nodes, there, orientation_next, seen)
    if covered(seen, point, patches, patch, shape, there, orientation_next, -1)[2] != side:
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
