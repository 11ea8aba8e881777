"""Contact of surface points with rigid tools at position level: exact non-penetration, Coulomb friction that sticks.

Each pair (point, tool) carries its force as blocks carry their stress: a normal part p >= 0 and a tangential part t.
With the gap g, the slip s of this substep relative to the tool, and the compliance c = h^2 sum w_i N_i^2 of the point,
p = max(0, p_old - (g - g_0)/c),  t = t_old - s/c,  where |t| > mu max(P, p) cut off to mu P                   (1)
x_i += h^2 w_i N_i (df),  df = (p - p_old) n + (t - t_old)                                                     (2)
While p > 0, P = max(p_mean, p - debt), p_mean being p with a memory of 20 ms: points of a body that rings are unloaded
one by one, and what let go of what it holds whenever p is small would creep. What a point that slips feels beyond mu p
is its debt, paid back where p is above its mean, so that the mean friction of what slides is mu times the mean load; it
fades where the point sticks. So it is on planes, and on any tool that has the body alone. Where several may touch it,
or what is beyond a seam, P is p on all but planes, and where contact has a compliance: what is squeezed would gain
energy by what is lent.
A point touches the side of a box that it faced when the substep began (`faced`), and one that comes fast is followed on
its way to any other tool (`swept_gap`): neither passes to the far side.
g_0 = 0 for points that were outside; a point that was handed over inside a tool comes out within some milliseconds,
g_0 = old gap/(1 + h/tau), because all at once would kick it. Where a tool covers a part of what a point stands for
(`share`), and on an embedded surface (body/contact_points.py), contact has a compliance alpha, and
p = max(0, p_old - (g - g_0 + alpha p_old)/(c + alpha)),
t = t_old - (s + alpha (t_old - t_0))/(c + alpha), cut off as in (1), g_0 = (old gap + alpha p_0)/(1 + h/tau),   (3)
p_0 and t_0 being the force at the start of the substep, so that p = -g/alpha at rest, and t = t_0 - s/alpha however
often it is solved. Under what is round, and where a surface is, alpha goes by the p that alpha of p_0 leads to
(tools/kernels/patch.py): by p_0 what comes would be pressed too little and what goes too much, and a tool at rest would
feed the body. The forces
stay in the nodes' accelerations from one substep to the next, so at rest they are exact, the gap closes to zero and a
sticking point does not creep. On a block every point is one node and (1) is the exact local solution.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import PLANE
from softseam_services.tools.kernels import SLOW, patch_yields, steepness

from . import pairs as col
from .faced import face_sides, faces
from .gaps import find_all_gaps
from .lanes import batch_kernel, copy_rows, four, lane_kernel, three
from .pairs import EIGHT, farthest, lean_group, move_group, place_group
from .tool_motion import twelve

RELEASE = 0.005
"""time in which an old penetration falls to a third [s]"""
STILL = tuple(np.eye(4, 3).ravel().tolist())
"""motion of a tool that does not move, as of `tool_motions`"""
MEMORY = 0.02
"""of the pressure that bounds friction [s]"""
AT_BOUND = 0.95
"""of the bound of friction: what feels less does not slide [1]"""
NO_MEMORY = 1.0
"""share of p in p_mean where nothing is lent"""


@lane_kernel
def _solve(row, lane, gap, nx, ny, nz, motion, hh, newer):
    """Eq. (1) for one pair at this gap and normal: FORCE, STEADY, SLIPPED, CHANGE, HOLD and X are updated.

    newer: share of p in p_mean; STEADY holds p_mean and the debt, which fades with the same memory while it sticks
    """
    old_x, old_y, old_z = (
        row[lane + EIGHT * col.FORCE],
        row[lane + EIGHT * (col.FORCE + 1)],
        row[lane + EIGHT * (col.FORCE + 2)],
    )
    x, y, z = row[lane], row[lane + EIGHT], row[lane + 2 * EIGHT]
    c, per_c = row[lane + EIGHT * col.GIVE], row[lane + EIGHT * (col.GIVE + 1)]
    old_n = max(0.0, old_x * nx + old_y * ny + old_z * nz)
    p = max(0.0, old_n - (gap - row[lane + EIGHT * col.ALLOWED]) * per_c)
    p = p if c > 0.0 else 0.0
    # Where the tool's material under the point went in this substep.
    xx, xy, xz, yx, yy, yz, zx, zy, zz, bx, by, bz = motion
    ux, uy = row[lane + EIGHT * col.BEFORE], row[lane + EIGHT * (col.BEFORE + 1)]
    uz = row[lane + EIGHT * (col.BEFORE + 2)]
    sx = x - (xx * ux + xy * uy + xz * uz + bx)
    sy = y - (yx * ux + yy * uy + yz * uz + by)
    sz = z - (zx * ux + zy * uy + zz * uz + bz)
    sn = sx * nx + sy * ny + sz * nz
    sx, sy, sz = sx - sn * nx, sy - sn * ny, sz - sn * nz
    tx = old_x - old_n * nx - sx * per_c
    ty = old_y - old_n * ny - sy * per_c
    tz = old_z - old_n * nz - sz * per_c
    tn = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
    mu = row[lane + EIGHT * col.FRICTION]
    steady = row[lane + EIGHT * col.STEADY]
    steady += newer * (p - steady)
    debt = row[lane + EIGHT * (col.STEADY + 1)]
    lent = max(steady, p - debt) if p > 0.0 else 0.0
    square, bound = tx * tx + ty * ty + tz * tz, mu * lent
    most = mu * (max(lent, p) if p > 0.0 else 0.0)
    sticks = square <= most * most
    row[lane + EIGHT * col.STEADY] = steady
    row[lane + EIGHT * (col.STEADY + 1)] = (1.0 - newer) * debt if sticks else max(0.0, debt + lent - p)
    scale = 1.0 if sticks else bound / np.sqrt(1.0 if sticks else square)
    fx, fy, fz = p * nx + scale * tx, p * ny + scale * ty, p * nz + scale * tz
    dx, dy, dz = fx - old_x, fy - old_y, fz - old_z
    # The part of the correction along the surface changes the slip that remains.
    dn = dx * nx + dy * ny + dz * nz
    row[lane + EIGHT * col.SLIPPED] = sx + c * (dx - dn * nx)
    row[lane + EIGHT * (col.SLIPPED + 1)] = sy + c * (dy - dn * ny)
    row[lane + EIGHT * (col.SLIPPED + 2)] = sz + c * (dz - dn * nz)
    row[lane + EIGHT * col.FORCE] = fx
    row[lane + EIGHT * (col.FORCE + 1)] = fy
    row[lane + EIGHT * (col.FORCE + 2)] = fz
    row[lane + EIGHT * col.HOLD] = 0.0 if p == 0.0 else 3.0 if sticks and mu > 0.0 else 1.0
    row[lane + EIGHT * col.CHANGE] = dx
    row[lane + EIGHT * (col.CHANGE + 1)] = dy
    row[lane + EIGHT * (col.CHANGE + 2)] = dz
    step = hh * row[lane + EIGHT * col.W]
    row[lane] = x + step * dx
    row[lane + EIGHT] = y + step * dy
    row[lane + 2 * EIGHT] = z + step * dz


@batch_kernel
def solve_at_gaps(row, lanes, motion, hh, newer):
    """The eight pairs of a group at their GAP; lanes is EIGHT, see `records.Contacts`."""
    for lane in range(lanes):
        gap, nx = row[lane + EIGHT * col.GAP], row[lane + EIGHT * (col.GAP + 1)]
        ny, nz = row[lane + EIGHT * (col.GAP + 2)], row[lane + EIGHT * (col.GAP + 3)]
        _solve(row, lane, gap, nx, ny, nz, motion, hh, newer)


@lane_kernel
def _pressed(row, lane):
    """The normal part of FORCE, by GAP's normal [N]."""
    p = row[lane + EIGHT * col.FORCE] * row[lane + EIGHT * (col.GAP + 1)]
    p += row[lane + EIGHT * (col.FORCE + 1)] * row[lane + EIGHT * (col.GAP + 2)]
    return max(0.0, p + row[lane + EIGHT * (col.FORCE + 2)] * row[lane + EIGHT * (col.GAP + 3)])


