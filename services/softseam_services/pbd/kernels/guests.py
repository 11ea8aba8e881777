"""Bodies of other models that touch a pile: how their surfaces go along while the pile's bodies take their substeps.

A guest was advanced by a step before, under forces that were thought to act. Without them its surface would have gone
from x_0 to x_1, and a constant force on it moves it by dx = A df. In substep k of N the pile's bodies meet it at

    u_k = x_0 + k/N (x_1 - x_0) + 1/N A sum_{j <= k} f_j                                                         (1)

with the forces f_j of substep j, so that a row's force moves the guest by A df/N at once: it is solved with
c + b A b^T/N in place of c, see `between`, b being the weights of the guest's points in the row. At the end u_N is
where the guest goes under the mean force f = 1/N sum f_j, linearly, which is what acts on it: momentum is kept.

What contact takes from the pile's bodies, -sum_k f_k (u_k - u_{k-1}), and what the guest has of it, f (u_N - x_0), are

    f A f - 1/N sum_k f_k A f_k <= 0                                                                            (2)

in all, for any masses and stiffnesses, since A is positive: no mean is above that of the squares. So no energy is made.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

from .between_row import CORNER, FORCE, NORMAL, OTHER, OWN, POINT, SHARE, SLIDES, YIELDS


@record
class Guests(NamedTuple):
    """g bodies with q points in all, in the order of their rows."""

    first: Ints
    """of the points of each (g + 1,)"""
    row: Ints
    """of the first point of all, in the pile's xw (1,)"""
    came: Floats
    """points as the step begins (q, 3) [m]"""
    goes: Floats
    """and as it ends, if nothing touches them"""
    answers: Floats
    """A of each between its points that count in the step, one after the other, in rows [m/N]"""
    begin: np.ndarray[tuple[int], np.dtype[np.int64]]
    """first number of each there (g + 1,)"""
    listed: Ints
    """these points, counted from the first of their body, at that one's place and after (q,)"""
    n_listed: Ints
    """how many they are (g,)"""
    slot: Ints
    """place of each point among them, -1 of others (q,)"""
    now: Floats
    """forces of the substep at hand (q, 3) [N]"""
    felt: Floats
    """mean forces over the step (q, 3) [N]; sums over its substeps so far, while it is taken"""
    moment: Floats
    """of these about the world's origin (g, 3) [N m], where the others were that exert them"""
    lost: Ints
    """1 of each whose pile's step was lost: what it felt is not known (g,)"""


@njit(cache=True, error_model="numpy")
def list_points(guests, touch, n_own):
    """guests.slot, listed, n_listed <- the points that rows name, met by n_own bodies of the pile and one another."""
    guests.slot[:] = -1
    for r in range(touch.start[len(touch.pair)]):
        ints = touch.ints[r]
        if ints[OWN] >= n_own:
            guests.slot[ints[POINT] - guests.row[0]] = 0
        if ints[OTHER] >= n_own:
            for k in range(3):
                guests.slot[ints[CORNER + k] - guests.row[0]] = 0
    for guest in range(len(guests.n_listed)):
        first, n = guests.first[guest], 0
        for q in range(first, guests.first[guest + 1]):
            if guests.slot[q] == 0:
                guests.slot[q] = n
                guests.listed[first + n] = q - first
                n += 1
        guests.n_listed[guest] = n


@njit(cache=True, error_model="numpy")
def begin_guests(guests, which, touch, meetings, n_own, n_substeps, xw):
    """An attempt at a step in so many substeps begins.

    which  numbers of the guests that take part (k,)
    """
    for guest in which:
        first = guests.first[guest]
        guests.lost[guest] = 0
        for c in range(3):
            guests.moment[guest, c] = 0.0
        for i in range(guests.n_listed[guest]):
            q = first + guests.listed[first + i]
            for c in range(3):
                xw[guests.row[0] + q, c] = guests.came[q, c]
                guests.felt[q, c] = 0.0
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            _find_answer(guests, touch.ints[r], touch.rows[r], n_own, 1.0 / n_substeps)


@njit(cache=True, error_model="numpy")
def _find_answer(guests, ints, row, n_own, share):
    """row[YIELDS], row[SLIDES] <- b A b^T/N along the normal, and across it in the mean [m/N]."""
    along = whole = 0.0
    base = guests.row[0]
    if ints[OWN] >= n_own:
        slot = guests.slot[ints[POINT] - base]
        along, whole = _between(guests, ints[OWN] - n_own, slot, slot, row)
    if ints[OTHER] >= n_own:
        for k in range(3):
            for m in range(3):
                one, other = guests.slot[ints[CORNER + k] - base], guests.slot[ints[CORNER + m] - base]
                a, w = _between(guests, ints[OTHER] - n_own, one, other, row)
                both = row[SHARE + k] * row[SHARE + m]
                along, whole = along + both * a, whole + both * w
    row[YIELDS], row[SLIDES] = share * along, share * 0.5 * (whole - along)


