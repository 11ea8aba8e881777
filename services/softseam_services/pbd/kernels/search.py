"""The search of what touches what in a pile as a step begins, see `touch`.

The nearest triangle is that of a search of all (`nearest_faces`), to the bit, but few are tried. Bodies whose boxes are
apart are left alone. Else, once found, triangles are listed for each point that come into question while points of one
body do not move against those of the other by more than a margin: a search enlarges the reach by this margin, and holds
until

    |m - m_0| + s - s_0 > margin,                                                                                   (1)

m being the way from one body's middle to the other's, and s the sum over all steps of how far points went beside the
middles of their bodies, both as the search was made with the index 0. What is listed changes no result: it need not be
in a snapshot.
"""

import numpy as np

from softseam_coupling.interfaces.contact import REACH
from softseam_coupling.kernels.nearest_face import (
    EVERY,
    LEVEL,
    N_OF_FACE,
    UNIT,
    look_at_surface,
    nearest_listed,
)
from softseam_services.jit import njit

from .asleep import AWAKE, LIES, gives
from .sampled_points import add_for_patches, look_upon, project_on
from .touch import GIVES, MARGIN, N_INTS, NORMAL, RUB, SHARE, SOFT, stand


@njit(cache=True, error_model="numpy")
def find_rows(members, n_own, touch, now, dt):
    """Rows of a step of dt [s] from where bodies are, but of meetings of which both bodies sleep.

    n_own  bodies of the pile: others are guests
    now    which of `forces` the step begins with; the others become those of what takes no part in it

    Returns how many rows there are, and whether `ints` are others than in the last step.
    """
    first, n_guests = touch.first, len(touch.asleep) - n_own
    for own in range(len(touch.body)):
        body = touch.body[own]
        touch.fresh[own] = False
        if first[own] < first[own + 1] and touch.asleep[body] != LIES:
            if own >= n_own + n_guests:
                _follow(members[body], touch, own, first[n_own + n_guests], dt * gives(touch, body))
            elif own < n_own:
                _go_on(members[body], touch, own, dt * gives(touch, body))
            else:
                begin, end = first[own] - first[n_own], first[own + 1] - first[n_own]
                _go(touch, own, touch.guest_at[begin:end], touch.guest_to[begin:end])
            _place(touch, own)
    n, others, halo = 0, False, touch.halo
    for meeting in range(len(touch.pair)):
        a, b = touch.sides[meeting, 0], touch.sides[meeting, 1]
        others = others or touch.start[meeting] != n
        touch.start[meeting] = n
        still = touch.asleep[touch.body[a]] != AWAKE and touch.asleep[touch.body[b]] != AWAKE
        if (touch.carries[0, meeting] or touch.carries[1, meeting]) and not (still and touch.stands[meeting]):
            stand(touch, meeting, now, 1.0 if still else 0.0)
        touch.stands[meeting] = still
        apart = halo[a, 0] > halo[b, 3] or halo[a, 1] > halo[b, 4] or halo[a, 2] > halo[b, 5]
        apart = apart or halo[b, 0] > halo[a, 3] or halo[b, 1] > halo[a, 4] or halo[b, 2] > halo[a, 5]
        if not (still or apart):
            n, found = _meet(touch, meeting, now, n)
            others = others or found
    others = others or touch.start[len(touch.pair)] != n
    touch.start[len(touch.pair)] = n
    return n, others


@njit(cache=True, error_model="numpy")
def _go_on(member, touch, body, dt):
    """Where the points of a body are, and go if all goes on."""
    begin, end = touch.first[body], touch.first[body + 1]
    x, v = member.before.x, member.before.v
    at, to, moved = touch.at[begin:end], touch.to[begin:end], touch.moved
    for i in range(end - begin):
        node = touch.node[begin + i]
        for c in range(3):
            at[i, c] = x[node, c]
            goes = x[node, c] + dt * v[node, c]
            moved[i, c] = goes - to[i, c]
            to[i, c] = goes


