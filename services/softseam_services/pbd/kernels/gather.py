"""What touches, gathered into patches of surface around nodes of one of the two, see `patches`.

Points that press on faces are closer than the nodes of what they press on: alone each would ask for a force of its own,
which neither body can tell from its neighbours'. So points q, of area a_q at feet on faces, from which they are g_q
away, are gathered by the weights t_qi of the nodes i around them (a mortar with lumped multipliers):

    w_qi = s_q a_q t_qi/sum_q,   d_i = sum_q w_qi d_q,   n_i ~ sum_q w_qi n_q                                      (1)

with s_q = 1 of points that are inside, or will be, hardly anything of those that are not near that. Where a surface is
curved it is the pressure with which the step begins: a force goes back to where it acts, and one that is spread evenly
over what is inside is up to 15 % too firm. What they press with together is the sum of what each does where they go
along with d_i,

    F_i = sum_q k_q max(0, -e_q - n_i . d_i),   k_q = a_q t_qi/y,   e_q = g_q - (n_i . d_i)                         (2)

of which e_q is as the step begins: so where a surface is round, or tilted, those press that are inside; of points that
yield by place there are several terms (`flattening`). The force goes back by the weights (1), to nodes of both bodies.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import SAME, Floats, Ints
from softseam_services.jit import njit, record

from .flattening import HINGES, find_hinges
from .sampled_points import LEAST
from .touch import AREA, CORNER, FADE, GAP, POINT, SHARE, SIDE
from .touch import NORMAL as FACING

BODY, OTHER, FIRST, MIDDLE, END, PLACE, SLOT, GUEST, GUEST_SLOT, BEND, LAST_BEND, PRESSED = range(12)
N_INTS = 12
"""of a patch: the body with the nodes that it is around, and the other; first node of the one, first of the other, and
the end of these; place among forces; slot of the one where it is a guest, else -1; the other, counted among guests, and
its slot, or -1; first and end of its points in eq. (2), and how many of these are inside"""
NORMAL, SOFT, GIVES, RUB, FORCE, HELD, YIELDS, SLIDES, OFFSET, NEAREST = 0, 3, 4, 5, 6, 9, 12, 13, 14, 15
N_NUMBERS = 16
"""n (3,) from the other to the one, alpha [m/N] across it, c/h^2 [1/kg], mu, f on the one and t_0 (3,) [N], and what
guests add to c along n and across it, see `guests` [m/N], what is added to all e_q, see `patches` [m], and the least
e_q of points that are not beside their faces, inf where all are [m]"""
STIFF, LEVER, ENERGY = 0, 1, 2
"""of a point in eq. (2), of those so near and nearer: the sums of k_q [N/m], of k_q e_q [N], and of k_q e_q^2/2 [J]"""
_OPEN = 1e-4
"""how much points that are open count on curved surfaces, of one that is so many spacings inside: with 1e-9 what lies
still swings by 5e-6 of its weight [1]"""
_MOST = 24
"""nodes that a point, or the foot of one, follows at most"""


@record
class Patches(NamedTuple):
    """Those of all meetings that have any, in a step."""

    start: Ints
    """first of each meeting (m + 1,)"""
    ints: Ints
    """(r, N_INTS)"""
    rows: Floats
    """(r, N_NUMBERS)"""
    began: Floats
    """places on either body as the substep began, where `known` (r, 2, 3) [m]"""
    known: np.ndarray[tuple[int], np.dtype[np.bool_]]
    """(r,)"""
    clear: Floats
    """by how much the nodes of both bodies may go from `since`, added up, before it presses; -inf where it has, or has
    a guest (r,) [m]"""
    moved: Floats
    """by how much those of a body went at most (b,) [m]"""
    since: Floats
    """nodes as the attempt began (n, 3) [m]"""
    begun: Floats
    """and as the substep did"""
    node: Ints
    """rows of the pile's xw, patch by patch"""
    weight: Floats
    """and their weights, those of the other body with the opposite sign [1]"""
    bend: Floats
    """see `STIFF`, of the points of each patch, the nearest first (l, 3)"""
    taken: Floats
    """T of eq. (1) of `patches`, of each meeting (m,) [J]"""
    slot: Ints
    """guest, slot and point, counted from the first of its guest, of all points of guests that patches have (e, 3)"""
    share: Floats
    """and their weights (e,) [1]"""
    n_slots: Ints
    """of each guest (g,)"""
    across: Ints
    """of each two points of a body whose faces are squares, row by row, that are ends of a square's diagonal and follow
    one another around a triangle: the corner on the other side, else -1; body by body"""
    first_across: np.ndarray[tuple[int], np.dtype[np.int64]]
    """of each body of the pile, -1 of those of which no points press on squares (b,)"""


