"""Contact of a pile by patches of surface, see `gather`: with guests, and of bodies whose surfaces are unlike.

A patch is a row of one force f on the body with the nodes that it is around, and -f on the other, of which each is of
the pile, and follows by nodes, or a guest. It is solved as a point of `between` is, but for its law of pressure, eq.
(2) of `gather`, which bends.

Points of curved surfaces that go otherwise than their patch come to be inside unseen, and press as the next step begins
with more than they have taken work for: where a step begins with more force than the last one ended with, only a share
of what is new counts, by an offset of all points of the patch.
"""

import numpy as np

from softseam_services.jit import njit

from .between import DEPTH, IMPULSE, LARGEST, WORK
from .gather import (
    BEND,
    BODY,
    END,
    FIRST,
    FORCE,
    GUEST,
    GUEST_SLOT,
    HELD,
    LAST_BEND,
    LEVER,
    MIDDLE,
    NORMAL,
    OFFSET,
    OTHER,
    PLACE,
    PRESSED,
    SLOT,
    STIFF,
)

_NEW = 0.1
"""share of a force that was not there before which counts in a step [1]"""


@njit(cache=True, error_model="numpy", forceinline=True)
def place_of(patches, ints, xw, guests, c):
    """A coordinate of the patch's place on the body that it is around [m]."""
    if ints[SLOT] >= 0:
        return guests.at[guests.first_slot[ints[BODY] - guests.n_own[0]] + ints[SLOT], c]
    found = 0.0
    for k in range(ints[FIRST], ints[MIDDLE]):
        found += patches.weight[k] * xw[patches.node[k], c]
    return found


@njit(cache=True, error_model="numpy", forceinline=True)
def place_on_other(patches, ints, xw, guests, c):
    """A coordinate of its place on the other one [m]."""
    if ints[GUEST] >= 0:
        return guests.at[guests.first_slot[ints[GUEST]] + ints[GUEST_SLOT], c]
    found = 0.0
    for k in range(ints[MIDDLE], ints[END]):
        found -= patches.weight[k] * xw[patches.node[k], c]
    return found


@njit(cache=True, error_model="numpy", forceinline=True)
def way_between(patches, ints, xw, guests):
    """The way from its place on the other body to that on the one that it is around (3,) [m]."""
    x = y = z = 0.0
    for k in range(ints[FIRST], ints[END]):
        w, node = patches.weight[k], patches.node[k]
        x, y, z = x + w * xw[node, 0], y + w * xw[node, 1], z + w * xw[node, 2]
    if ints[SLOT] >= 0:
        at = guests.at[guests.first_slot[ints[BODY] - guests.n_own[0]] + ints[SLOT]]
        x, y, z = x + at[0], y + at[1], z + at[2]
    if ints[GUEST] >= 0:
        at = guests.at[guests.first_slot[ints[GUEST]] + ints[GUEST_SLOT]]
        x, y, z = x - at[0], y - at[1], z - at[2]
    return x, y, z


@njit(cache=True, error_model="numpy")
def press(patches, ints, away, gives):
    """Eq. (2) of `gather`, of one patch: its force along n [N], where without any it would be `away` from the other
    [m], and nearer by gives [m/N] times that.

    It is the largest of those that the nearest one, two ... points would have alone, and grows with their number up to
    there: no point is inside that makes it less.
    """
    first, end = ints[BEND], ints[LAST_BEND]
    k = first + ints[PRESSED] - 1
    best = _press_with(patches, k, away, gives)
    while k + 1 < end:
        more = _press_with(patches, k + 1, away, gives)
        if more <= best:
            break
        k, best = k + 1, more
    while k > first:
        less = _press_with(patches, k - 1, away, gives)
        if less < best:
            break
        k, best = k - 1, less
    ints[PRESSED] = k + 1 - first
    return max(0.0, best)


@njit(cache=True, error_model="numpy", forceinline=True)
def _press_with(patches, k, away, gives):
    stiff = patches.bend[k, STIFF]
    return -(patches.bend[k, LEVER] + stiff * away) / (1.0 + stiff * gives)


@njit(cache=True, error_model="numpy")
def begin_patches(patches, meetings, held, cold):
    """An attempt at a step begins: patches carry what they did, or nothing where it is cold."""
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            for c in range(3):
                patches.rows[r, FORCE + c] = 0.0 if cold else held[patches.ints[r, PLACE], c]