@njit(cache=True, error_model="numpy")
def _follow(member, touch, own, base, dt):
    """As `_go_on`, of a surface whose points follow nodes, as they are listed for all points from number base on."""
    begin, end = touch.first[own], touch.first[own + 1]
    x, v = member.before.x, member.before.v
    at, to, moved = touch.at[begin:end], touch.to[begin:end], touch.moved
    for i in range(end - begin):
        px = py = pz = vx = vy = vz = 0.0
        for k in range(touch.follow[begin - base + i], touch.follow[begin - base + i + 1]):
            node, w = touch.follows[k], touch.by[k]
            px, py, pz = px + w * x[node, 0], py + w * x[node, 1], pz + w * x[node, 2]
            vx, vy, vz = vx + w * v[node, 0], vy + w * v[node, 1], vz + w * v[node, 2]
        at[i, 0], at[i, 1], at[i, 2] = px, py, pz
        px, py, pz = px + dt * vx, py + dt * vy, pz + dt * vz
        moved[i, 0], moved[i, 1], moved[i, 2] = px - to[i, 0], py - to[i, 1], pz - to[i, 2]
        to[i, 0], to[i, 1], to[i, 2] = px, py, pz


@njit(cache=True, error_model="numpy")
def _go(touch, body, came, goes):
    """The points of a body come and go (n, 3) [m]."""
    begin = touch.first[body]
    for i in range(len(came)):
        for c in range(3):
            touch.at[begin + i, c] = came[i, c]
            touch.moved[i, c] = goes[i, c] - touch.to[begin + i, c]
            touch.to[begin + i, c] = goes[i, c]


@njit(cache=True, error_model="numpy")
def _place(touch, body):
    """What box the points of a body fill, and how they moved since it was looked at last."""
    begin, end = touch.first[body], touch.first[body + 1]
    middle, box = touch.middle[body], touch.box[body]
    at, to, moved = touch.at[begin:end], touch.to[begin:end], touch.moved
    n = end - begin
    sx = sy = sz = 0.0
    for i in range(n):
        sx, sy, sz = sx + to[i, 0], sy + to[i, 1], sz + to[i, 2]
    sx, sy, sz = sx / n, sy / n, sz / n
    wx, wy, wz = sx - middle[0], sy - middle[1], sz - middle[2]
    farthest = 0.0
    for c in range(3):
        box[c], box[3 + c] = np.inf, -np.inf
    for i in range(n):
        mx, my, mz = moved[i, 0] - wx, moved[i, 1] - wy, moved[i, 2] - wz
        farthest = max(farthest, mx * mx + my * my + mz * mz)
        for c in range(3):
            box[c], box[3 + c] = min(box[c], to[i, c]), max(box[3 + c], to[i, c])
    middle[0], middle[1], middle[2] = sx, sy, sz
    middle[3] += np.sqrt(farthest)
    if not np.isfinite(middle[3]):  # a step diverged
        middle[3] = 0.0
        touch.since[:] = np.nan
    way, halo = touch.way[body], touch.halo[body]
    _find_way(at, to, way)
    # from where they are, two come near by no more than their ways, and look so much farther
    pace = np.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2) + way[3]
    more = 0.5 * REACH * touch.spacing[body] + 2.0 * pace
    for c in range(3):
        halo[c], halo[3 + c] = box[c] - more, box[3 + c] + more


@njit(cache=True, error_model="numpy")
def _find_way(at, to, way):
    """way (4,) <- how far points (n, 3) go from `at` to `to` in the mean, and how far one goes beside that [m]."""
    wx = wy = wz = farthest = 0.0
    for i in range(len(at)):
        wx, wy, wz = wx + to[i, 0] - at[i, 0], wy + to[i, 1] - at[i, 1], wz + to[i, 2] - at[i, 2]
    wx, wy, wz = wx / len(at), wy / len(at), wz / len(at)
    for i in range(len(at)):
        mx, my, mz = to[i, 0] - at[i, 0] - wx, to[i, 1] - at[i, 1] - wy, to[i, 2] - at[i, 2] - wz
        farthest = max(farthest, mx * mx + my * my + mz * mz)
    way[0], way[1], way[2], way[3] = wx, wy, wz, np.sqrt(farthest)