@njit(cache=True, error_model="numpy")
def gather_patches(touch, patches, xw, n_own, among, part):
    """Patches of the points and faces that rows of `touch` have. Returns how many entries of `slot` they have, or -1
    where there is no room for all.

    among, part  see `SampledFaces`, of all guests, for patches between two of these
    """
    n, n_nodes, n_entries, n_bends = 0, 0, 0, 0
    patches.n_slots[:] = 0
    known = np.full((3, max(len(xw), len(touch.at))), -1, dtype=np.int32)
    for meeting in range(len(touch.pair)):
        patches.start[meeting] = n
        begin, end = touch.start[meeting], touch.start[meeting + 1]
        if begin == end or not touch.visits[meeting]:
            continue
        side = touch.around[meeting]
        one, other = touch.sides[meeting, side], touch.sides[meeting, 1 - side]
        most = _MOST * (end - begin)
        whose, mine, theirs = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most, np.int32)
        count = np.empty((3, end - begin), dtype=np.int32)
        of, share_mine, share_theirs = np.empty(most), np.empty(most), np.empty(most)
        ids, n_ids = np.empty((3, most), dtype=np.int32), np.zeros(3, dtype=np.int32)
        corners = np.empty(4, dtype=np.int32)
        depth, slope = np.empty((end - begin, HINGES)), np.empty((end - begin, HINGES))
        bends, counts = np.empty(end - begin, dtype=np.int32), np.empty(end - begin)
        curved = touch.curved[one] or touch.curved[other]
        for r in range(end - begin):
            ints, row = touch.ints[begin + r], touch.rows[begin + r]
            at = _MOST * r
            if touch.sides[meeting, ints[SIDE] % 2] == other:
                count[0, r] = _foot(touch, patches, one, ints, row, mine, share_mine, at, corners)
                count[1, r] = _point(touch, other, n_own, ints[POINT], theirs, share_theirs, at)
                count[2, r] = _around(share_mine, mine, at, count[0, r], whose, of)
            else:  # two guests
                mine[at], share_mine[at], count[0, r] = ints[POINT], 1.0, 1
                for k in range(3):
                    theirs[at + k], share_theirs[at + k] = ints[CORNER + k], row[SHARE + k]
                count[1, r], count[2, r] = 3, among.shape[1]
                q = touch.first[one] - touch.first[n_own] + ints[POINT]
                for k in range(among.shape[1]):
                    whose[at + k], of[at + k] = among[q, k], part[q, k]
            _number(known, ids, n_ids, 0, mine, at, count[0, r])
            _number(known, ids, n_ids, 1, theirs, at, count[1, r])
            _number(known, ids, n_ids, 2, whose, at, count[2, r])
        for which in range(3):
            for k in range(n_ids[which]):
                known[which, ids[which, k]] = -1
        p = n_ids[2]
        of_one, of_other = np.zeros((p, n_ids[0])), np.zeros((p, n_ids[1]))
        total, normal, first = np.zeros(p), np.zeros((p, 3)), np.zeros(p + 1, dtype=np.int32)
        counts_near = np.zeros(p, dtype=np.bool_)
        for r in range(end - begin):
            if touch.rows[begin + r, FADE] > LEAST:
                for k in range(_MOST * r, _MOST * r + count[2, r]):
                    counts_near[whose[k]] = counts_near[whose[k]] or of[k] > 0.0
        sign = -1.0 if touch.sides[meeting, touch.ints[begin, SIDE] % 2] == other else 1.0
        for r in range(end - begin):
            row = touch.rows[begin + r]
            bends[r] = find_hinges(touch, meeting, touch.ints[begin + r], row, depth[r], slope[r])
            counts[r] = row[AREA] * row[FADE]
            if curved:
                pressure = _OPEN * touch.spacing[other] * row[FADE] * slope[r, 0]
                for hinge in range(bends[r]):
                    pressure += slope[r, hinge] * max(0.0, -row[GAP] - depth[r, hinge])
                counts[r] = row[AREA] * pressure
            for k in range(_MOST * r, _MOST * r + count[2, r]):
                if of[k] <= 0.0:
                    continue
                i, t = whose[k], counts[r] * of[k]
                first[i + 1] += bends[r]
                if row[FADE] <= LEAST and counts_near[i]:  # 1e-9 of what others count, and as many nodes as these
                    continue
                total[i] += t
                for c in range(3):
                    normal[i, c] += t * sign * row[FACING + c]
                for m in range(_MOST * r, _MOST * r + count[0, r]):
                    of_one[i, mine[m]] += t * share_mine[m]
                for m in range(_MOST * r, _MOST * r + count[1, r]):
                    of_other[i, theirs[m]] += t * share_theirs[m]
        length = np.sqrt((normal**2).sum(axis=1))
        mean = np.zeros(p)
        for i in range(p):
            first[i + 1] += first[i]
        nearest = np.full(p, np.inf)
        gap, stiff, next_ = np.empty(first[p]), np.empty(first[p]), first[:-1].copy()
        for r in range(end - begin):
            row, ints = touch.rows[begin + r], touch.ints[begin + r]
            whole = touch.area[touch.first[touch.sides[meeting, ints[SIDE] % 2]] + ints[POINT]]
            for k in range(_MOST * r, _MOST * r + count[2, r]):
                if of[k] <= 0.0:
                    continue
                i, along = whose[k], 0.0
                if row[AREA] >= (1.0 - SAME) * whole:
                    nearest[i] = min(nearest[i], row[GAP])
                for c in range(3):
                    along += sign * row[FACING + c] * normal[i, c]
                if row[FADE] > LEAST or not counts_near[i]:
                    mean[i] += counts[r] * of[k] * row[GAP] * along
                for hinge in range(bends[r]):
                    gap[next_[i]] = row[GAP] + depth[r, hinge]
                    stiff[next_[i]] = row[AREA] * of[k] * slope[r, hinge]
                    next_[i] += 1
        for i in np.argsort(ids[2, :p]):
            if length[i] == 0.0:
                continue
            if n == len(patches.ints) or n_nodes + n_ids[0] + n_ids[1] > len(patches.node):
                return -1
            if n_entries + n_ids[0] + n_ids[1] > len(patches.slot) or n_bends + first[i + 1] - first[i] > len(
                patches.bend
            ):
                return -1
            ints, row = patches.ints[n], patches.rows[n]
            for c in range(3):
                row[NORMAL + c] = normal[i, c] / length[i]
            row[GIVES], row[RUB] = 0.0, touch.friction[meeting]
            ints[BODY], ints[OTHER] = touch.body[one], touch.body[other]
            ints[PLACE] = touch.held[meeting, side, 0]
            ints[PLACE] += touch.number[ids[2, i]] if one < n_own or one >= len(touch.asleep) else ids[2, i]
            ints[FIRST], ints[SLOT], ints[GUEST], ints[GUEST_SLOT] = n_nodes, -1, -1, -1
            if n_own <= one < len(touch.asleep):
                n_entries = _enter(patches, n_entries, one - n_own, ids[0], of_one, i, total[i])
                ints[SLOT] = patches.n_slots[one - n_own]
                patches.n_slots[one - n_own] += 1
            else:
                n_nodes = _join(patches, n_nodes, row, xw, ids[0], of_one, i, total[i])
            ints[MIDDLE] = n_nodes
            if n_own <= other < len(touch.asleep):
                n_entries = _enter(patches, n_entries, other - n_own, ids[1], of_other, i, total[i])
                ints[GUEST], ints[GUEST_SLOT] = other - n_own, patches.n_slots[other - n_own]
                patches.n_slots[other - n_own] += 1
            else:
                n_nodes = _join(patches, n_nodes, row, xw, ids[1], of_other, i, -total[i])
            ints[END], ints[BEND] = n_nodes, n_bends
            _bend(gap, stiff, first[i], first[i + 1], mean[i] / (total[i] * length[i]), patches.bend, n_bends)
            n_bends += first[i + 1] - first[i]
            ints[LAST_BEND], ints[PRESSED] = n_bends, 1
            row[NEAREST] = nearest[i] - mean[i] / (total[i] * length[i])
            row[SOFT] = 1.0 / patches.bend[n_bends - 1, STIFF]
            n += 1
    patches.start[len(touch.pair)] = n
    return n_entries


