"""Rows of contact between bodies of a pile, by eights that share no node and are solved at once, side by side.

Bodies that rows tie are a group, which steps together. Its rows are taken up meeting by meeting, first those that touch
and then those that are only near: each goes into the first eight with room that comes after all those with one of its
nodes, so that rows which share a node keep their order. Which row is in which eight follows from the rows alone.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

from .asleep import awake_of
from .lanes import aligned
from .pairs import EIGHT
from .touch import CORNER, NORMAL, POINT, RANK, RUB, SHARE, SIDE, SOFT

NODE, OF_SIDE, ROW = 0, 4 * EIGHT, 5 * EIGHT
N_LAID = 6 * EIGHT
"""whole numbers of an eight: points, then first, second and third corners, as rows of xw, of eight rows; their SIDE;
their numbers, -1 where a lane is empty"""
(
    OF_SHARE, OF_NORMAL, OF_SOFT, STIFF, OF_RUB, REST, FORCE,
) = 0, 3, 6, 7, 8, 9, 12  # fmt: skip
N_SOLVED = 15
"""numbers of an eight, each for eight rows, that are read in each round: s (3), n (3), alpha [m/N], 1/(c + alpha)
[N/m], mu, what the way from the face to the point was as the substep began + alpha t_0 (3) [m], f (3) [N]"""
BEGAN, AWAY = 0, 3
N_SINCE = 6
"""and once a substep: where the point was as it began (3), and the way from the face to it (3) [m]"""


@record
class Groups(NamedTuple):
    """Bodies that touch one another: b bodies, m meetings, g groups."""

    bodies: NDArray[np.int64]
    """of the first group, of the second ..., ascending in each (b,)"""
    first_body: NDArray[np.int64]
    """of each group there (b + 1,), of which g + 1 count"""
    meetings: NDArray[np.int64]
    """that have rows, likewise (m,)"""
    first_meeting: NDArray[np.int64]
    """(b + 1,)"""
    first_eight: NDArray[np.int64]
    """(b + 1,)"""
    tied: NDArray[np.bool_]
    """whether a body is in any (b,)"""


@record
class Eights(NamedTuple):
    """Of all groups, one after the other: e eights, of which so many count as `lay_rows` said."""

    laid: Ints
    """(e, N_LAID)"""
    solved: Floats
    """(e, N_SOLVED * EIGHT)"""
    since: Floats
    """(e, N_SINCE * EIGHT)"""
    room: NDArray[np.int64]
    """scratch: how many lanes of an eight are taken, and the first one from it on that is not full (e + 1, 2)"""
    newest: NDArray[np.int64]
    """scratch: the last eight that holds a node of xw (n,)"""


def new_groups(b: int, m: int) -> Groups:
    """Room for b bodies and m meetings."""
    ends = np.zeros((3, b + 1), dtype=np.int64)
    bodies, meetings = np.zeros(b, dtype=np.int64), np.zeros(m, dtype=np.int64)
    return Groups(bodies, ends[0], meetings, ends[1], ends[2], np.zeros(b, dtype=np.bool_))


def new_eights(e: int, n: int) -> Eights:
    """Room for e eights of rows of n nodes."""
    laid, room = np.zeros((e, N_LAID), dtype=np.int32), np.zeros((e + 1, 2), dtype=np.int64)
    newest = np.zeros(n, dtype=np.int64)
    return Eights(laid, aligned(e, N_SOLVED * EIGHT), aligned(e, N_SINCE * EIGHT), room, newest)


@njit(cache=True, error_model="numpy")
def find_groups(touch, groups):
    """Groups of the bodies that rows tie, in place; one that sleeps is in none. Returns how many there are."""
    b, tied = len(groups.tied), groups.tied
    parent, number = np.arange(b), np.empty(b, dtype=np.int64)
    tied[:] = False
    for meeting in range(len(touch.pair)):
        if touch.start[meeting] == touch.start[meeting + 1]:
            continue
        one, other = awake_of(touch, meeting)
        tied[one] = tied[other] = True
        one, other = _top(parent, one), _top(parent, other)
        parent[max(one, other)] = min(one, other)
    n = 0
    for body in range(b):
        if tied[body]:
            top = _top(parent, body)
            if top == body:
                number[body] = n
                n += 1
            number[body] = number[top]
    groups.first_body[: n + 1] = 0
    groups.first_meeting[: n + 1] = 0
    for body in range(b):
        if tied[body]:
            groups.first_body[number[body] + 1] += 1
    for meeting in range(len(touch.pair)):
        if touch.start[meeting] < touch.start[meeting + 1]:
            groups.first_meeting[number[awake_of(touch, meeting)[0]] + 1] += 1
    for group in range(n):
        groups.first_body[group + 1] += groups.first_body[group]
        groups.first_meeting[group + 1] += groups.first_meeting[group]
    bodies, meetings = groups.first_body[:n].copy(), groups.first_meeting[:n].copy()
    for body in range(b):
        if tied[body]:
            groups.bodies[bodies[number[body]]] = body
            bodies[number[body]] += 1
    for meeting in range(len(touch.pair)):
        if touch.start[meeting] < touch.start[meeting + 1]:
            group = number[awake_of(touch, meeting)[0]]
            groups.meetings[meetings[group]] = meeting
            meetings[group] += 1
    return n


@njit(cache=True, error_model="numpy")
def _top(parent, body):
    while parent[body] != body:
        parent[body] = parent[parent[body]]
        body = parent[body]
    return body


@njit(cache=True, error_model="numpy")
def lay_rows(touch, groups, n_groups, eights, padding):
    """Rows of all groups into eights, in place. Returns how many eights there are, or -1 where there is no room.

    padding  the first of EIGHT rows of xw that never move: nodes of empty lanes
    """
    ints, laid, room, newest = touch.ints, eights.laid, eights.room, eights.newest
    newest[:] = -1
    n = 0
    for group in range(n_groups):
        groups.first_eight[group] = n
        for rank in range(2):
            begin = n  # those that only are near wait in eights of their own
            room[n, 0], room[n, 1] = 0, n
            for at in range(groups.first_meeting[group], groups.first_meeting[group + 1]):
                meeting = groups.meetings[at]
                if touch.visits[meeting]:
                    continue
                for r in range(touch.start[meeting], touch.start[meeting + 1]):
                    if ints[r, RANK] != rank:
                        continue
                    eight = begin
                    for k in range(POINT, CORNER + 3):
                        eight = max(eight, newest[ints[r, k]] + 1)
                    eight = _with_room(room, eight)
                    if eight == n:
                        if n == len(laid):
                            return -1
                        _open(laid, n, padding)
                        n += 1
                        room[n, 0], room[n, 1] = 0, n
                    lane = room[eight, 0]
                    room[eight, 0] += 1
                    if lane == EIGHT - 1:
                        room[eight, 1] = eight + 1
                    for k in range(4):
                        node = ints[r, POINT + k]
                        laid[eight, NODE + EIGHT * k + lane] = node
                        newest[node] = eight
                    laid[eight, OF_SIDE + lane], laid[eight, ROW + lane] = ints[r, SIDE], r
    groups.first_eight[n_groups] = n
    return n


@njit(cache=True, error_model="numpy", forceinline=True)
def _with_room(room, eight):
    """The first eight from this one on that is not full."""
    while room[eight, 1] != eight:
        room[eight, 1] = room[room[eight, 1], 1]
        eight = room[eight, 1]
    return eight


@njit(cache=True, error_model="numpy")
def _open(laid, eight, padding):
    """An eight without rows."""
    for lane in range(EIGHT):
        for k in range(4):
            laid[eight, NODE + EIGHT * k + lane] = padding + lane
        laid[eight, OF_SIDE + lane], laid[eight, ROW + lane] = 0, -1


@njit(cache=True, error_model="numpy")
def fill_eights(touch, eights, n_eights):
    """The rows' numbers into their eights."""
    rows, laid, solved = touch.rows, eights.laid, eights.solved
    for eight in range(n_eights):
        to = solved[eight]
        for lane in range(EIGHT):
            r = laid[eight, ROW + lane]
            if r < 0:
                for k in range(N_SOLVED):
                    to[EIGHT * k + lane] = 0.0
                continue
            for k in range(3):
                to[EIGHT * (OF_SHARE + k) + lane] = rows[r, SHARE + k]
                to[EIGHT * (OF_NORMAL + k) + lane] = rows[r, NORMAL + k]
            to[EIGHT * OF_SOFT + lane], to[EIGHT * OF_RUB + lane] = rows[r, SOFT], rows[r, RUB]