@njit(cache=True, error_model="numpy")
def settle_patches(touch, patches, meetings, held, xw, guests):
    """The first substep begins at xw: where surfaces are curved with no more than what was held, and a share of what is
    new."""
    for meeting in meetings:
        curved = touch.curved[touch.sides[meeting, 0]] or touch.curved[touch.sides[meeting, 1]]
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            row[OFFSET] = 0.0
            if not curved:
                continue
            x, y, z = way_between(patches, ints, xw, guests)
            away, old = row[NORMAL] * x + row[NORMAL + 1] * y + row[NORMAL + 2] * z, 0.0
            for c in range(3):
                old += row[NORMAL + c] * held[ints[PLACE], c]
            force, old = press(patches, ints, away, 0.0), max(0.0, old)
            if force > old:
                want, to = old + _NEW * (force - old), -np.inf
                for k in range(ints[BEND], ints[LAST_BEND]):
                    to = max(to, -(want + patches.bend[k, LEVER]) / patches.bend[k, STIFF])
                row[OFFSET] = to - away


@njit(cache=True, error_model="numpy")
def pull_patches(members, touch, patches, meetings):
    """Add their forces to what blocks pull with, see `substep.carried`."""
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            if ints[SLOT] >= 0:
                continue
            _pull(members[ints[BODY]].scratch.pull, touch.row[ints[BODY]], patches, ints[FIRST], ints[MIDDLE], row)
            if ints[GUEST] < 0:
                _pull(members[ints[OTHER]].scratch.pull, touch.row[ints[OTHER]], patches, ints[MIDDLE], ints[END], row)


@njit(cache=True, error_model="numpy", forceinline=True)
def _pull(pull, row, patches, first, end, numbers):
    for k in range(first, end):
        for c in range(3):
            pull[patches.node[k] - row, c] += patches.weight[k] * numbers[FORCE + c]


@njit(cache=True, error_model="numpy")
def open_patches(patches, meetings, xw, guests):
    """A substep begins at xw."""
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            ints, row = patches.ints[r], patches.rows[r]
            for c in range(3):
                patches.began[r, 0, c] = place_of(patches, ints, xw, guests, c)
                patches.began[r, 1, c] = place_on_other(patches, ints, xw, guests, c)
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
            theirs = place_on_other(patches, ints, xw, guests, c)
            f = row[FORCE + c]
            square += f * f
            met[IMPULSE + c] += h * f if ints[BODY] == touch.pair[meeting, 0] else -h * f
            depth -= row[NORMAL + c] * (at[c] - theirs)
            mine, other = f * (at[c] - patches.began[r, 0, c]), -f * (theirs - patches.began[r, 1, c])
            books.work[ints[BODY]] += mine
            books.work[ints[OTHER]] += other
            met[WORK] += mine + other
        for c in range(3):
            j, k = (c + 1) % 3, (c + 2) % 3
            f, g = row[FORCE + k], row[FORCE + j]
            turned = (at[j] * f - at[k] * g) / n_substeps
            if ints[SLOT] >= 0:
                guests.moment[ints[BODY] - guests.n_own[0], c] += turned
            else:
                arms = at[j] - centre[ints[BODY], j], at[k] - centre[ints[BODY], k]
                books.turned[ints[BODY], c] += h * (arms[0] * f - arms[1] * g)
            if ints[GUEST] >= 0:
                guests.moment[ints[GUEST], c] -= turned
            else:
                arms = at[j] - centre[ints[OTHER], j], at[k] - centre[ints[OTHER], k]
                books.turned[ints[OTHER], c] -= h * (arms[0] * f - arms[1] * g)
        met[DEPTH], met[LARGEST] = max(met[DEPTH], depth), max(met[LARGEST], np.sqrt(square))


@njit(cache=True, error_model="numpy")
def keep_patches(patches, meeting, kept):
    """kept (f, 3) [N] <- forces, as the patches of a meeting have them."""
    for r in range(patches.start[meeting], patches.start[meeting + 1]):
        for c in range(3):
            kept[patches.ints[r, PLACE], c] = patches.rows[r, FORCE + c]