@njit(cache=True, error_model="numpy")
def _number(known, ids, n_ids, which, own, at, count):
    """Ids at .. at + count - 1 of own become numbers among those of a meeting, in place.

    Here and below arrays come whole, with a place in them: a view of an array that a kernel made counts references,
    which costs more than what is done with it.
    """
    for k in range(at, at + count):
        number = own[k]
        if known[which, number] < 0:
            known[which, number], ids[which, n_ids[which]] = n_ids[which], number
            n_ids[which] += 1
        own[k] = known[which, number]


@njit(cache=True, error_model="numpy")
def _enter(patches, entry, guest, points, weights, i, per):
    """Points of a guest into its next slot, by row i of weights over `per`; returns how many entries there are."""
    for k in range(weights.shape[1]):
        if weights[i, k] != 0.0:
            to = patches.slot[entry]
            to[0], to[1], to[2] = guest, patches.n_slots[guest], points[k]
            patches.share[entry] = weights[i, k] / per
            entry += 1
    return entry


@njit(cache=True, error_model="numpy")
def _join(patches, n_nodes, row, xw, nodes, weights, i, per):
    """Nodes of a body of the pile into a patch, by row i of weights over `per`; returns how many there are in all."""
    for k in range(weights.shape[1]):
        if weights[i, k] != 0.0:
            weight = weights[i, k] / per
            patches.node[n_nodes], patches.weight[n_nodes] = nodes[k], weight
            row[GIVES] += weight**2 * xw[nodes[k], 3]
            n_nodes += 1
    return n_nodes


