"""Contact of a pile with guests: a patch of surface around each node of the coarser of the two, with one force.

Points that press on faces, see `between`, are closer than what they press on: alone each would ask for a force of its
own, which neither body can tell from its neighbours'. So points q of area a_q at feet on faces are gathered by the
weights t_qi of the nodes i around them, of faces that have so few (a mortar with lumped multipliers):

    A_i = sum_q a_q t_qi,   w_qi = a_q t_qi/A_i,   d_i = sum_q w_qi d_q,   n_i ~ sum_q w_qi n_q                   (1)

and d_i is solved as one point of area A_i. Its force goes back by the same weights, to points on one side and to their
feet on the other: along one line, so that no angular momentum is made.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

from .asleep import gives
from .between import DEPTH, IMPULSE, LARGEST, WORK
from .touch import CORNER, POINT, SHARE, SIDE
from .touch import NORMAL as FACING
from .touch import SOFT as SOFTNESS

BODY, FIRST, END, PLACE, SLOT, GUEST, GUEST_SLOT = range(7)
N_INTS = 7
"""of a patch: one body; of the pile: first and end of its nodes; place among forces; of a guest: its slot, else -1; the
other body, a guest, counted among these, and its slot"""
NORMAL, SOFT, GIVES, RUB, FORCE, HELD, YIELDS, SLIDES = 0, 3, 4, 5, 6, 9, 12, 13
N_NUMBERS = 14
"""n (3,) from the guest to the other, alpha [m/N], c/h^2 [1/kg], mu, f on the other and t_0 (3,) [N], and what guests
add to c along n and across it, see `guests` [m/N]"""


@record
class Patches(NamedTuple):
    """Those of all meetings with guests, in a step."""

    start: Ints
    """first of each meeting (m + 1,)"""
    ints: Ints
    """(r, N_INTS)"""
    rows: Floats
    """(r, N_NUMBERS)"""
    began: Floats
    """places on either body as the substep began (r, 2, 3) [m]"""
    node: Ints
    """rows of the pile's xw, patch by patch"""
    weight: Floats
    """and their weights [1]"""
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
    """of each body of the pile, -1 of those that meet no guest (b,)"""


@njit(cache=True, error_model="numpy")
def gather_patches(touch, patches, n_own, target, part):
    """Patches of the points and faces that rows of `touch` have. Returns how many entries of `slot` they have.

    target, part  points of each guest's point, and shares in them, by which it is gathered where two guests meet (q, 4)
    """
    n = n_nodes = n_entries = 0
    patches.n_slots[:] = 0
    for meeting in range(len(touch.pair)):
        patches.start[meeting] = n
        begin, end = touch.start[meeting], touch.start[meeting + 1]
        first = touch.pair[meeting, 0]
        if begin == end or not touch.visits[meeting]:
            continue
        side = 1 if first >= n_own else 0  # of the one that patches press on, of the pile where one is
        one, guest = touch.pair[meeting, side], touch.pair[meeting, 1 - side]
        n_one = touch.first[one + 1] - touch.first[one]
        n_guest = touch.first[guest + 1] - touch.first[guest]
        of_one, of_guest = np.zeros((n_one, n_one)), np.zeros((n_one, n_guest))
        area, normal = np.zeros(n_one), np.zeros((n_one, 3))
        yields = touch.yields[one] + touch.yields[guest]
        rub = touch.friction[meeting]
        for r in range(begin, end):
            _gather(touch, patches, r, one, n_own, target, part, yields, area, normal, of_one, of_guest)
        for i in range(n_one):
            if area[i] == 0.0:
                continue
            ints, row = patches.ints[n], patches.rows[n]
            length = np.sqrt(normal[i, 0] ** 2 + normal[i, 1] ** 2 + normal[i, 2] ** 2)
            if length == 0.0:
                continue
            for c in range(3):
                row[NORMAL + c] = normal[i, c] / length
            row[SOFT], row[GIVES], row[RUB] = yields / area[i], 0.0, rub
            ints[BODY], ints[GUEST], ints[PLACE] = one, guest - n_own, touch.place[meeting, side] + i
            ints[FIRST], ints[SLOT] = n_nodes, -1
            for j in range(n_one):
                w = of_one[i, j] / area[i]
                if w == 0.0:
                    continue
                point = touch.first[one] + j
                if one < n_own:
                    patches.node[n_nodes], patches.weight[n_nodes] = touch.row[one] + touch.node[point], w
                    row[GIVES] += gives(touch, one) * w * w * touch.inverse_mass[point]
                    n_nodes += 1
                else:
                    n_entries = _enter(patches, n_entries, one - n_own, j, w)
            ints[END] = n_nodes
            if one >= n_own:
                ints[SLOT] = patches.n_slots[one - n_own]
                patches.n_slots[one - n_own] += 1
            for j in range(n_guest):
                w = of_guest[i, j] / area[i]
                if w != 0.0:
                    n_entries = _enter(patches, n_entries, guest - n_own, j, w)
            ints[GUEST_SLOT] = patches.n_slots[guest - n_own]
            patches.n_slots[guest - n_own] += 1
            n += 1
    patches.start[len(touch.pair)] = n
    return n_entries