@lane_kernel
def _yields(row, lane, ease, pressure):
    """alpha of a point that is pressed so [m/N]; d/F of tools/kernels/patch.py, with its `ease`."""
    grade = row[lane + EIGHT * col.GRADE]
    return patch_yields(row[lane + EIGHT * col.SOFT], row[lane + EIGHT * col.LAG], ease, pressure / grade) / grade


@lane_kernel
def _solve_softly(row, lane, motion, hh, newer, ease, lags):
    """Eq. (3) for one pair at its GAP; where SOFT is 0, eq. (1). lags: whether its LAG may be other than 0."""
    nx, ny, nz = row[lane + EIGHT * (col.GAP + 1)], row[lane + EIGHT * (col.GAP + 2)], row[lane + EIGHT * (col.GAP + 3)]
    held = (
        row[lane + EIGHT * col.HELD] * nx
        + row[lane + EIGHT * (col.HELD + 1)] * ny
        + row[lane + EIGHT * (col.HELD + 2)] * nz
    )
    soft, old_n = _yields(row, lane, ease, max(0.0, held)), _pressed(row, lane)
    give = row[lane + EIGHT * col.GIVE]
    per_c = 1.0 / (give + soft) if give > 0.0 else 0.0
    if lags:
        away = row[lane + EIGHT * col.GAP] - row[lane + EIGHT * col.ALLOWED]
        soft = _yields(row, lane, ease, max(0.0, old_n - (away + soft * old_n) * per_c))
        per_c = 1.0 / (give + soft) if give > 0.0 else 0.0
    row[lane + EIGHT * (col.GIVE + 1)] = per_c
    old_x, old_y = row[lane + EIGHT * col.FORCE], row[lane + EIGHT * (col.FORCE + 1)]
    old_z = row[lane + EIGHT * (col.FORCE + 2)]
    # alpha (t_old - t_0): so much nearer is where the point sticks with what it holds; it is no slip.
    lag_x = soft * (old_x - row[lane + EIGHT * col.HELD])
    lag_y = soft * (old_y - row[lane + EIGHT * (col.HELD + 1)])
    lag_z = soft * (old_z - row[lane + EIGHT * (col.HELD + 2)])
    xx, xy, xz, yx, yy, yz, zx, zy, zz, bx, by, bz = motion
    nearer = xx, xy, xz, yx, yy, yz, zx, zy, zz, bx - lag_x, by - lag_y, bz - lag_z
    _solve(row, lane, row[lane + EIGHT * col.GAP] + soft * old_n, nx, ny, nz, nearer, hh, newer)
    lag_n = lag_x * nx + lag_y * ny + lag_z * nz
    row[lane + EIGHT * col.SLIPPED] -= lag_x - lag_n * nx
    row[lane + EIGHT * (col.SLIPPED + 1)] -= lag_y - lag_n * ny
    row[lane + EIGHT * (col.SLIPPED + 2)] -= lag_z - lag_n * nz
    hold = row[lane + EIGHT * col.HOLD]
    row[lane + EIGHT * col.HOLD] = hold if soft <= row[lane + EIGHT * col.GIVE] else 0.0