@njit(cache=True, error_model="numpy")
def _meet(touch, meeting, now, n):
    """Rows of the points of two bodies, after n others; returns how many there are then, and whether others than in
    the last step."""
    a, b = touch.sides[meeting, 0], touch.sides[meeting, 1]
    reach = REACH * min(touch.spacing[a], touch.spacing[b])
    square = 0.0
    for c in range(3):
        square += (touch.way[a, c] - touch.way[b, c]) ** 2
    way = touch.way[a, 3] + touch.way[b, 3] + np.sqrt(square)
    fast = not way <= reach  # where they would come to may be beyond
    for c in range(3):
        gap = max(touch.box[a, c] - touch.box[b, 3 + c], touch.box[b, c] - touch.box[a, 3 + c])
        if gap > reach and not fast:
            return n, False
    for body in (a, b):
        if not touch.fresh[body]:
            begin, end = touch.first[body], touch.first[body + 1]
            one, other = touch.first_triangle[body], touch.first_triangle[body + 1]
            look_at_surface(touch.to[begin:end], touch.corners[one:other], touch.faces[one:other], touch.out[begin:end])
            if touch.curved[body]:
                look_upon(touch.upon[begin:end], touch.upon_share[begin:end], touch.out[begin:end])
            touch.fresh[body] = True
    others = False
    if fast:
        for side in range(2):
            _list(touch, meeting, side, touch.at, reach + way)
        touch.since[meeting, :] = np.nan
        for side in range(2):
            n, found = _add_of(touch, meeting, side, now, touch.at, reach + way, reach, n)
            others = others or found
        return n, others
    since, square = touch.since[meeting], 0.0
    for c in range(3):
        square += (touch.middle[a, c] - touch.middle[b, c] - since[c]) ** 2
    margin = MARGIN * min(touch.spacing[a], touch.spacing[b])
    if not np.sqrt(square) + touch.middle[a, 3] + touch.middle[b, 3] - since[3] <= margin * (1.0 - LEVEL):
        for side in range(2):
            _list(touch, meeting, side, touch.to, reach + margin)
        for c in range(3):
            since[c] = touch.middle[a, c] - touch.middle[b, c]
        since[3] = touch.middle[a, 3] + touch.middle[b, 3]
    for side in range(2):
        n, found = _add_of(touch, meeting, side, now, touch.to, reach, reach, n)
        others = others or found
    return n, others


@njit(cache=True, error_model="numpy")
def _list(touch, meeting, side, x, far):
    """Triangles of the other body no farther than `far` [m] from the points of one, both at x, by their boxes."""
    own, other = touch.sides[meeting, side], touch.sides[meeting, 1 - side]
    if touch.presses[meeting, side] == 0.0:
        touch.n_close[meeting, side] = 0
        return
    points, faces = x[touch.first[own] : touch.first[own + 1]], x[touch.first[other] : touch.first[other + 1]]
    corners = touch.corners[touch.first_triangle[other] : touch.first_triangle[other + 1]]
    place = touch.place[meeting, side]
    box, theirs = np.empty(6), np.empty(6)
    _bound(points, far, box)
    _bound(faces, far, theirs)
    some, boxes = np.empty(len(corners), dtype=np.int32), np.empty((len(corners), 6))
    n_some = 0
    for t in range(len(corners)):
        apart = False
        for c in range(3):
            p, q, r = faces[corners[t, 0], c], faces[corners[t, 1], c], faces[corners[t, 2], c]
            boxes[n_some, c], boxes[n_some, 3 + c] = min(p, q, r) - far, max(p, q, r) + far
            apart = apart or min(p, q, r) > box[3 + c] or max(p, q, r) < box[c]
        if not apart:
            some[n_some] = t
            n_some += 1
    n = 0
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        if touch.area[touch.first[own] + i] == 0.0:  # for display
            continue
        if px < theirs[0] or px > theirs[3] or py < theirs[1] or py > theirs[4] or pz < theirs[2] or pz > theirs[5]:
            continue
        count = 0
        for k in range(n_some):
            if px < boxes[k, 0] or px > boxes[k, 3] or py < boxes[k, 1] or py > boxes[k, 4]:
                continue
            if pz < boxes[k, 2] or pz > boxes[k, 5]:
                continue
            if count < touch.listed.shape[1]:
                touch.listed[place + n, count] = some[k]
            count += 1
        if count > 0:
            touch.close[place + n], touch.last[place + n] = i, -1
            touch.counts[place + n] = count if count <= touch.listed.shape[1] else EVERY
            n += 1
    touch.n_close[meeting, side] = n


