"""What contact with tools stores, and what the tools' motions put in: those that a tool presses gain no more.

Where contact yields it has an energy V of where body and tools are, of which its forces are the slope once a substep is
solved. So in a step it does what the motions of tools put in, less what V gains, and less what friction and the closing
of gaps take: W <= sum of f . way of the tool - (V_1 - V_0). Where it does more the substep was not solved well enough.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import patch_energy, tool_gap

from . import pairs as col
from .lanes import four, three
from .pairs import EIGHT


@njit(cache=True, error_model="numpy")
def yielded_energy(inside, lag, ease):
    """The integral of F/r of eq. (1) of tools/kernels/patch.py [m^2], of a point inside a tool by d [m]; lag and ease
    as of `patch_yields`.

    By parts, F d - integral of d dF, which d = F/r + (1 - q) s F/(F + q r s) makes one of F.
    """
    if inside <= 0.0:
        return 0.0
    if lag == 0.0:
        return 0.5 * inside * inside
    light = ease * lag
    ahead = inside - lag - light
    force = 0.5 * (ahead + np.sqrt(ahead * ahead + 4.0 * light * inside))
    return force * inside - 0.5 * force * force - lag * (force - light * np.log1p(force / light))


@njit(cache=True, error_model="numpy")
def stored_energy(model, parameters, contacts, xw):
    """V of all that feels a tool and yields to it, as a step ends, with points at contacts.point_x and nodes at xw
    (n + 8, 4) [J]."""
    indptr, node, tilt = model.indptr, model.node, parameters.tilt
    start, rows, pairs = contacts.start, contacts.rows, contacts.pairs
    edges = np.empty((2, 3))
    energy = 0.0
    for tool in range(len(start) - 1):
        kind, shape, places = parameters.kind[tool], parameters.shape[tool], parameters.places[tool]
        position, orientation = three(contacts.position[1], tool), four(contacts.orientation[1], tool)
        for group in range(start[tool], start[tool + 1]):
            if rows[group, col.EDGED] == 0:
                continue
            row = pairs[group]
            for lane in range(EIGHT):
                point, give = rows[group, col.POINT + lane], row[EIGHT * col.SOFT + lane]
                square, normal = 0.0, 0.0
                for c in range(3):
                    f = row[EIGHT * (col.FORCE + c) + lane]
                    square, normal = square + f * f, normal + f * row[EIGHT * (col.GAP + 1 + c) + lane]
                if point < 0 or give == 0.0 or square == 0.0:
                    continue
                place = three(contacts.point_x, point)
                if places > 0 and point >= model.n_surface:
                    edges[:] = 0.0
                    for entry in range(indptr[point], indptr[point + 1]):
                        for c in range(3):
                            edges[0, c] += tilt[entry, 0] * xw[node[entry], c]
                            edges[1, c] += tilt[entry, 1] * xw[node[entry], c]
                    stored = patch_energy(
                        *(kind, shape, position, orientation, place, edges[0], edges[1]),
                        *(row[EIGHT * col.SAG + lane], places),
                    )
                else:
                    gap = tool_gap(kind, shape, position, orientation, place)[0]
                    stored = yielded_energy(-gap, row[EIGHT * col.LAG + lane], parameters.ease)
                # what sticks is held as firmly along the surface
                energy += stored / give + 0.5 * give * max(0.0, square - normal * normal)
    return energy


@njit(cache=True, error_model="numpy")
def put_in(inputs, wrench):
    """What the motions of tools put into the body in a step in which it presses them with wrench (t, 6) in the mean,
    about their positions [J]."""
    work = 0.0
    for tool in range(len(wrench)):
        for c in range(3):
            work -= wrench[tool, c] * (inputs.position_next[tool, c] - inputs.position[tool, c])
        q, p = inputs.orientation[tool], inputs.orientation_next[tool]
        cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
        moment, square = 0.0, 0.0
        for c in range(3):
            j, k = 1 + (c + 1) % 3, 1 + (c + 2) % 3
            sine = q[0] * p[1 + c] - p[0] * q[1 + c] - (p[j] * q[k] - p[k] * q[j])
            moment, square = moment + wrench[tool, 3 + c] * sine, square + sine * sine
        if square > 0.0:
            size = np.sqrt(square)
            angle = 2.0 * np.arctan2(size, abs(cosine))
            work -= moment * angle / (size if cosine >= 0.0 else -size)
    return work
