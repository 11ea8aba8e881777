"""What the part of a body on one side of its mirrors says of all of it, and whether its tools still mirror each other.

A mirror is a plane at c across an axis e. It takes a place x to S x + 2 c e, S = 1 - 2 e e^T, a force to S f, and what
turns, a torque or an angular momentum l about the origin, with the force or momentum p that is with it, to
  -S l + 2 c e x S p                                                                                            (1)
"""

from __future__ import annotations

import numpy as np

from softseam_services.fem.kernels.contact import ANCHOR, FORCE, SLIP_SO_FAR
from softseam_services.fem.kernels.step import (
    ANGULAR,
    GRAVITY,
    HIGHEST,
    KINETIC,
    LOWEST,
    MOMENTUM,
    N_CONTACTS,
    SEAM_WORK,
    STRAIN,
    TOOL_WORK,
)
from softseam_services.jit import njit
from softseam_services.tools.kernels import rotate, rotate_back
from softseam_services.tools.tool_set import BOX, MESH, PLANE, SPHERE

_SAME = 1e-9
"""of a turn [1]; of a way, of the shortest edge"""


@njit(cache=True, error_model="numpy")
def _look(orientation, image_of, axis, look):
    """look (3, 3) <- R'^T S R: the axes of a tool, mirrored, as another one sees them."""
    for column in range(3):
        ux = 1.0 if column == 0 else 0.0
        uy = 1.0 if column == 1 else 0.0
        uz = 1.0 if column == 2 else 0.0
        vx, vy, vz = rotate(orientation, ux, uy, uz)
        if axis == 0:
            vx = -vx
        elif axis == 1:
            vy = -vy
        else:
            vz = -vz
        look[0, column], look[1, column], look[2, column] = rotate_back(image_of, vx, vy, vz)


@njit(cache=True, error_model="numpy")
def _fits(kind, shape, look):
    """Whether a tool looks the same after `look` (3, 3)."""
    if kind == SPHERE:
        return True
    if kind == PLANE:
        away = 0.0
        for i in range(3):
            away += abs(look[i, 0] * shape[0] + look[i, 1] * shape[1] + look[i, 2] * shape[2] - shape[i])
        return away <= _SAME
    if kind == BOX:
        for i in range(3):
            if abs(abs(look[i, i]) - 1.0) > _SAME:
                return False
        return True
    return kind != MESH and abs(abs(look[2, 2]) - 1.0) <= _SAME  # a capsule or a cylinder along z


@njit(cache=True, error_model="numpy")
def tools_agree(kind, shape, axis, plane, image, near, position, orientation, position_next, orientation_next):
    """Whether tools mirror each other from the start of a step to its end.

    axis (k,), plane (k,) of each mirror, image (k, t) each tool's; near: as close as places must be [m]
    """
    start, end = np.empty((3, 3)), np.empty((3, 3))
    for m in range(len(axis)):
        e = axis[m]
        for t in range(len(kind)):
            other = image[m, t]
            _look(orientation[t], orientation[other], e, start)
            _look(orientation_next[t], orientation_next[other], e, end)
            if not _fits(kind[t], shape[t], start):
                return False
            for i in range(3):
                for j in range(3):
                    if abs(end[i, j] - start[i, j]) > _SAME:
                        return False
            across = 0.0
            nx, ny, nz = rotate(orientation[other], shape[t, 0], shape[t, 1], shape[t, 2])  # of a plane
            for i in range(3):
                sign, shift = (-1.0, 2.0 * plane[m]) if i == e else (1.0, 0.0)
                away = sign * position[t, i] + shift - position[other, i]
                across += away * (nx if i == 0 else (ny if i == 1 else nz))
                way, ways = position_next[t, i] - position[t, i], position_next[other, i] - position[other, i]
                if abs(sign * way - ways) > near or (kind[t] != PLANE and abs(away) > near):
                    return False
            if kind[t] == PLANE and abs(across) > near:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _add_image(force, turn, e, shift, other_force, other_turn):
    """other_force, other_turn (3,) += the image of a force and what turns with it, about the origin; eq. (1)."""
    fx, fy, fz = force[0], force[1], force[2]
    tx, ty, tz = -turn[0], -turn[1], -turn[2]
    if e == 0:
        fx, tx = -fx, -tx
        ty, tz = ty - shift * fz, tz + shift * fy
    elif e == 1:
        fy, ty = -fy, -ty
        tx, tz = tx + shift * fz, tz - shift * fx
    else:
        fz, tz = -fz, -tz
        tx, ty = tx - shift * fy, ty + shift * fx
    other_force[0] += fx
    other_force[1] += fy
    other_force[2] += fz
    other_turn[0] += tx
    other_turn[1] += ty
    other_turn[2] += tz


