"""Bodies of other models that touch a pile: how they go along while the pile's bodies take their substeps.

A guest was advanced by a step before, under the forces F with which its patches begin, from x_0 to x_1; other constant
forces on them move them by dx = A (f - F). In substep k of N the pile's bodies meet them at

    u_k = x_0 + k/N (x_1 - x_0) + 1/N A sum_{j <= k} (f_j - F)                                                   (1)

with the forces f_j of substep j, so that a patch's force moves the guest by A df/N at once: it is solved with c + A/N
in place of c, see `patches`. At the end u_N is where the guest goes under the mean force f = 1/N sum f_j, linearly,
which is what acts on it: momentum is kept.

What contact takes from the pile's bodies, -sum_k f_k (u_k - u_{k-1}), and what the guest has of it, f (u_N - x_0), are

    f A f - 1/N sum_k f_k A f_k <= 0                                                                            (2)

in all, for any masses and stiffnesses, since A is positive: no mean is above that of the squares. So no energy is made.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

from .gather import (
    BODY,
    END,
    FIRST,
    FORCE,
    GIVES,
    GUEST,
    GUEST_SLOT,
    HELD,
    MIDDLE,
    NORMAL,
    OFFSET,
    OTHER,
    RUB,
    SLIDES,
    SLOT,
    SOFT,
    YIELDS,
)
from .patches import any_patches, know_begin, look_how_far, press, way_between


@record
class Guests(NamedTuple):
    """g bodies with s slots in all, one of each patch that they are in."""

    n_own: Ints
    """bodies of the pile (1,)"""
    first_slot: Ints
    """(g + 1,)"""
    came: Floats
    """their patches as the step begins (s, 3) [m]"""
    goes: Floats
    """and as it ends, under these forces"""
    begun: Floats
    """with which they begin (s, 3) [N]"""
    answers: Floats
    """A of each, one after the other, in rows [m/N]"""
    begin: np.ndarray[tuple[int], np.dtype[np.int64]]
    """first number of each there (g + 1,)"""
    at: Floats
    """patches within the step (s, 3) [m]"""
    now: Floats
    """forces of the substep at hand (s, 3) [N]"""
    felt: Floats
    """mean forces over the step (s, 3) [N]; sums over its substeps so far, while it is taken"""
    moment: Floats
    """of these about the world's origin, where the others were that exert them (g, 3) [N m]"""
    lost: Ints
    """1 of each whose pile's step was lost: what it felt is not known (g,)"""


@njit(cache=True, error_model="numpy")
def begin_guests(guests, which, patches, meetings, n_substeps):
    """An attempt at a step in so many substeps begins; which (k,): the guests that take part."""
    for guest in which:
        guests.lost[guest] = 0
        for c in range(3):
            guests.moment[guest, c] = 0.0
            for slot in range(guests.first_slot[guest], guests.first_slot[guest + 1]):
                guests.at[slot, c] = guests.came[slot, c]
                guests.felt[slot, c] = 0.0
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            along, whole = 0.0, 0.0
            if ints[GUEST] >= 0:
                along, whole = _own_answer(guests, ints[GUEST], ints[GUEST_SLOT], row)
            if ints[SLOT] >= 0:
                a, w = _own_answer(guests, ints[BODY] - guests.n_own[0], ints[SLOT], row)
                along, whole = along + a, whole + w
            row[YIELDS], row[SLIDES] = along / n_substeps, 0.5 * (whole - along) / n_substeps


@njit(cache=True, error_model="numpy")
def _own_answer(guests, guest, slot, row):
    """n A n and the trace of A of one slot."""
    n = 3 * (guests.first_slot[guest + 1] - guests.first_slot[guest])
    along = whole = 0.0
    for c in range(3):
        at = guests.begin[guest] + (3 * slot + c) * n + 3 * slot
        for d in range(3):
            along += row[NORMAL + c] * guests.answers[at + d] * row[NORMAL + d]
        whole += guests.answers[at + c]
    return along, whole


@njit(cache=True, error_model="numpy")
def place_guests(guests, which, patches, meetings, substep, n_substeps):
    """Guests are where (1) has them as substep `substep` (0 and more) ends, with the forces that patches have now."""
    _feel(guests, which, patches, meetings)
    share = (substep + 1.0) / n_substeps
    for guest in which:
        first, end, at = guests.first_slot[guest], guests.first_slot[guest + 1], guests.begin[guest]
        for slot in range(first, end):
            for c in range(3):
                more = 0.0
                for other in range(first, end):
                    for d in range(3):
                        load = guests.felt[other, d] + guests.now[other, d] - (substep + 1.0) * guests.begun[other, d]
                        more += guests.answers[at] * load
                        at += 1
                went = (1.0 - share) * guests.came[slot, c] + share * guests.goes[slot, c]
                guests.at[slot, c] = went + more / n_substeps