@batch_kernel
def _is_open(row, lanes):
    """Whether no point of a group is in its tool at its GAP, or feels it, or remembers that it did."""
    felt = 0
    for lane in range(lanes):
        fx, fy = row[lane + EIGHT * col.FORCE], row[lane + EIGHT * (col.FORCE + 1)]
        feels = (fx != 0.0) | (fy != 0.0) | (row[lane + EIGHT * (col.FORCE + 2)] != 0.0)
        remembers = (row[lane + EIGHT * col.STEADY] != 0.0) | (row[lane + EIGHT * (col.STEADY + 1)] > 0.0)
        inside = (row[lane + EIGHT * col.GIVE] > 0.0) & (not row[lane + EIGHT * col.GAP] >= 0.0)
        felt += 1 if feels | remembers | inside else 0
    return felt == 0


@batch_kernel
def solve_softly(row, lanes, motion, hh, newer, ease):
    """The eight pairs of a group at their GAP, with compliance: eq. (3); lanes as of `solve_at_gaps`."""
    lagging = 0
    for lane in range(lanes):
        lagging += 1 if row[lane + EIGHT * col.LAG] > 0.0 else 0
    if lagging > 0:
        for lane in range(lanes):
            _solve_softly(row, lane, motion, hh, newer, ease, True)
    else:
        for lane in range(lanes):
            _solve_softly(row, lane, motion, hh, newer, ease, False)


