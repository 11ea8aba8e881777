"""Contact between bodies of a pile, within each substep: points of either press on faces of the other, and rub.

A point x_p, of half the area A that it stands for, is from the nearest face, that looks towards it, g = n . d away,
d = x_p - sum_i s_i x_i, with the face's corners x_i, the weights s of the nearest place and the normal n there: as they
will be if bodies go on as they do, kept over the step. Its force f = p n + t is solved as that of a point on a tool
with compliance, eq. (3) of `contact`, with 1/r of both bodies (coupling/softseam_coupling/interfaces/contact.py):

    c = h^2 (w_p + sum_i s_i^2 w_i),  alpha = 1/r
    p = max(0, p_old - (g + alpha p_old)/(c + alpha)),  t = t_old - (d' + alpha (t_old - t_0))/(c + alpha)        (1)

cut off to |t| <= mu p, d' being how far d went across n in the substep and t_0 the force as it began: what sticks under
a force that stays does not creep. The point moves by h^2 w_p df, the corners by -h^2 s_i w_i df: no pair of bodies
gains momentum. Forces stay in the nodes' accelerations from one substep to the next, and by points from one step to the
next.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interfaces.contact import REACH
from softseam_coupling.kernels.nearest_face import nearest_faces, point_normals
from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

from .asleep import AWAKE, LIES, is_visited, row_inverse_mass

POINT, CORNER, PLACE, OWN, OTHER = 0, 1, 4, 5, 6
N_INTS = 7
"""of a row: point and three corners, as rows of the pile's xw; place of the point among forces; numbers of its body and
of the other"""
SHARE, NORMAL, SOFT, GIVES, RUB, FORCE, HELD, BEGAN, FACED = 0, 3, 6, 7, 8, 9, 12, 15, 18
N_NUMBERS = 21
"""of a row: s (3,), n (3,), alpha [m/N], c/h^2 [1/kg], mu, f and t_0 (3,) [N], where the point and the place on the
face were as the substep began (3,) [m]"""

DEPTH, LARGEST, WORK, PRESS = 0, 1, 2, 3
N_MET = 6
"""of a meeting in a step: how deep points are inside the other body at its end [m], the largest force on one [N], work
on both bodies [J], and force of the second body on the first at its end (3,) [N]"""


@record
class Touch(NamedTuple):
    """What touches what in a pile: b bodies, p points of their surfaces, t triangles between these, m meetings of two
    bodies, r rows."""

    first: Ints
    """of the points of each body (b + 1,)"""
    node: Ints
    """of each point, in its body (p,)"""
    row: Ints
    """of each body's first node in the pile's xw (b,)"""
    first_triangle: Ints
    """(b + 1,)"""
    corners: Ints
    """of triangles, points of their body, counted from its first (t, 3)"""
    area: Floats
    """that each point stands for (p,) [m^2]"""
    yields: Floats
    """how far the surface of each body sinks in under a pressure (b,) [m/Pa]"""
    spacing: Floats
    """of its points (b,) [m]"""
    pair: Ints
    """bodies that meet (m, 2)"""
    friction: Floats
    """(m,)"""
    place: Ints
    """of the forces on the points of each of the two, among all (m, 2)"""
    at: Floats
    """points as the step begins (p, 3) [m]"""
    to: Floats
    """and as it ends, if all goes on"""
    out: Floats
    """unit vectors out of the surface then (p, 3)"""
    way: Floats
    """of each body, see `_find_way` (b, 4)"""
    start: Ints
    """first row of each meeting (m + 1,)"""
    ints: Ints
    """(r, N_INTS)"""
    rows: Floats
    """(r, N_NUMBERS)"""
    work: Floats
    """of all rows on each body in the step (b,) [J]"""
    turned: Floats
    """angular momentum that they gave each body, about its centre (b, 3) [kg m^2/s]"""
    met: Floats
    """of each meeting, see `N_MET` (m, N_MET)"""
    asleep: Ints
    """see `asleep` (b,)"""
    stands: NDArray[np.bool_]
    """meetings whose forces are the same before and after the step, as both bodies sleep (m,)"""


@njit(cache=True, error_model="numpy")
def find_rows(members, touch, held, kept, dt):
    """Rows of a step of dt [s] from where bodies are, of meetings that are visited.

    held, kept  forces on points between bodies as the step begins (f, 3) [N], and as it ends: so far of those asleep
    """
    first, corners, first_triangle = touch.first, touch.corners, touch.first_triangle
    for body in range(len(first) - 1):
        begin, end = first[body], first[body + 1]
        if begin == end or touch.asleep[body] == LIES:
            continue
        x, v = members[body].before.x, members[body].before.v
        goes_on = dt if touch.asleep[body] == AWAKE else 0.0
        for i in range(begin, end):
            for c in range(3):
                touch.at[i, c] = x[touch.node[i], c]
                touch.to[i, c] = touch.at[i, c] + goes_on * v[touch.node[i], c]
        _find_way(touch.at[begin:end], touch.to[begin:end], touch.way[body])
        own = corners[first_triangle[body] : first_triangle[body + 1]]
        point_normals(touch.to[begin:end], own, touch.out[begin:end])
    n = 0
    for meeting in range(len(touch.pair)):
        touch.start[meeting] = n
        if is_visited(touch, meeting, held, kept):
            n = _find_of(members, touch, meeting, 0, n)
            n = _find_of(members, touch, meeting, 1, n)
    touch.start[len(touch.pair)] = n


@njit(cache=True, error_model="numpy")
def _find_of(members, touch, meeting, side, n):
    """Rows of the points of one of the bodies that meet, after n others; returns how many there are then."""
    own, other = touch.pair[meeting, side], touch.pair[meeting, 1 - side]
    reach = REACH * min(touch.spacing[own], touch.spacing[other])
    begin, end, theirs = touch.first[own], touch.first[own + 1], touch.first[other]
    way = touch.way[own, 3] + touch.way[other, 3]
    square = 0.0
    for c in range(3):
        square += (touch.way[own, c] - touch.way[other, c]) ** 2
    way += np.sqrt(square)
    if way <= reach:
        points, faces, far = touch.to[begin:end], touch.to[theirs : touch.first[other + 1]], reach
    else:  # where they would come to may be beyond
        points, faces, far = touch.at[begin:end], touch.at[theirs : touch.first[other + 1]], reach + way
    low, high, own_low, own_high = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    _bound(faces, far, low, high)
    _bound(points, far, own_low, own_high)
    for c in range(3):
        if low[c] > own_high[c] - far or own_low[c] > high[c] - far:
            return n
    near = np.empty(len(points), dtype=np.int64)
    n_near = 0
    for i in range(len(points)):
        inside = True
        for c in range(3):
            inside = inside and low[c] <= points[i, c] <= high[c]
        if inside:
            near[n_near] = i
            n_near += 1
    all_of = touch.corners[touch.first_triangle[other] : touch.first_triangle[other + 1]]
    some = np.empty((len(all_of), 3), dtype=np.int32)
    n_some = 0
    for t in range(len(all_of)):
        apart = False
        for c in range(3):
            p, q, r = faces[all_of[t, 0], c], faces[all_of[t, 1], c], faces[all_of[t, 2], c]
            apart = apart or min(p, q, r) > own_high[c] or max(p, q, r) < own_low[c]
        if not apart:
            for k in range(3):
                some[n_some, k] = all_of[t, k]
            n_some += 1
    if n_near == 0 or n_some == 0:
        return n
    tried, out = np.empty((n_near, 3)), np.empty((n_near, 3))
    for i in range(n_near):
        for c in range(3):
            tried[i, c], out[i, c] = points[near[i], c], touch.out[begin + near[i], c]
    face, beside = np.empty(n_near, dtype=np.int64), np.empty(n_near)
    share, normal = np.empty((n_near, 3)), np.empty((n_near, 3))
    nearest_faces(tried, out, faces, some[:n_some], far, face, share, beside, normal)
    for i in range(n_near):
        covered = 1.0 - beside[i] / reach
        if face[i] < 0 or covered <= 0.0:
            continue
        point, ints, row = begin + near[i], touch.ints[n], touch.rows[n]
        ints[OWN], ints[OTHER] = own, other
        ints[PLACE] = touch.place[meeting, side] + near[i]
        ints[POINT] = touch.row[own] + touch.node[point]
        gives = row_inverse_mass(members, touch, own, touch.node[point])
        corners = some[face[i]]
        _project(points[near[i]], faces[corners[0]], faces[corners[1]], faces[corners[2]], share[i])
        for k in range(3):
            node = touch.node[theirs + corners[k]]
            ints[CORNER + k] = touch.row[other] + node
            gives += share[i, k] ** 2 * row_inverse_mass(members, touch, other, node)
            row[SHARE + k], row[NORMAL + k] = share[i, k], normal[i, k]
        row[SOFT] = 2.0 * (touch.yields[own] + touch.yields[other]) / (covered * touch.area[point])
        row[GIVES], row[RUB] = gives, touch.friction[meeting]
        n += 1
    return n


@njit(cache=True, error_model="numpy")
def _find_way(at, to, way):
    """way (4,) <- how far points (n, 3) go from `at` to `to` in the mean, and how far one goes beside that [m]."""
    way[:] = 0.0
    for i in range(len(at)):
        for c in range(3):
            way[c] += (to[i, c] - at[i, c]) / len(at)
    for i in range(len(at)):
        square = 0.0
        for c in range(3):
            square += (to[i, c] - at[i, c] - way[c]) ** 2
        way[3] = max(way[3], np.sqrt(square))


@njit(cache=True, error_model="numpy")
def _project(p, a, b, c, share):
    """share (3,) <- weights of a triangle's corners in the foot of p on its plane, which may be outside: there force
    and reaction are on one line."""
    bb = bc = cc = pb = pc = 0.0
    for k in range(3):
        ab, ac, ap = b[k] - a[k], c[k] - a[k], p[k] - a[k]
        bb, bc, cc, pb, pc = bb + ab * ab, bc + ab * ac, cc + ac * ac, pb + ap * ab, pc + ap * ac
    size = bb * cc - bc * bc
    share[1], share[2] = (cc * pb - bc * pc) / size, (bb * pc - bc * pb) / size
    share[0] = 1.0 - share[1] - share[2]


@njit(cache=True, error_model="numpy")
def _bound(points, reach, low, high):
    """low, high (3,) <- corners of the box around points (n, 3), farther out by reach [m]."""
    low[:], high[:] = np.inf, -np.inf
    for i in range(len(points)):
        for c in range(3):
            low[c], high[c] = min(low[c], points[i, c] - reach), max(high[c], points[i, c] + reach)


@njit(cache=True, error_model="numpy")
def find_groups(touch, order, start):
    """Bodies that rows tie, which step together; one that sleeps is in none. Returns how many groups there are.

    order (b,) <- bodies of the first group, of the second ..., ascending in each; start (b + 1,) <- first of each there
    """
    parent = np.arange(len(order))
    tied = np.zeros(len(parent), dtype=np.bool_)
    for meeting in range(len(touch.pair)):
        if touch.start[meeting] == touch.start[meeting + 1]:
            continue
        a, b = touch.pair[meeting, 0], touch.pair[meeting, 1]
        a, b = a if touch.asleep[a] == AWAKE else b, b if touch.asleep[b] == AWAKE else a
        tied[a] = tied[b] = True
        while parent[a] != a:
            a = parent[a]
        while parent[b] != b:
            b = parent[b]
        parent[max(a, b)] = min(a, b)
    n, groups = 0, 0
    for root in range(len(parent)):
        if not tied[root] or parent[root] != root:
            continue
        start[groups] = n
        groups += 1
        for body in range(root, len(parent)):
            top = body
            while parent[top] != top:
                top = parent[top]
            if tied[body] and top == root:
                order[n] = body
                n += 1
    start[groups] = n
    return groups


@njit(cache=True, error_model="numpy")
def begin_rows(touch, meetings, held, cold):
    """An attempt at a step begins: rows carry what they did, or nothing where it is cold."""
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            place = touch.ints[r, PLACE]
            for c in range(3):
                touch.rows[r, FORCE + c] = 0.0 if cold else held[place, c]


@njit(cache=True, error_model="numpy")
def pull_rows(members, touch, meetings):
    """Add the rows' forces to what blocks pull with, see `substep.carried`."""
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            ints, row = touch.ints[r], touch.rows[r]
            own, other = ints[OWN], ints[OTHER]
            mine, theirs = members[own].scratch.pull, members[other].scratch.pull
            for c in range(3):
                mine[ints[POINT] - touch.row[own], c] += row[FORCE + c]
                for k in range(3):
                    theirs[ints[CORNER + k] - touch.row[other], c] -= row[SHARE + k] * row[FORCE + c]


