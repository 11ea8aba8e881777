"""Contact of a pile by patches of surface, see `gather`: with guests, and of bodies whose surfaces are unlike.

A patch is a row of one force f on the body with the nodes that it is around, and -f on the other, of which each is of
the pile, and follows by nodes, or a guest. It is solved as a point of `between` is, but for its law of pressure, eq.
(2) of `gather`, which bends.

Points of curved surfaces that go otherwise than their patch are not seen before the next step begins: as bodies come
near, patches press with more than their points will, as they part with less. So what a contact stores changes between
steps without work, and might be more than it has taken. That is counted, T, and no step begins with more:

    sum_i Psi_i = sum_i sum_q k_q/2 max(0, -e_q - n_i . d_i)^2 <= T,   T' = T - work along the normals            (1)

Where it would, only a share of the force counts that the last step did not end with, by an offset of all points of the
patch: bodies come nearer by that, which T takes. What patches lost unseen is kept up to `_KEPT` times what they store:
without a bound a ball that rolls would save it for a knock.
"""

import numpy as np

from softseam_services.jit import njit

from .between import DEPTH, IMPULSE, LARGEST, WORK
from .gather import (
    BEND,
    BODY,
    END,
    ENERGY,
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

_KEPT = 2.0
"""see above [1]"""


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
    """The first substep begins at xw: where surfaces are curved with what was held, and of what is new with as much as
    eq. (1) allows."""
    for meeting in meetings:
        if not (touch.curved[touch.sides[meeting, 0]] or touch.curved[touch.sides[meeting, 1]]):
            continue
        least = most = 0.0
        taken = held[touch.held[meeting, touch.around[meeting], 1] - 1, 0]
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            away, force, old = _begins_with(patches, r, held, xw, guests)
            last = patches.ints[r, BEND] + patches.ints[r, PRESSED] - 1
            stored = _stored(patches, last, away) if force > 0.0 else 0.0
            most += stored
            if force > old:
                offset, last = _offset(patches, patches.ints[r], old, away)
                stored = _stored(patches, last, away + offset) if old > 0.0 else 0.0
            least += stored
        counts = 1.0 if most <= taken else max(0.0, (taken - least) / (most - least))
        patches.taken[meeting] = min(taken, _KEPT * most)
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            patches.rows[r, OFFSET] = 0.0
            if counts < 1.0:
                away, force, old = _begins_with(patches, r, held, xw, guests)
                if force > old:
                    patches.rows[r, OFFSET], _ = _offset(patches, patches.ints[r], old + counts * (force - old), away)


@njit(cache=True, error_model="numpy")
def _begins_with(patches, r, held, xw, guests):
    """How far a patch is from the other body [m], the force that it would begin with, and the one that was held [N]."""
    ints, row = patches.ints[r], patches.rows[r]
    x, y, z = way_between(patches, ints, xw, guests)
    away, old = row[NORMAL] * x + row[NORMAL + 1] * y + row[NORMAL + 2] * z, 0.0
    for c in range(3):
        old += row[NORMAL + c] * held[ints[PLACE], c]
    return away, press(patches, ints, away, 0.0), max(0.0, old)


@njit(cache=True, error_model="numpy")
def _offset(patches, ints, force, away):
    """What is to be added to all e_q for a patch to press with this force [m], and the last point that is inside
    then."""
    to, last = -np.inf, ints[BEND]
    for k in range(ints[BEND], ints[LAST_BEND]):
        found = -(force + patches.bend[k, LEVER]) / patches.bend[k, STIFF]
        if found > to:
            to, last = found, k
    return to - away, last


@njit(cache=True, error_model="numpy", forceinline=True)
def _stored(patches, k, away):
    """Psi of a patch [J] of which the points up to number k are inside."""
    bend = patches.bend[k]
    return bend[ENERGY] + bend[LEVER] * away + 0.5 * bend[STIFF] * away**2


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
        depth = square = pressed = went = 0.0
        for c in range(3):
            at[c] = place_of(patches, ints, xw, guests, c)
            theirs = place_on_other(patches, ints, xw, guests, c)
            f = row[FORCE + c]
            square += f * f
            met[IMPULSE + c] += h * f if ints[BODY] == touch.pair[meeting, 0] else -h * f
            depth -= row[NORMAL + c] * (at[c] - theirs)
            pressed += row[NORMAL + c] * f
            went += row[NORMAL + c] * (at[c] - theirs - patches.began[r, 0, c] + patches.began[r, 1, c])
            mine, other = f * (at[c] - patches.began[r, 0, c]), -f * (theirs - patches.began[r, 1, c])
            books.work[ints[BODY]] += mine
            books.work[ints[OTHER]] += other
            met[WORK] += mine + other
        patches.taken[meeting] -= pressed * went
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
def keep_patches(touch, patches, meeting, kept):
    """kept (f, 3) [N] <- forces, as the patches of a meeting have them, and after those what it has taken [J]."""
    if not touch.visits[meeting]:
        return
    presses = False
    for r in range(patches.start[meeting], patches.start[meeting + 1]):
        for c in range(3):
            kept[patches.ints[r, PLACE], c] = patches.rows[r, FORCE + c]
            presses = presses or patches.rows[r, FORCE + c] != 0.0
    last = touch.held[meeting, touch.around[meeting], 1] - 1
    kept[last, 0] = max(0.0, patches.taken[meeting]) if presses else 0.0