@njit(cache=True, error_model="numpy")
def project_contacts(model, parameters, contacts, xw, hh, squeezed):
    """Solve (1) and (2) for each pair once, group by group, with the tools as at the end of the substep.

    contacts  see `pairs`, updated in place
    xw        (n + 8, 4)  positions and inverse masses; positions updated in place
    hh        the substep squared [s^2]
    squeezed  whether what is beyond a seam, or another body, may press the body against a tool
    """
    indptr, node, weight = model.indptr, model.node, parameters.weight
    kind, shape = parameters.kind, parameters.shape
    lends = np.sqrt(hh) / (MEMORY + np.sqrt(hh))
    position, orientation, motion = contacts.position[1], contacts.orientation[1], contacts.motion
    start, rows, pairs, clear = contacts.start, contacts.rows, contacts.pairs, contacts.clear
    waits, lanes = False, contacts.lanes
    for group in range(start[-1]):
        waits = waits or clear[group] > -np.inf
    way = farthest(contacts.found_at, xw) if waits else 0.0
    n_near = 0
    for tool in range(len(kind)):
        n_near += start[tool + 1] > start[tool]
    alone = lends if n_near == 1 and not squeezed else NO_MEMORY
    for tool in range(len(kind)):
        tool_kind, tool_shape = kind[tool], shape[tool]
        place, turn = three(position, tool), four(orientation, tool)
        places = parameters.places[tool]
        forth = twelve(motion, 0, tool)
        slow = parameters.short[tool] if places > 0 else SLOW * parameters.reach[tool]
        newer = lends if tool_kind == PLANE else alone
        reached = steepness(tool_kind) * (way + contacts.travel[tool])
        for group in range(start[tool], start[tool + 1]):
            if clear[group] > reached:
                continue
            if clear[group] > -np.inf:
                clear[group] = -np.inf
                before = contacts.before  # no force is carried there, which nodes would follow
                _begin_group(model, parameters, contacts, before, before, tool, group, np.sqrt(hh))
            place_group(group, col.X, rows, indptr, node, weight, parameters.tilt, xw, pairs)
            row = pairs[group]
            find_all_gaps(row, lanes, rows, group, tool_kind, tool_shape, places, place, turn, forth, slow)
            if rows[group, col.EDGED]:
                if _is_open(row, lanes):
                    continue
                solve_softly(row, lanes, forth, hh, alone, parameters.ease)
            else:
                solve_at_gaps(row, lanes, forth, hh, newer)
            move_group(group, rows, indptr, node, weight, parameters.tilt, hh, pairs, xw)


