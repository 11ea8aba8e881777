"""Contact of a pile by patches of surface, see `gather`: with guests, and of bodies whose surfaces are unlike.

A patch is a row of one force f on the body with the nodes that it is around, and -f on the other, of which each is of
the pile, and follows by nodes, or a guest. It is solved as a point of `between` is, but for its law of pressure, eq.
(2) of `gather`, which bends.

Points of curved surfaces that go otherwise than their patch are not seen before the next step begins: as bodies come
near, patches press with more than their points will, as they part with less. So what a contact stores changes between
steps without work, and might be more than it has taken, T, and no step begins with more:

    sum_i Psi_i = sum_i sum_q k_q/2 max(0, -e_q - n_i . d_i)^2 <= T,   T' = T - its work, along normals and across  (1)

Where it would, only a share of the force counts that the last step did not end with, by an offset of all points of the
patch: bodies come nearer by that, which T takes. So a contact gives no more than it has taken in all; of what rubbing
takes some may come back. Without that bodies which fell over one another stayed deep in each other for good (dumplings
by 2 of 33 mm). What patches lost unseen is kept up to `_KEPT` times what they store: without a bound a ball that rolls
would save it for a knock.
"""

import numpy as np

from softseam_coupling.kernels.nearest_face import LEVEL
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
    NEAREST,
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
def _of_nodes(patches, first, end, x):
    """Sums of weights and places x of nodes."""
    px = py = pz = 0.0
    for k in range(first, end):
        w, node = patches.weight[k], patches.node[k]
        px, py, pz = px + w * x[node, 0], py + w * x[node, 1], pz + w * x[node, 2]
    return px, py, pz


@njit(cache=True, error_model="numpy")
def places_of(patches, ints, x, guests):
    """Where a patch is on the body that it is around, and on the other one (3,) [m], with the pile's nodes at x."""
    one, other = _of_nodes(patches, ints[FIRST], ints[MIDDLE], x), _of_nodes(patches, ints[MIDDLE], ints[END], x)
    if ints[SLOT] >= 0:
        at = guests.at[guests.first_slot[ints[BODY] - guests.n_own[0]] + ints[SLOT]]
        one = at[0], at[1], at[2]
    if ints[GUEST] >= 0:
        at = guests.at[guests.first_slot[ints[GUEST]] + ints[GUEST_SLOT]]
        return one, (at[0], at[1], at[2])
    return one, (-other[0], -other[1], -other[2])


@njit(cache=True, error_model="numpy")
def know_begin(patches, r, guests):
    """The places of a patch as the substep began, of one that has no guest, or as it begins."""
    one, other = places_of(patches, patches.ints[r], patches.begun, guests)
    for c in range(3):
        patches.began[r, 0, c], patches.began[r, 1, c] = one[c], other[c]
    patches.known[r] = True


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
            patches.known[r] = False
            for c in range(3):
                patches.rows[r, FORCE + c] = 0.0 if cold else held[patches.ints[r, PLACE], c]
                patches.rows[r, HELD + c] = patches.rows[r, FORCE + c]


@njit(cache=True, error_model="numpy")
def clear_patches(members, touch, patches, meetings, xw, guests):
    """The first substep begins at xw, and patches are settled: find which may press only when nodes have gone."""
    for meeting in meetings:
        if patches.start[meeting] == patches.start[meeting + 1]:
            continue
        for side in range(2):
            body = touch.pair[meeting, side]
            patches.moved[body] = 0.0
            if body < guests.n_own[0]:
                first = touch.row[body]
                for node in range(first, first + len(members[body].parameters.mass)):
                    for c in range(3):
                        patches.since[node, c] = patches.begun[node, c] = xw[node, c]
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            patches.clear[r] = _how_clear(patches, patches.ints[r], patches.rows[r], xw, guests)