@njit(cache=True, error_model="numpy")
def _enter(patches, entry, guest, point, weight):
    patches.slot[entry, 0], patches.slot[entry, 1], patches.slot[entry, 2] = guest, patches.n_slots[guest], point
    patches.share[entry] = weight
    return entry + 1


@njit(cache=True, error_model="numpy")
def _gather(touch, patches, r, one, n_own, target, part, yields, area, normal, of_one, of_guest):
    """Add a point and its foot to the patches that it belongs to, of whose two bodies `one` has the nodes."""
    ints, row = touch.ints[r], touch.rows[r]
    own, point = touch.pair[ints[SIDE] // 2, ints[SIDE] % 2], touch.number[ints[POINT]]
    a, sign = yields / row[SOFTNESS], 1.0 if own == one else -1.0
    foot, share = np.empty(4, dtype=np.int32), np.zeros(4)
    for k in range(3):
        foot[k], share[k] = touch.number[ints[CORNER + k]], row[SHARE + k]
    foot[3] = foot[0]
    if own != one and one < n_own:
        _to_square(patches, one, touch.first[one + 1] - touch.first[one], foot, share)
    to, of = np.empty(4, dtype=np.int32), np.zeros(4)
    if own != one:
        to[:], of[:] = foot, share
    else:  # two guests
        q = touch.first[own] - touch.first[n_own] + point
        to[:], of[:] = target[q], part[q]
    for k in range(4):
        if of[k] <= 0.0:
            continue
        i, t = to[k], a * of[k]
        area[i] += t
        for c in range(3):
            normal[i, c] += t * sign * row[FACING + c]
        if own == one:
            of_one[i, point] += t
        else:
            of_guest[i, point] += t
        for m in range(4):
            if share[m] != 0.0:
                if own == one:
                    of_guest[i, foot[m]] += t * share[m]
                else:
                    of_one[i, foot[m]] += t * share[m]


@njit(cache=True, error_model="numpy")
def _to_square(patches, body, n_points, foot, share):
    """Weights of the corners of a triangle <- those of the square of which it is half, which are bilinear."""
    if patches.first_across[body] < 0:
        return
    for k in range(3):
        i, j, away = k, (k + 1) % 3, (k + 2) % 3
        other = patches.across[patches.first_across[body] + foot[i] * n_points + foot[j]]
        if other >= 0:
            a, b = share[i], share[j]
            foot[3] = other
            share[i], share[j], share[away], share[3] = a * (1.0 - b), b * (1.0 - a), (1.0 - a) * (1.0 - b), a * b
            return


@njit(cache=True, error_model="numpy", forceinline=True)
def place_of(patches, ints, xw, guests, c):
    """A coordinate of the patch's place on the body that is not the last guest [m]."""
    if ints[SLOT] >= 0:
        return guests.at[guests.first_slot[ints[BODY] - guests.n_own[0]] + ints[SLOT], c]
    found = 0.0
    for k in range(ints[FIRST], ints[END]):
        found += patches.weight[k] * xw[patches.node[k], c]
    return found


@njit(cache=True, error_model="numpy", forceinline=True)
def place_on_guest(ints, guests, c):
    """A coordinate of its place on that one [m]."""
    return guests.at[guests.first_slot[ints[GUEST]] + ints[GUEST_SLOT], c]


@njit(cache=True, error_model="numpy")
def begin_patches(patches, meetings, held, cold):
    """An attempt at a step begins: patches carry what they did, or nothing where it is cold."""
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            for c in range(3):
                patches.rows[r, FORCE + c] = 0.0 if cold else held[patches.ints[r, PLACE], c]


@njit(cache=True, error_model="numpy")
def pull_patches(members, touch, patches, meetings):
    """Add their forces to what blocks pull with, see `substep.carried`."""
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            if ints[SLOT] >= 0:
                continue
            pull, first = members[ints[BODY]].scratch.pull, touch.row[ints[BODY]]
            for k in range(ints[FIRST], ints[END]):
                for c in range(3):
                    pull[patches.node[k] - first, c] += patches.weight[k] * row[FORCE + c]


@njit(cache=True, error_model="numpy")
def open_patches(patches, meetings, xw, guests):
    """A substep begins at xw."""
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            for c in range(3):
                patches.began[r, 0, c] = place_of(patches, ints, xw, guests, c)
                patches.began[r, 1, c] = place_on_guest(ints, guests, c)
                row[HELD + c] = row[FORCE + c]


@njit(cache=True, error_model="numpy")
def account_patches(touch, books, patches, meeting, xw, guests, h, n_substeps):
    """Enter what the patches of a meeting did in a substep of h [s] into the books, and `moment` of guests, see
    `between.account_rows`."""
    met, centre = books.met[meeting], books.centre
    if patches.start[meeting] == patches.start[meeting + 1]:
        return
    met[DEPTH] = met[LARGEST] = 0.0
    at = np.empty(3)
    for r in range(patches.start[meeting], patches.start[meeting + 1]):
        ints, row = patches.ints[r], patches.rows[r]
        depth, square = 0.0, 0.0
        for c in range(3):
            at[c] = place_of(patches, ints, xw, guests, c)
            theirs = place_on_guest(ints, guests, c)
            f = row[FORCE + c]
            square += f * f
            met[IMPULSE + c] += h * f if ints[BODY] == touch.pair[meeting, 0] else -h * f
            depth -= row[NORMAL + c] * (at[c] - theirs)
            mine, other = f * (at[c] - patches.began[r, 0, c]), -f * (theirs - patches.began[r, 1, c])
            books.work[ints[BODY]] += mine
            books.work[guests.n_own[0] + ints[GUEST]] += other
            met[WORK] += mine + other
        for c in range(3):
            j, k = (c + 1) % 3, (c + 2) % 3
            turned = at[j] * row[FORCE + k] - at[k] * row[FORCE + j]
            guests.moment[ints[GUEST], c] -= turned / n_substeps
            if ints[SLOT] >= 0:
                guests.moment[ints[BODY] - guests.n_own[0], c] += turned / n_substeps
            else:
                j_arm, k_arm = at[j] - centre[ints[BODY], j], at[k] - centre[ints[BODY], k]
                books.turned[ints[BODY], c] += h * (j_arm * row[FORCE + k] - k_arm * row[FORCE + j])
        met[DEPTH], met[LARGEST] = max(met[DEPTH], depth), max(met[LARGEST], np.sqrt(square))


@njit(cache=True, error_model="numpy")
def keep_patches(patches, meeting, kept):
    """kept (f, 3) [N] <- forces, as the patches of a meeting have them."""
    for r in range(patches.start[meeting], patches.start[meeting + 1]):
        for c in range(3):
            kept[patches.ints[r, PLACE], c] = patches.rows[r, FORCE + c]