@njit(cache=True, error_model="numpy")
def _bend(gap, stiff, first, end, mean, bend, to):
    """Points first .. end - 1 into eq. (2), the nearest first."""
    for k in range(first + 1, end):
        g, s, at = gap[k], stiff[k], k
        while at > first and gap[at - 1] > g:
            gap[at], stiff[at] = gap[at - 1], stiff[at - 1]
            at -= 1
        gap[at], stiff[at] = g, s
    sum_ = lever = energy = 0.0
    for k in range(first, end):
        e = gap[k] - mean
        sum_, lever, energy = sum_ + stiff[k], lever + stiff[k] * e, energy + 0.5 * stiff[k] * e * e
        row = bend[to + k - first]
        row[STIFF], row[LEVER], row[ENERGY] = sum_, lever, energy


@njit(cache=True, error_model="numpy")
def _around(share, nodes, at, count, whose, of):
    """Patches to which a foot with these shares in nodes belongs, and how much, from place `at` on; returns how
    many."""
    total = 0.0
    for k in range(at, at + count):
        total += max(0.0, share[k])
    for k in range(at, at + count):
        whose[k], of[k] = nodes[k], max(0.0, share[k]) / total
    return count


@njit(cache=True, error_model="numpy")
def _point(touch, surface, n_own, point, ids, share, at):
    """Nodes, as rows of xw, that a point of a surface follows, and by how much, from place `at` on; of a guest's the
    point itself. Returns how many."""
    n_bodies = len(touch.asleep)
    if surface < n_bodies:
        own = n_own <= surface
        ids[at] = point if own else touch.row[touch.body[surface]] + touch.node[touch.first[surface] + point]
        share[at] = 1.0
        return 1
    place, count = touch.first[surface] + point - touch.first[n_bodies], 0
    for k in range(touch.follow[place], touch.follow[place + 1]):
        ids[at + count], share[at + count] = touch.row[touch.body[surface]] + touch.follows[k], touch.by[k]
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def _foot(touch, patches, one, ints, row, ids, share, at, points):
    """Nodes, as rows of xw, that the foot of a row follows, and by how much, from place `at` on; returns how many.
    points (4,) is scratch."""
    n_bodies, body = len(touch.asleep), touch.body[one]
    if one < n_bodies:
        count = 3
        for k in range(3):
            points[k], share[at + k] = ints[CORNER + k], row[SHARE + k]
        if patches.first_across[body] >= 0:
            count = _to_square(patches, body, touch.first[one + 1] - touch.first[one], points, share, at)
        for k in range(count):
            ids[at + k] = touch.row[body] + touch.node[touch.first[one] + points[k]]
        return count
    end = at
    for corner in range(3):
        place = touch.first[one] + ints[CORNER + corner] - touch.first[n_bodies]
        for k in range(touch.follow[place], touch.follow[place + 1]):
            node, w, found = touch.row[body] + touch.follows[k], touch.by[k] * row[SHARE + corner], False
            for m in range(at, end):
                if ids[m] == node:
                    share[m] += w
                    found = True
            if not found:
                ids[end], share[end] = node, w
                end += 1
    return end - at


@njit(cache=True, error_model="numpy")
def _to_square(patches, body, n_points, foot, share, at):
    """Weights of the corners of a triangle <- those of the square of which it is half, which are bilinear, from place
    `at` of share on; returns how many corners it has."""
    for k in range(3):
        i, j, away = k, (k + 1) % 3, (k + 2) % 3
        other = patches.across[patches.first_across[body] + foot[i] * n_points + foot[j]]
        if other >= 0:
            a, b = share[at + i], share[at + j]
            foot[3] = other
            share[at + i], share[at + j] = a * (1.0 - b), b * (1.0 - a)
            share[at + away], share[at + 3] = (1.0 - a) * (1.0 - b), a * b
            return 4
    return 3