@njit(cache=True, error_model="numpy")
def _how_clear(patches, ints, row, xw, guests):
    """See `Patches.clear`: places go by no more than nodes, times the sum of their weights."""
    still = row[OFFSET] == 0.0 and row[FORCE] == 0.0 and row[FORCE + 1] == 0.0 and row[FORCE + 2] == 0.0
    if ints[SLOT] >= 0 or ints[GUEST] >= 0 or not still:
        return -np.inf
    mine = theirs = 0.0
    for k in range(ints[FIRST], ints[END]):
        if k < ints[MIDDLE]:
            mine += abs(patches.weight[k])
        else:
            theirs += abs(patches.weight[k])
    x, y, z = way_between(patches, ints, xw, guests)
    away = row[NORMAL] * x + row[NORMAL + 1] * y + row[NORMAL + 2] * z
    gap = away + patches.bend[ints[BEND], LEVER] / patches.bend[ints[BEND], STIFF]
    return (1.0 - LEVEL) * gap / max(mine, theirs) if gap > 0.0 else -np.inf


@njit(cache=True, error_model="numpy")
def look_how_far(members, touch, patches, bodies, xw):
    """patches.moved <- of these."""
    since = patches.since
    for body in bodies:
        farthest, first = 0.0, touch.row[body]
        for node in range(first, first + len(members[body].parameters.mass)):
            x, y, z = xw[node, 0] - since[node, 0], xw[node, 1] - since[node, 1], xw[node, 2] - since[node, 2]
            farthest = max(farthest, x * x + y * y + z * z)
        patches.moved[body] = np.sqrt(farthest) if np.isfinite(farthest) else np.inf


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
def open_patches(members, touch, patches, meetings, bodies, xw, guests):
    """A substep begins at xw."""
    if not any_patches(patches, meetings):
        return
    for body in bodies:
        first = touch.row[body]
        for node in range(first, first + len(members[body].parameters.mass)):
            for c in range(3):
                patches.begun[node, c] = xw[node, c]
    for meeting in meetings:
        for r in range(patches.start[meeting], patches.start[meeting + 1]):
            if patches.clear[r] > -np.inf:
                continue
            ints, row = patches.ints[r], patches.rows[r]
            if ints[SLOT] >= 0 or ints[GUEST] >= 0:
                know_begin(patches, r, guests)
            for c in range(3):
                row[HELD + c] = row[FORCE + c]


@njit(cache=True, error_model="numpy")
def any_patches(patches, meetings):
    """Whether there are."""
    for meeting in meetings:
        if patches.start[meeting] < patches.start[meeting + 1]:
            return True
    return False


@njit(cache=True, error_model="numpy")
def account_patches(touch, books, patches, meeting, xw, guests, h, n_substeps):
    """Enter what the patches of a meeting did in a substep of h [s] into the books, and `moment` of guests, see
    `between.account_rows`."""
    met, centre = books.met[meeting], books.centre
    if patches.start[meeting] == patches.start[meeting + 1]:
        return
    met[DEPTH] = met[LARGEST] = 0.0
    for r in range(patches.start[meeting], patches.start[meeting + 1]):
        if patches.clear[r] > -np.inf:
            continue
        ints, row = patches.ints[r], patches.rows[r]
        if not patches.known[r]:
            know_begin(patches, r, guests)
        began = patches.began[r]
        at, theirs = places_of(patches, ints, xw, guests)
        square = work = 0.0
        depth = -row[NEAREST]
        for c in range(3):
            f = row[FORCE + c]
            square += f * f
            met[IMPULSE + c] += h * f if ints[BODY] == touch.pair[meeting, 0] else -h * f
            depth -= row[NORMAL + c] * (at[c] - theirs[c])
            mine, other = f * (at[c] - began[0, c]), -f * (theirs[c] - began[1, c])
            books.work[ints[BODY]] += mine
            books.work[ints[OTHER]] += other
            work += mine + other
        for c in range(3):  # the next substep begins there
            began[0, c], began[1, c] = at[c], theirs[c]
        met[WORK] += work
        patches.taken[meeting] -= work
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
