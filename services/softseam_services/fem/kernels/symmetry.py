"""What the part of a body on one side of its planes of symmetry says of all of it.

A plane at c across an axis e takes a place x to S x + 2 c e, S = 1 - 2 e e^T, a force to S f, and what turns, a torque
or an angular momentum l about the origin, with the force or momentum p that is with it, to
  -S l + 2 c e x S p                                                                                            (1)
"""

import numpy as np

from softseam_services.jit import njit

from .contact_columns import ANCHOR, FORCE, SLIP_SO_FAR
from .step import ANGULAR, GRAVITY, HIGHEST, KINETIC, LOWEST, MOMENTUM, N_CONTACTS, SEAM_WORK, STRAIN, TOOL_WORK


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
def add_images(axis, place, image, on, contact, about, out, wrench):
    """Make what a part's step came to what the whole's came to: out, as of kernels/step.py, and wrench (t, 6), force
    and torque about each tool's place `about` (t, 3) [m], in place.

    axis (k,), place (k,) of each plane, image (k, t) each tool's, on (k, p): points in it, contact (p, t, 9)
    """
    momentum, angular = out[MOMENTUM : MOMENTUM + 3], out[ANGULAR : ANGULAR + 3]
    low, high = out[LOWEST : LOWEST + 3], out[HIGHEST : HIGHEST + 3]
    force, turn = np.empty(3), np.empty(3)
    before = np.empty_like(wrench)  # about the origin
    for m in range(len(axis)):
        e, shift = axis[m], 2.0 * place[m]
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
def unfold_contact(axis, place, image, on, of_image, part, whole):
    """Contact of the whole's points (p, t, 9), zero where nothing touches, from the part's (p', t, 9); whole updated.

    of_image (2^k, p'): the whole's point at each of the part's, mirrored in the planes whose bits are set. A point in
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
                        row[ANCHOR + e] = 2.0 * place[m] - row[ANCHOR + e]
                        other = image[m, other]
                whole[to, other] = row