@njit(cache=True, error_model="numpy")
def _add_of(touch, meeting, side, now, x, far, reach, n):
    """As `_meet`, of the points of one of the bodies, with triangles no farther than `far` [m] where points are at x;
    beside a face by `reach` [m], or behind it by more, a point feels nothing."""
    own, other = touch.sides[meeting, side], touch.sides[meeting, 1 - side]
    begin, end, theirs = touch.first[own], touch.first[own + 1], touch.first[other]
    points, them = x[begin:end], x[theirs : touch.first[other + 1]]
    first, last = touch.first_triangle[other], touch.first_triangle[other + 1]
    corners, faces = touch.corners[first:last], touch.faces[first:last]
    place = touch.place[meeting, side]
    until = place + touch.n_close[meeting, side]
    close, nearest = touch.close[place:until], touch.last[place:until]
    if far > reach:  # faces are as the step begins
        faces = np.empty((len(corners), N_OF_FACE))
        look_at_surface(them, corners, faces, np.empty((len(them), 3)))
    nearest_listed(
        *(points, touch.out[begin:end], close, touch.counts[place:until], touch.listed[place:until], nearest),
        *(them, corners, faces, far, reach, touch.share, touch.beside),
    )
    if touch.visits[meeting] or len(close) == 0:
        return add_for_patches(touch, meeting, side, points, them, faces, far, reach, n)
    mine, their = touch.inverse_mass[begin:end], touch.inverse_mass[theirs : touch.first[other + 1]]
    soft = (touch.yields[own] + touch.yields[other]) / touch.presses[meeting, side]
    rub, others = touch.friction[meeting], False
    own_gives, other_gives = gives(touch, own), gives(touch, other)  # of surfaces by nodes, one a body
    kept = touch.held[meeting, side, 0]
    for i in range(len(close)):
        covered = 1.0 - touch.beside[i] / reach
        if nearest[i] < 0 or not covered > 0.0:
            continue
        point, face = close[i], nearest[i]
        a, b, c = corners[face, 0], corners[face, 1], corners[face, 2]
        s0, s1, s2 = project_on(points, point, them, a, b, c)
        gap = 0.0
        row, ints = touch.rows[n], touch.ints[n]
        for k in range(3):
            unit = faces[face, UNIT + k]
            gap += unit * (points[point, k] - (s0 * them[a, k] + s1 * them[b, k] + s2 * them[c, k]))
            row[NORMAL + k] = unit
        row[SHARE], row[SHARE + 1], row[SHARE + 2] = s0, s1, s2
        node = touch.node[begin + point]
        i0, i1, i2 = touch.node[theirs + a], touch.node[theirs + b], touch.node[theirs + c]
        row[SOFT] = soft / (covered * touch.area[begin + point])
        row[GIVES] = own_gives * mine[point]
        row[GIVES] += other_gives * (s0 * s0 * their[a] + s1 * s1 * their[b] + s2 * s2 * their[c])
        row[RUB] = rub
        force, to = touch.forces[now], kept + point
        touches = gap <= 0.0 or force[to, 0] != 0.0 or force[to, 1] != 0.0 or force[to, 2] != 0.0
        rank = 0 if touches else 1
        first_own, first_other = touch.row[own], touch.row[other]
        nodes = first_own + node, first_other + i0, first_other + i1, first_other + i2
        found = (*nodes, 2 * meeting + side, to, rank)
        for k in range(N_INTS):
            others = others or ints[k] != found[k]
            ints[k] = found[k]
        n += 1
    return n, others


@njit(cache=True, error_model="numpy")
def _bound(points, reach, box):
    """box (6,) <- lower and upper corner of that around points (n, 3), farther out by reach [m]."""
    for c in range(3):
        box[c], box[3 + c] = np.inf, -np.inf
    for i in range(len(points)):
        for c in range(3):
            box[c], box[3 + c] = min(box[c], points[i, c] - reach), max(box[3 + c], points[i, c] + reach)