@njit(cache=True, error_model="numpy")
def add_images(axis, plane, image, on, contact, about, out, wrench):
    """Make what a part's step came to what the whole's came to: out, as of kernels/step.py, and wrench (t, 6), force
    and torque about each tool's place `about` (t, 3) [m], in place.

    axis (k,), plane (k,) of each mirror, image (k, t) each tool's, on (k, p): points on its plane, contact (p, t, 9)
    """
    momentum, angular = out[MOMENTUM : MOMENTUM + 3], out[ANGULAR : ANGULAR + 3]
    low, high = out[LOWEST : LOWEST + 3], out[HIGHEST : HIGHEST + 3]
    force, turn = np.empty(3), np.empty(3)
    before = np.empty_like(wrench)  # about the origin
    for m in range(len(axis)):
        e, shift = axis[m], 2.0 * plane[m]
        for entry in (KINETIC, STRAIN, GRAVITY, TOOL_WORK, SEAM_WORK):
            out[entry] *= 2.0
        force[:], turn[:] = momentum, angular
        _add_image(force, turn, e, shift, momentum, angular)
        low[e], high[e] = min(low[e], shift - high[e]), max(high[e], shift - low[e])
        for t in range(len(about)):
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                before[t, i] = wrench[t, i]
                before[t, 3 + i] = wrench[t, 3 + i] + about[t, j] * wrench[t, k] - about[t, k] * wrench[t, j]
        for t in range(len(about)):
            force[:], turn[:] = before[t, :3], before[t, 3:]
            _add_image(before[image[m, t], :3], before[image[m, t], 3:], e, shift, force, turn)
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                wrench[t, i] = force[i]
                wrench[t, 3 + i] = turn[i] - about[t, j] * force[k] + about[t, k] * force[j]
    out[N_CONTACTS] = _count_touching(contact, on, image)


@njit(cache=True, error_model="numpy")
def _count_touching(contact, on, image):
    """Pairs of a point and a tool that touch, in the whole."""
    total = 0.0
    for point in range(contact.shape[0]):
        for tool in range(contact.shape[1]):
            if contact[point, tool, 0] != 0.0 or contact[point, tool, 1] != 0.0 or contact[point, tool, 2] != 0.0:
                times = 1.0
                for m in range(len(on)):
                    times *= 1.0 if on[m, point] and image[m, tool] == tool else 2.0
                total += times
    return total


@njit(cache=True, error_model="numpy")
def unfold_nodes(source, sign, shift, x, v, history, whole_x, whole_v, whole_history):
    """Fill places, velocities and vectors of the whole's nodes (n, 3), (n, 3), (h, n, 3) from the part's.

    source (n,) node of the part, sign, shift (n, 3): place = sign place' + shift
    """
    for node in range(len(source)):
        for i in range(3):
            whole_x[node, i] = sign[node, i] * x[source[node], i] + shift[node, i]
            whole_v[node, i] = sign[node, i] * v[source[node], i]
            for entry in range(len(history)):
                whole_history[entry, node, i] = sign[node, i] * history[entry, source[node], i]


@njit(cache=True, error_model="numpy")
def unfold_contact(axis, plane, image, on, of_image, part, whole):
    """Contact of the whole's points (p, t, 9), zero where nothing touches, from the part's (p', t, 9); whole updated.

    of_image (2^k, p'): the whole's point at each of the part's, mirrored in the mirrors whose bits are set. A point on
    a plane (`on`) bears what both of its sides do.
    """
    n_tools, row = part.shape[1], np.empty(part.shape[2])
    force = np.empty((n_tools, 3))
    sums = np.empty((n_tools, 3))
    for point in range(len(part)):
        touched = False
        for tool in range(n_tools):
            for i in range(3):
                force[tool, i] = part[point, tool, FORCE + i]
                touched = touched or force[tool, i] != 0.0
        if not touched:
            continue
        for m in range(len(axis)):
            if on[m, point]:
                for tool in range(n_tools):
                    for i in range(3):
                        sign = -1.0 if i == axis[m] else 1.0
                        sums[tool, i] = force[tool, i] + sign * force[image[m, tool], i]
                force[:] = sums
        for combination in range(len(of_image)):
            to = of_image[combination, point]
            for tool in range(n_tools):
                if force[tool, 0] == 0.0 and force[tool, 1] == 0.0 and force[tool, 2] == 0.0:
                    continue
                row[:] = part[point, tool]
                row[FORCE : FORCE + 3] = force[tool]
                other = tool
                for m in range(len(axis)):
                    if combination >> m & 1:
                        e = axis[m]
                        row[FORCE + e] = -row[FORCE + e]
                        row[SLIP_SO_FAR + e] = -row[SLIP_SO_FAR + e]
                        row[ANCHOR + e] = 2.0 * plane[m] - row[ANCHOR + e]
                        other = image[m, other]
                whole[to, other] = row