@njit(cache=True, error_model="numpy")
def _between(guests, guest, one, other, row):
    """n A n and the trace of A between two of the listed points."""
    n, begin = 3 * guests.n_listed[guest], guests.begin[guest]
    along = whole = 0.0
    for c in range(3):
        for d in range(3):
            a = guests.answers[begin + (3 * one + c) * n + 3 * other + d]
            along += row[NORMAL + c] * a * row[NORMAL + d]
        whole += guests.answers[begin + (3 * one + c) * n + 3 * other + c]
    return along, whole


@njit(cache=True, error_model="numpy")
def place_guests(guests, which, touch, meetings, n_own, substep, n_substeps, xw):
    """Guests are where (1) has them as substep `substep` (0 and more) ends, with the forces that its rows have now."""
    _feel(guests, which, touch, meetings, n_own)
    row, share = guests.row[0], (substep + 1.0) / n_substeps
    for guest in which:
        first, n, begin = guests.first[guest], guests.n_listed[guest], guests.begin[guest]
        for i in range(n):
            q = first + guests.listed[first + i]
            for c in range(3):
                at = begin + (3 * i + c) * 3 * n
                more = 0.0
                for j in range(n):
                    p = first + guests.listed[first + j]
                    for d in range(3):
                        more += guests.answers[at + 3 * j + d] * (guests.felt[p, d] + guests.now[p, d])
                xw[row + q, c] = (1.0 - share) * guests.came[q, c] + share * guests.goes[q, c] + more / n_substeps


@njit(cache=True, error_model="numpy")
def move_guest(guests, guest, place, share, x, y, z, xw):
    """A guest answers a change of the force on one of its points, a row of xw, by so much of A."""
    first, n, begin = guests.first[guest], guests.n_listed[guest], guests.begin[guest]
    row = guests.row[0]
    at = begin + 9 * n * guests.slot[place - row]
    x, y, z = share * x, share * y, share * z
    for i in range(n):
        q = row + first + guests.listed[first + i]
        for c in range(3):
            k = at + 3 * i + c  # A is symmetric: its rows are its columns
            xw[q, c] += guests.answers[k] * x + guests.answers[k + 3 * n] * y + guests.answers[k + 6 * n] * z


@njit(cache=True, error_model="numpy")
def _feel(guests, which, touch, meetings, n_own):
    """guests.now <- the forces of the rows."""
    row = guests.row[0]
    for guest in which:
        first = guests.first[guest]
        for i in range(guests.n_listed[guest]):
            for c in range(3):
                guests.now[first + guests.listed[first + i], c] = 0.0
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            ints, own = touch.ints[r], touch.rows[r]
            for c in range(3):
                if ints[OWN] >= n_own:
                    guests.now[ints[POINT] - row, c] += own[FORCE + c]
                if ints[OTHER] >= n_own:
                    for k in range(3):
                        guests.now[ints[CORNER + k] - row, c] -= own[SHARE + k] * own[FORCE + c]


@njit(cache=True, error_model="numpy")
def push_guests(guests, which, touch, meetings, n_own, n_substeps, xw):
    """A substep ends: its forces are added to those of the others, and what they turn."""
    _feel(guests, which, touch, meetings, n_own)
    for guest in which:
        first = guests.first[guest]
        for i in range(guests.n_listed[guest]):
            q = first + guests.listed[first + i]
            for c in range(3):
                guests.felt[q, c] += guests.now[q, c]
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            ints, row = touch.ints[r], touch.rows[r]
            if ints[OWN] < n_own and ints[OTHER] < n_own:
                continue
            for c in range(3):
                j, k = (c + 1) % 3, (c + 2) % 3
                at_j, at_k = xw[ints[POINT], j], xw[ints[POINT], k]
                turned = (at_j * row[FORCE + k] - at_k * row[FORCE + j]) / n_substeps
                if ints[OWN] >= n_own:
                    guests.moment[ints[OWN] - n_own, c] += turned
                if ints[OTHER] >= n_own:
                    guests.moment[ints[OTHER] - n_own, c] -= turned


@njit(cache=True, error_model="numpy")
def end_guests(guests, which, n_substeps):
    """guests.felt <- mean forces over the step."""
    for guest in which:
        first = guests.first[guest]
        for i in range(guests.n_listed[guest]):
            for c in range(3):
                guests.felt[first + guests.listed[first + i], c] /= n_substeps