@njit(cache=True, error_model="numpy")
def project_patches(members, touch, patches, meetings, bodies, xw, hh, guests, n_substeps):
    """Solve patches, see `patches` and eq. (1) of `between`, one after the other; hh is the substep squared [s^2].
    xw is moved, and guests. Those that are clear are passed by."""
    if not any_patches(patches, meetings):
        return
    look_how_far(members, touch, patches, bodies, xw)
    clear, moved = patches.clear, patches.moved
    for meeting in meetings:
        one, other = touch.pair[meeting, 0], touch.pair[meeting, 1]
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            if clear[r] > moved[one] + moved[other]:
                continue
            ints, row = patches.ints[r], patches.rows[r]
            nx, ny, nz = row[NORMAL], row[NORMAL + 1], row[NORMAL + 2]
            fx, fy, fz = row[FORCE], row[FORCE + 1], row[FORCE + 2]
            dx, dy, dz = way_between(patches, ints, xw, guests)
            soft = row[SOFT]
            old, gives = max(0.0, fx * nx + fy * ny + fz * nz), hh * row[GIVES] + row[YIELDS]
            away = dx * nx + dy * ny + dz * nz + row[OFFSET]
            p = press(patches, ints, away - gives * old, gives)
            tx, ty, tz = 0.0, 0.0, 0.0
            if p > 0.0:
                clear[r] = -np.inf
            if p > 0.0 and row[RUB] > 0.0:
                if not patches.known[r]:
                    know_begin(patches, r, guests)
                began = patches.began[r]
                sx = dx - began[0, 0] + began[1, 0] + soft * (fx - row[HELD])
                sy = dy - began[0, 1] + began[1, 1] + soft * (fy - row[HELD + 1])
                sz = dz - began[0, 2] + began[1, 2] + soft * (fz - row[HELD + 2])
                across = 1.0 / (hh * row[GIVES] + soft + row[SLIDES])
                tx, ty, tz = fx - sx * across, fy - sy * across, fz - sz * across
                tn = tx * nx + ty * ny + tz * nz
                tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
                size, bound = np.sqrt(tx * tx + ty * ty + tz * tz), row[RUB] * p
                if size > bound:
                    tx, ty, tz = tx * bound / size, ty * bound / size, tz * bound / size
            gx, gy, gz = p * nx + tx - fx, p * ny + ty - fy, p * nz + tz - fz
            if gx == 0.0 and gy == 0.0 and gz == 0.0:
                continue
            row[FORCE], row[FORCE + 1], row[FORCE + 2] = fx + gx, fy + gy, fz + gz
            size = np.sqrt(gx * gx + gy * gy + gz * gz)
            moved[ints[BODY]] += size * _shift(patches, ints[FIRST], ints[MIDDLE], xw, hh, gx, gy, gz)
            moved[ints[OTHER]] += size * _shift(patches, ints[MIDDLE], ints[END], xw, hh, gx, gy, gz)
            if ints[SLOT] >= 0:
                _move(guests, ints[BODY] - guests.n_own[0], ints[SLOT], 1.0 / n_substeps, gx, gy, gz)
            if ints[GUEST] >= 0:
                _move(guests, ints[GUEST], ints[GUEST_SLOT], -1.0 / n_substeps, gx, gy, gz)


@njit(cache=True, error_model="numpy", forceinline=True)
def _shift(patches, first, end, xw, hh, x, y, z):
    """Nodes give way to a change of force; by how much the one that goes farthest does [m/N]."""
    most = 0.0
    for k in range(first, end):
        node = patches.node[k]
        step = hh * patches.weight[k] * xw[node, 3]
        xw[node, 0] += step * x
        xw[node, 1] += step * y
        xw[node, 2] += step * z
        most = max(most, abs(step))
    return most


@njit(cache=True, error_model="numpy")
def _move(guests, guest, slot, share, x, y, z):
    """A guest answers a change of the force at one of its slots, by so much of A."""
    first, n = guests.first_slot[guest], guests.first_slot[guest + 1] - guests.first_slot[guest]
    at = guests.begin[guest] + 9 * n * slot
    x, y, z = share * x, share * y, share * z
    for i in range(n):
        for c in range(3):
            k = at + 3 * i + c  # A is symmetric: its rows are its columns
            more = guests.answers[k] * x + guests.answers[k + 3 * n] * y + guests.answers[k + 6 * n] * z
            guests.at[first + i, c] += more


@njit(cache=True, error_model="numpy")
def _feel(guests, which, patches, meetings):
    """guests.now <- the forces of patches."""
    for guest in which:
        for slot in range(guests.first_slot[guest], guests.first_slot[guest + 1]):
            for c in range(3):
                guests.now[slot, c] = 0.0
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            for c in range(3):
                if ints[GUEST] >= 0:
                    guests.now[guests.first_slot[ints[GUEST]] + ints[GUEST_SLOT], c] -= row[FORCE + c]
                if ints[SLOT] >= 0:
                    mine = guests.first_slot[ints[BODY] - guests.n_own[0]] + ints[SLOT]
                    guests.now[mine, c] += row[FORCE + c]


@njit(cache=True, error_model="numpy")
def push_guests(guests, which, patches, meetings):
    """A substep ends: its forces are added to those of the others."""
    _feel(guests, which, patches, meetings)
    for guest in which:
        for slot in range(guests.first_slot[guest], guests.first_slot[guest + 1]):
            for c in range(3):
                guests.felt[slot, c] += guests.now[slot, c]


@njit(cache=True, error_model="numpy")
def end_guests(guests, which, n_substeps, lost):
    """guests.felt <- mean forces over the step."""
    for guest in which:
        guests.lost[guest] = 1 if lost else 0
        for slot in range(guests.first_slot[guest], guests.first_slot[guest + 1]):
            for c in range(3):
                guests.felt[slot, c] /= n_substeps
