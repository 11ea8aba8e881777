"""How what acts at a contact goes over to the nodes that it hangs on, and back: W and its transpose, for derivatives.

A candidate has weights W at its point, where its force acts, and of the edges of its patch, of which its force depends
where it meets a tool's edge (kernels/contact.py).
"""

import numpy as np

from softseam_services.jit import njit

from .contact import acting_weight
from .contact_columns import EDGED, NORMAL, PRESSURE, TRACTION

POINT, ACTING = 2, 3
"""where W of `spread` is: at a candidate's point, or where its force acts"""


@njit(cache=True, error_model="numpy", forceinline=True)
def _weight(c, entry, which, parameters, work):
    """Of a node, at a candidate's place in `spread` and `collect`."""
    if which == POINT:
        return parameters.point_weight[entry]
    if which == ACTING:
        return acting_weight(c, entry, parameters, work)
    return parameters.point_tilt[entry, which]


@njit(cache=True, error_model="numpy")
def spread(c, which, scale, vector, model, parameters, work, out):
    """out += scale W^T vector (3,) of a candidate, at free nodes: W of its point, of where its force acts, or of one of
    its patch's edges, 0 or 1."""
    point = work.pair[c, 0]
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place, weight = 3 * model.point_place[entry], scale * _weight(c, entry, which, parameters, work)
        if place >= 0:
            out[place] += weight * vector[0]
            out[place + 1] += weight * vector[1]
            out[place + 2] += weight * vector[2]


@njit(cache=True, error_model="numpy")
def collect(c, which, values, model, parameters, work, out):
    """out (3,) <- W values of a candidate, as in `spread`; values (3 n_free,)."""
    point = work.pair[c, 0]
    out[0] = out[1] = out[2] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        place, weight = 3 * model.point_place[entry], _weight(c, entry, which, parameters, work)
        if place >= 0:
            out[0] += weight * values[place]
            out[1] += weight * values[place + 1]
            out[2] += weight * values[place + 2]


@njit(cache=True, error_model="numpy", forceinline=True)
def dot3(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def add_by_edges(c, values, model, parameters, work, slopes, force):
    """force (3,) += what a change of the edges of a candidate's patch makes of it; values (3 n_free,)."""
    if work.side[c] != EDGED:
        return
    change = np.empty(3)
    for which in range(2):
        collect(c, which, values, model, parameters, work, change)
        for i in range(3):
            force[i] += dot3(slopes.edges[c, which, i], change)


@njit(cache=True, error_model="numpy")
def spread_by_edges(c, scale, vector, model, parameters, work, slopes, out):
    """out += the transpose of `add_by_edges`, times scale and a vector (3,), at free nodes."""
    if work.side[c] != EDGED:
        return
    back = np.empty(3)
    for which in range(2):
        times_transposed(slopes.edges[c, which], 3, vector, back)
        spread(c, which, scale, back, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def add_by_lean(c, scale, values, model, parameters, work, slopes, out):
    """out += scale times what the force does as it moves on a candidate's patch; values (3 n_free,)."""
    if work.side[c] != EDGED:
        return
    change, force = np.empty(3), np.empty(3)
    moved = np.zeros(2)
    for which in (0, 1, POINT):
        collect(c, which, values, model, parameters, work, change)
        for along in range(2):
            moved[along] += scale * dot3(slopes.lean[c, along, which], change)
    acting(c, work, force)
    for along in range(2):
        spread(c, along, moved[along], force, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def spread_by_lean(c, scale, values, model, parameters, work, slopes, out):
    """out += the transpose of `add_by_lean`, times scale, of values (3 n_free,)."""
    if work.side[c] != EDGED:
        return
    back, moves = np.empty(3), np.empty(2)
    lean_owes(c, values, model, parameters, work, moves)
    for which in (0, 1, POINT):
        for j in range(3):
            back[j] = moves[0] * slopes.lean[c, 0, which, j] + moves[1] * slopes.lean[c, 1, which, j]
        spread(c, which, scale, back, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def acting(c, work, force):
    """force (3,) [N] <- that of a candidate."""
    row = work.contact[c]
    for i in range(3):
        force[i] = row[PRESSURE] * row[NORMAL + i] + row[TRACTION + i]


@njit(cache=True, error_model="numpy")
def lean_owes(c, values, model, parameters, work, moves):
    """moves (2,) [N m] <- what values (3 n_free,) make of the force's moving along each edge of its patch."""
    force, change = np.empty(3), np.empty(3)
    acting(c, work, force)
    for which in range(2):
        collect(c, which, values, model, parameters, work, change)
        moves[which] = dot3(force, change)


@njit(cache=True, error_model="numpy")
def times(matrix, first, vector, out):
    """out (3,) <- three rows of matrix (6, 3) from `first` on, times vector (3,)."""
    for i in range(3):
        row = matrix[first + i]
        out[i] = row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2]


@njit(cache=True, error_model="numpy")
def times_transposed(matrix, rows, vector, out):
    """out (3,) <- the transpose of the first rows of matrix (6, 3), times vector (rows,)."""
    for i in range(3):
        out[i] = 0.0
        for k in range(rows):
            out[i] += matrix[k, i] * vector[k]