@njit(cache=True, error_model="numpy")
def open_rows(touch, meetings, xw):
    """A substep begins at xw."""
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            ints, row = touch.ints[r], touch.rows[r]
            for c in range(3):
                row[BEGAN + c] = xw[ints[POINT], c]
                row[FACED + c] = _on_face(ints, row, xw, c)
                row[HELD + c] = row[FORCE + c]


@njit(cache=True, error_model="numpy", forceinline=True)
def _on_face(ints, row, xw, c):
    """A coordinate of the place on the face that is nearest to the point [m]."""
    at = row[SHARE] * xw[ints[CORNER], c] + row[SHARE + 1] * xw[ints[CORNER + 1], c]
    return at + row[SHARE + 2] * xw[ints[CORNER + 2], c]


@njit(cache=True, error_model="numpy")
def project_rows(touch, meetings, xw, hh):
    """Solve (1) for the rows of these, one after the other; hh is the substep squared [s^2]. xw is moved."""
    for meeting in meetings:
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            ints, row = touch.ints[r], touch.rows[r]
            if row[GIVES] == 0.0:
                continue
            nx, ny, nz = row[NORMAL], row[NORMAL + 1], row[NORMAL + 2]
            fx, fy, fz = row[FORCE], row[FORCE + 1], row[FORCE + 2]
            dx = xw[ints[POINT], 0] - _on_face(ints, row, xw, 0)
            dy = xw[ints[POINT], 1] - _on_face(ints, row, xw, 1)
            dz = xw[ints[POINT], 2] - _on_face(ints, row, xw, 2)
            soft = row[SOFT]
            stiff = 1.0 / (hh * row[GIVES] + soft)
            old = max(0.0, fx * nx + fy * ny + fz * nz)
            p = max(0.0, old - (dx * nx + dy * ny + dz * nz + soft * old) * stiff)
            tx, ty, tz = 0.0, 0.0, 0.0
            if p > 0.0 and row[RUB] > 0.0:
                sx = dx - row[BEGAN] + row[FACED] + soft * (fx - row[HELD])
                sy = dy - row[BEGAN + 1] + row[FACED + 1] + soft * (fy - row[HELD + 1])
                sz = dz - row[BEGAN + 2] + row[FACED + 2] + soft * (fz - row[HELD + 2])
                tx, ty, tz = fx - sx * stiff, fy - sy * stiff, fz - sz * stiff
                tn = tx * nx + ty * ny + tz * nz
                tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
                size, bound = np.sqrt(tx * tx + ty * ty + tz * tz), row[RUB] * p
                if size > bound:
                    tx, ty, tz = tx * bound / size, ty * bound / size, tz * bound / size
            gx, gy, gz = p * nx + tx - fx, p * ny + ty - fy, p * nz + tz - fz
            row[FORCE], row[FORCE + 1], row[FORCE + 2] = fx + gx, fy + gy, fz + gz
            _move(xw, ints[POINT], hh, gx, gy, gz)
            for k in range(3):
                _move(xw, ints[CORNER + k], -hh * row[SHARE + k], gx, gy, gz)