@njit(cache=True, error_model="numpy")
def _begin_group(model, parameters, contacts, xw, a, tool, group, h):
    """BEFORE, FACED, HELD and ALLOWED of a group for the substep that starts at xw, with the tools where they start
    it."""
    indptr, node, weight, kind, shape = model.indptr, model.node, parameters.weight, parameters.kind, parameters.shape
    rows, pairs = contacts.rows, contacts.pairs
    place, turn = three(contacts.position[0], tool), four(contacts.orientation[0], tool)
    if parameters.places[tool] > 0 and rows[group, col.EDGED]:
        lean_group(group, model, parameters, h * h, pairs, rows, xw, a)
    place_group(group, col.BEFORE, rows, indptr, node, weight, parameters.tilt, xw, pairs)
    row = pairs[group]
    if faces(kind[tool], shape[tool]):
        a, b, c = three(shape, tool)
        face_sides(row, a, b, c, place, turn)
    if rows[group, col.EDGED]:
        for entry in range(3 * EIGHT):
            row[EIGHT * col.HELD + entry] = row[EIGHT * col.FORCE + entry]
    if rows[group, col.DEEP]:
        for entry in range(3 * EIGHT):
            row[EIGHT * col.X + entry] = row[EIGHT * col.BEFORE + entry]
        places = parameters.places[tool]
        find_all_gaps(row, contacts.lanes, rows, group, kind[tool], shape[tool], places, place, turn, STILL, np.inf)
        for lane in range(EIGHT):
            if row[lane + EIGHT * col.DEPTH] > 0.0:
                old = _pressed(row, lane)
                old *= _yields(row, lane, parameters.ease, old)
                old += row[lane + EIGHT * col.GAP]
                row[lane + EIGHT * col.ALLOWED] = min(0.0, old) / (1.0 + h / RELEASE)


@njit(cache=True, error_model="numpy")
def begin_pairs(model, parameters, contacts, xw, a, h):
    """A substep h starts at xw, with the tools where they start it; a (n, 3) [m/s^2] follows forces on patches."""
    start, clear = contacts.start, contacts.clear
    waits = False
    for tool in range(len(parameters.kind)):
        for group in range(start[tool], start[tool + 1]):
            if clear[group] == -np.inf:
                _begin_group(model, parameters, contacts, xw, a, tool, group, h)
            else:
                waits = True
    if waits:
        copy_rows(contacts.before, xw)


@njit(cache=True, error_model="numpy")
def let_slide(model, parameters, contacts, xw):
    """What friction holds at its bound slides from now on, on tools where they start, and nothing resists it: FRICTION
    and FORCE of `pairs` in place. Where contact has a compliance: elsewhere the bound goes by a memory."""
    kind, shape = parameters.kind, parameters.shape
    start, rows, pairs = contacts.start, contacts.rows, contacts.pairs
    for tool in range(len(kind)):
        place, turn = three(contacts.position[0], tool), four(contacts.orientation[0], tool)
        for group in range(start[tool], start[tool + 1]):
            if rows[group, col.EDGED] == 0:
                continue
            place_group(group, col.X, rows, model.indptr, model.node, parameters.weight, parameters.tilt, xw, pairs)
            row = pairs[group]
            places = parameters.places[tool]
            find_all_gaps(row, contacts.lanes, rows, group, kind[tool], shape[tool], places, place, turn, STILL, np.inf)
            for lane in range(EIGHT):
                p = _pressed(row, lane)
                square, most = -p * p, AT_BOUND * row[lane + EIGHT * col.FRICTION] * p
                for c in range(3):
                    square += row[lane + EIGHT * (col.FORCE + c)] ** 2
                if p > 0.0 and square >= most * most:
                    row[lane + EIGHT * col.FRICTION] = 0.0
                    for c in range(3):
                        row[lane + EIGHT * (col.FORCE + c)] = p * row[lane + EIGHT * (col.GAP + 1 + c)]