@njit(cache=True, error_model="numpy", forceinline=True)
def _move(xw, node, factor, x, y, z):
    step = factor * xw[node, 3]
    xw[node, 0] += step * x
    xw[node, 1] += step * y
    xw[node, 2] += step * z


@njit(cache=True, error_model="numpy")
def account_rows(touch, meeting, xw, centre, h):
    """Enter what the rows of a meeting did in a substep of h [s] into `work`, `turned` and `met`.

    centre  of each body as the substep began (b, 3) [m]: of implicit Euler that is where its force as a whole acts

    Both bodies turn by what acts at the point, though the place on the face has slid from there: as much is given as is
    taken, and `turning.give_back` sees to it.
    """
    met = touch.met[meeting]
    met[DEPTH] = met[LARGEST] = 0.0
    for r in range(touch.start[meeting], touch.start[meeting + 1]):
        ints, row = touch.ints[r], touch.rows[r]
        own, other = ints[OWN], ints[OTHER]
        depth, square = 0.0, 0.0
        for c in range(3):
            j, k = (c + 1) % 3, (c + 2) % 3
            f, fj, fk = row[FORCE + c], row[FORCE + j], row[FORCE + k]
            square += f * f
            depth -= row[NORMAL + c] * (xw[ints[POINT], c] - _on_face(ints, row, xw, c))
            mine = f * (xw[ints[POINT], c] - row[BEGAN + c])
            theirs = -f * (_on_face(ints, row, xw, c) - row[FACED + c])
            touch.work[own] += mine
            touch.work[other] += theirs
            met[WORK] += mine + theirs
            at_j, at_k = xw[ints[POINT], j] - centre[own, j], xw[ints[POINT], k] - centre[own, k]
            touch.turned[own, c] += h * (at_j * fk - at_k * fj)
            at_j, at_k = xw[ints[POINT], j] - centre[other, j], xw[ints[POINT], k] - centre[other, k]
            touch.turned[other, c] -= h * (at_j * fk - at_k * fj)
        met[DEPTH], met[LARGEST] = max(met[DEPTH], depth), max(met[LARGEST], np.sqrt(square))


@njit(cache=True, error_model="numpy")
def keep_rows(touch, meeting, kept):
    """kept (f, 3) [N] <- forces on points, as the rows of a meeting have them; `met` <- what they press in all."""
    met = touch.met[meeting]
    for r in range(touch.start[meeting], touch.start[meeting + 1]):
        sign = 1.0 if touch.ints[r, OWN] == touch.pair[meeting, 0] else -1.0
        for c in range(3):
            kept[touch.ints[r, PLACE], c] = touch.rows[r, FORCE + c]
            met[PRESS + c] += sign * touch.rows[r, FORCE + c]