@batch_kernel
def _account_lanes(row, place, share):
    px, py, pz = place
    for lane in range(EIGHT):
        x, y, z = row[lane], row[lane + EIGHT], row[lane + 2 * EIGHT]
        fx, fy, fz = (
            row[lane + EIGHT * col.FORCE],
            row[lane + EIGHT * (col.FORCE + 1)],
            row[lane + EIGHT * (col.FORCE + 2)],
        )
        wx = x - row[lane + EIGHT * col.BEFORE]
        wy = y - row[lane + EIGHT * (col.BEFORE + 1)]
        wz = z - row[lane + EIGHT * (col.BEFORE + 2)]
        row[lane + EIGHT * col.WORK] += fx * wx + fy * wy + fz * wz
        touches = fx * fx + fy * fy + fz * fz > 0.0
        slip = row[lane + EIGHT * col.SLIP_SINCE] + row[lane + EIGHT * col.SLIPPED]
        row[lane + EIGHT * col.SLIP_SINCE] = slip if touches else 0.0
        slip = row[lane + EIGHT * (col.SLIP_SINCE + 1)] + row[lane + EIGHT * (col.SLIPPED + 1)]
        row[lane + EIGHT * (col.SLIP_SINCE + 1)] = slip if touches else 0.0
        slip = row[lane + EIGHT * (col.SLIP_SINCE + 2)] + row[lane + EIGHT * (col.SLIPPED + 2)]
        row[lane + EIGHT * (col.SLIP_SINCE + 2)] = slip if touches else 0.0
        x, y, z = x - px, y - py, z - pz
        fx, fy, fz = share * fx, share * fy, share * fz
        row[lane + EIGHT * col.MEAN] += fx
        row[lane + EIGHT * (col.MEAN + 1)] += fy
        row[lane + EIGHT * (col.MEAN + 2)] += fz
        row[lane + EIGHT * col.MOMENT] += y * fz - z * fy
        row[lane + EIGHT * (col.MOMENT + 1)] += z * fx - x * fz
        row[lane + EIGHT * (col.MOMENT + 2)] += x * fy - y * fx


@batch_kernel
def _account_yielding(row, motion):
    """Of the work that `_account_lanes` added: where contact yields what the tool's motion puts in is left of what the
    normal part does, the rest is in `stored.stored_energy`."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz, bx, by, bz = motion
    for lane in range(EIGHT):
        nx, ny = row[lane + EIGHT * (col.GAP + 1)], row[lane + EIGHT * (col.GAP + 2)]
        nz = row[lane + EIGHT * (col.GAP + 3)]
        ux, uy = row[lane + EIGHT * col.BEFORE], row[lane + EIGHT * (col.BEFORE + 1)]
        uz = row[lane + EIGHT * (col.BEFORE + 2)]
        away = (row[lane] - (xx * ux + xy * uy + xz * uz + bx)) * nx
        away += (row[lane + EIGHT] - (yx * ux + yy * uy + yz * uz + by)) * ny
        away += (row[lane + 2 * EIGHT] - (zx * ux + zy * uy + zz * uz + bz)) * nz
        p = row[lane + EIGHT * col.FORCE] * nx + row[lane + EIGHT * (col.FORCE + 1)] * ny
        p += row[lane + EIGHT * (col.FORCE + 2)] * nz
        row[lane + EIGHT * col.WORK] -= p * away if row[lane + EIGHT * col.SOFT] > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def account_pairs(model, parameters, contacts, xw, share):
    """Add one substep to MEAN, MOMENT, WORK and SLIP_SINCE; share = 1/m, the rest as in `project_contacts`."""
    indptr, node, weight, position = model.indptr, model.node, parameters.weight, contacts.position[1]
    start, rows, pairs, clear = contacts.start, contacts.rows, contacts.pairs, contacts.clear
    for tool in range(len(position)):
        place = three(position, tool)
        for group in range(start[tool], start[tool + 1]):
            if clear[group] > -np.inf:
                continue
            place_group(group, col.X, rows, indptr, node, weight, parameters.tilt, xw, pairs)
            _account_lanes(pairs[group], place, share)
            if rows[group, col.EDGED]:
                _account_yielding(pairs[group], twelve(contacts.motion, 0, tool))
