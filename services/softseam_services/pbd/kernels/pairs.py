"""Pairs of a surface point and a tool that may touch in a step: found once, then carried by eights side by side.

A group is eight pairs of one tool whose points share no node, so that they can be solved at once; pairs that do share
nodes keep their order. A row of `pairs` (g, N_COLUMNS * EIGHT) holds all that the substeps need of a group, column c of
a lane at 8 c + lane:
X           3  position of the point, or of where on its patch the force acts [m]
W           1  inverse mass, where the point is a node [1/kg]
BEFORE      4  X and W at the start of the substep
FORCE       3  force of the tool on the point [N], carried from substep to substep
ALLOWED     1  gap that a point which was handed over inside a tool may keep in this substep, <= 0 [m]
FRICTION    1  Coulomb coefficient of the tool at the point [1]
GIVE        2  compliance of the point h^2 sum w_i N_i^2 [m/N], and the inverse of it and of contact's; 0 where nothing
               can move
SLIPPED     3  slip in this substep [m]
SLIP_SINCE  3  slip since the point began to touch [m]
MEAN        3  force [N], mean over the step so far
MOMENT      3  torque about the tool's position [N m], mean over the step so far
WORK        1  work of the tool on the point [J], less what contact that yields stores; friction takes none of it
DEPTH       1  how much deeper the point was inside the tool at the start of the step than its force says [m]
GAP         4  gap [m] and normal
CHANGE      3  the change of FORCE in the last projection [N]
HOLD        1  directions in which the tool holds the point: 0, 1 where it slides, 3 where it sticks
SOFT        1  compliance of contact where many points share a block, else 0 [m/N]
HELD        3  FORCE at the start of the substep, in groups with such points [N]
STEADY      2  pressure with a memory, by which friction is bounded, and how far friction went beyond the pressure [N]
GRADE       1  slope of eq. (2) of tools/kernels/patch.py, 1 where that is not looked at
SAG         1  s of eq. (1) there, of a point on a patch under a tool with edges, whose LAG is 0 [m]
PATCH       6  edges of the point's patch under a tool with edges as the substep begins, else 0 [m]
LEAN        2  where on it the force acts in this substep, in its edges from the middle [1]
NEXT        2  where the tool presses it, which LEAN follows
LAG         1  how much farther a point that is pressed firmly is inside for the tool's being round [m]
FACED       3  outward normal, in a box's frame, of the side that the point faced when the substep began, 0 where it
               faced none
`rows` (g, N_ROWS) says whom they belong to: POINT 8 (-1 where a lane is empty), NODE 8, DIRECT 1 (each point is that
node, as on a block), DEEP 1 (some point was inside the tool), EDGED 1 (contact has compliance at some points). Groups
start[t] .. start[t + 1] belong to tool t.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import DENSE, LIGHT, patch_press, patch_yields, steepness, tool_gap, tool_travel

from .lanes import LANES, four, three, transpose_four

EIGHT = 2 * LANES
"""lanes of a group: with four the compiler would write the short loops out, number by number"""

X, W, BEFORE, FORCE, ALLOWED, FRICTION, GIVE, SLIPPED, SLIP_SINCE, MEAN, MOMENT = 0, 3, 4, 8, 11, 12, 13, 15, 18, 21, 24
WORK, DEPTH, GAP, CHANGE, HOLD, SOFT, HELD, STEADY, FACED, LAG, GRADE, PATCH, LEAN, NEXT, SAG = (
    27, 28, 29, 33, 36, 37, 38, 41, 43, 46, 47, 48, 54, 56, 58,
)  # fmt: skip
N_COLUMNS = 59
WIDTH = N_COLUMNS * EIGHT
POINT, NODE, DIRECT, DEEP, EDGED = 0, 8, 16, 17, 18
N_ROWS = 19
DEEPEST_ROUNDOFF = 1e-9
"""penetrations below this are roundoff of a closed contact [m]"""
JUST_DEEPER = 0.1
"""share of its force by which a point under what is round is as deep as that says: more was handed over [1]"""
NEAR = 4.0
"""how far a patch reaches beside its middle, in margins of contact"""
EASE = 0.25
"""of what LEAN lacks of NEXT, taken in a substep: all of it turns patches to and fro that are stiffer than blocks"""
RANKS = 3
NOT_FOUND = float(RANKS)
"""of pairs, see `find_pairs`"""


@njit(cache=True, error_model="numpy")
def look_ahead(parameters, inputs, contacts, x, way):
    """contacts.travel (t,) <- how far a point of each tool goes in the step at most; contacts.ahead (t,) <- by how much
    its gaps shrink then at most, where no node goes farther than `way` [m]. x (n, 3): nodes as the step begins.

    Returns the longest way of a tool [m].
    """
    longest = 0.0
    for tool in range(len(parameters.kind)):
        one = slice(tool, tool + 1)
        travel = tool_travel(
            *(parameters.reach[one], inputs.position[one], inputs.orientation[one]),
            *(inputs.position_next[one], inputs.orientation_next[one], x),
        )
        contacts.travel[tool], contacts.ahead[tool] = travel, steepness(parameters.kind[tool]) * (travel + way)
        longest = max(longest, travel)
    return longest


@njit(cache=True, error_model="numpy", forceinline=True)
def follow(begin, end, node, weight, x):
    """sum N_i x_i over the entries begin .. end: where a surface point is when the nodes are at x (n, >= 3)."""
    i, n = node[begin], weight[begin]
    px, py, pz = n * x[i, 0], n * x[i, 1], n * x[i, 2]
    for entry in range(begin + 1, end):
        i, n = node[entry], weight[entry]
        px += n * x[i, 0]
        py += n * x[i, 1]
        pz += n * x[i, 2]
    return px, py, pz


@njit(cache=True, error_model="numpy", forceinline=True)
def acting_weight(entry, weight, tilt, first, second):
    """Weight of a node at the place of a point's patch where its force acts."""
    return weight[entry] + first * tilt[entry, 0] + second * tilt[entry, 1]


@njit(cache=True, error_model="numpy")
def place_points(model, parameters, xw, point_x):
    """Positions of the surface points, updated in place (p, 3) [m]."""
    indptr, node, weight = model.indptr, model.node, parameters.weight
    for point in range(len(point_x)):
        x, y, z = follow(indptr[point], indptr[point + 1], node, weight, xw)
        point_x[point, 0], point_x[point, 1], point_x[point, 2] = x, y, z


@njit(cache=True, error_model="numpy")
def _open(group, n_nodes, rows, pairs):
    """An empty group: its lanes follow the padding's nodes, which nothing moves."""
    rows[group, DIRECT], rows[group, DEEP], rows[group, EDGED] = 1, 0, 0
    pairs[group, :] = 0.0
    for lane in range(EIGHT):
        rows[group, POINT + lane], rows[group, NODE + lane] = -1, n_nodes + lane
        pairs[group, EIGHT * GRADE + lane] = 1.0


@njit(cache=True, error_model="numpy")
def _find_gaps(model, parameters, state, inputs, contacts, margin, tool):
    """contacts.found (p, 6) <- gap to a tool where it starts, how much deeper than its force says a point is inside
    [m], in which of RANKS a pair is, LAG [m], and NEXT of patches; those that are none have NOT_FOUND.

    Under tools that go by LAG is 0: other patches would be pressed then, and cut into what yields more."""
    softness, lags, force = parameters.point_give, parameters.point_lag, state.force
    found, lean = contacts.found, state.lean
    kind, shape, point_x = parameters.kind[tool], parameters.shape[tool], contacts.point_x
    place, turn, places = three(inputs.position, tool), four(inputs.orientation, tool), parameters.places[tool]
    # Cheap: outside the ball around the tool there is nothing to touch.
    reach = (margin + parameters.reach[tool]) ** 2
    for point in range(len(point_x)):
        found[point, 2] = NOT_FOUND
        if not model.touches[point, tool]:
            continue
        x = three(point_x, point)
        square = (x[0] - place[0]) ** 2 + (x[1] - place[1]) ** 2 + (x[2] - place[2]) ** 2
        fx, fy, fz = three(force[point], tool)
        carried = fx != 0.0 or fy != 0.0 or fz != 0.0
        if square > reach and not carried:
            state.steady[point, tool] = 0.0
            continue
        gap, nx, ny, nz = tool_gap(kind, shape, place, turn, x)
        grade = 1.0
        found[point, 4], found[point, 5] = lean[point, tool, 0], lean[point, tool, 1]
        if parameters.places[tool] > 0 and point >= model.n_surface:
            gap -= NEAR * parameters.margin
            if gap < margin:
                patch = contacts.patch[point]
                sag = lags[point, tool] / (1.0 - LIGHT / DENSE) if contacts.slow[tool] else 0.0
                depth, grade, nx, ny, nz, s, t = patch_press(
                    *(kind, shape, place, turn, x, patch[0], patch[1], sag, places)
                )[:7]
                if not carried:
                    lean[point, tool, 0], lean[point, tool, 1] = s, t
                if depth > 0.0 or not carried:
                    found[point, 4], found[point, 5] = s, t
                gap = -depth / grade
        if gap >= margin and not carried:
            state.steady[point, tool] = 0.0
            continue
        due = max(0.0, fx * nx + fy * ny + fz * nz)
        lag = lags[point, tool] if contacts.slow[tool] else 0.0
        in_parts = parameters.places[tool] > 0 and point >= model.n_surface
        due *= patch_yields(softness[point], 0.0 if in_parts else lag, parameters.ease, due / grade) / grade
        just = JUST_DEEPER * due if carried and not in_parts else 0.0
        deeper = -gap - due if -gap - due > just else 0.0
        held = carried or state.steady[point, tool, 0] != 0.0 or state.steady[point, tool, 1] != 0.0
        rank = 0.0 if held or gap <= 0.0 else 1.0 if gap < contacts.ahead[tool] else 2.0
        found[point, 0], found[point, 1], found[point, 2], found[point, 3] = gap, deeper, rank, lag


@njit(cache=True, error_model="numpy")
def _add_pair(model, parameters, state, contacts, tool, point, hh, first_open, n_groups):
    """Take up a pair into the first group with room that comes after all groups with a node of its point; returns the
    first of the tool's groups that is not full, and how many groups there are."""
    indptr, node, weight, newest = model.indptr, model.node, parameters.weight, contacts.newest
    rows, pairs, clear = contacts.rows, contacts.pairs, contacts.clear
    force, steady = state.force[point, tool], state.steady[point, tool]
    gap, depth, rank = three(contacts.found, point)
    group, first, end = first_open, indptr[point], indptr[point + 1]
    for entry in range(first, end):
        group = max(group, newest[node[entry]] + 1)
    while group < n_groups and rows[group, POINT + EIGHT - 1] >= 0:
        group += 1
    if group == n_groups:
        _open(group, len(newest), rows, pairs)
        clear[group] = np.inf
        n_groups += 1
    lane = 0
    while rows[group, POINT + lane] >= 0:
        lane += 1
    for entry in range(first, end):
        newest[node[entry]] = group
    rows[group, POINT + lane], rows[group, NODE + lane] = point, node[first]
    if end != first + 1 or weight[first] != 1.0:
        rows[group, DIRECT] = 0
    row = pairs[group]
    give = parameters.point_softness[point]
    row[EIGHT * FRICTION + lane] = parameters.friction[tool] * parameters.friction_factor[point]
    yields = parameters.point_give[point]
    if yields > 0.0:
        rows[group, EDGED] = 1
        row[EIGHT * SOFT + lane], row[EIGHT * LAG + lane] = yields, contacts.found[point, 3]
    row[EIGHT * GRADE + lane] = 1.0
    if parameters.places[tool] > 0 and point >= model.n_surface:
        row[EIGHT * SAG + lane] = row[EIGHT * LAG + lane] / (1.0 - LIGHT / DENSE)
        row[EIGHT * LAG + lane] = 0.0
        for c in range(3):
            row[EIGHT * (PATCH + c) + lane] = contacts.patch[point, 0, c]
            row[EIGHT * (PATCH + 3 + c) + lane] = contacts.patch[point, 1, c]
        s, t = state.lean[point, tool, 0], state.lean[point, tool, 1]
        row[EIGHT * LEAN + lane], row[EIGHT * (LEAN + 1) + lane] = s, t
        row[EIGHT * NEXT + lane], row[EIGHT * (NEXT + 1) + lane] = contacts.found[point, 4], contacts.found[point, 5]
        give = 0.0
        for entry in range(first, end):
            give += parameters.inverse_mass[node[entry]] * acting_weight(entry, weight, parameters.tilt, s, t) ** 2
    give *= hh
    row[EIGHT * GIVE + lane], row[EIGHT * (GIVE + 1) + lane] = give, 1.0 / give if give > 0.0 else 0.0
    if depth > DEEPEST_ROUNDOFF:
        row[EIGHT * DEPTH + lane] = depth
        rows[group, DEEP] = 1
    clear[group] = min(clear[group], gap if rank > 0.0 else -np.inf)
    for c in range(2):
        row[EIGHT * (STEADY + c) + lane] = steady[c]
    for c in range(3):
        row[EIGHT * (FORCE + c) + lane] = force[c]
        row[EIGHT * (SLIP_SINCE + c) + lane] = state.slip[point, tool, c]
    while first_open < n_groups and rows[first_open, POINT + EIGHT - 1] >= 0:
        first_open += 1
    return first_open, n_groups


@njit(cache=True, error_model="numpy")
def find_pairs(model, parameters, state, inputs, contacts, margin, hh):
    """Pairs of a point and a tool that may touch it that touch or lie within margin [m], tool after tool, in groups.

    state     its contact forces are carried; a pair that carries a force always counts
    contacts  points are at its point_x; its start, rows, pairs and clear are updated in place. Of a tool first come
              points that it holds, then those that it reaches by its `ahead`, then others: few groups are solved
    hh        the substep squared [s^2]

    Tools are where `inputs` says that they start.
    """
    start, found, newest = contacts.start, contacts.found, contacts.newest
    n_groups, start[0] = 0, 0
    newest[:] = -1
    for tool in range(len(parameters.kind)):
        _find_gaps(model, parameters, state, inputs, contacts, margin, tool)
        for rank in range(RANKS):
            first_open = n_groups
            for point in model.visits:
                if found[point, 2] != rank:
                    continue
                first_open, n_groups = _add_pair(
                    model, parameters, state, contacts, tool, point, hh, first_open, n_groups
                )
        start[tool + 1] = n_groups


@njit(cache=True, error_model="numpy")
def lean_group(group, model, parameters, hh, pairs, rows, xw, a):
    """A substep begins where nodes are at xw (n + 8, 4): PATCH, LEAN and GIVE of points on patches, in place. Forces
    that are carried act elsewhere on them now, and so they do in the nodes' accelerations a (n, 3) [m/s^2]."""
    indptr, node, weight, tilt = model.indptr, model.node, parameters.weight, parameters.tilt
    row = pairs[group]
    for lane in range(EIGHT):
        point = rows[group, POINT + lane]
        if point < model.n_surface:
            continue
        s, t = row[EIGHT * LEAN + lane], row[EIGHT * (LEAN + 1) + lane]
        ahead, aside = EASE * (row[EIGHT * NEXT + lane] - s), EASE * (row[EIGHT * (NEXT + 1) + lane] - t)
        s, t = s + ahead, t + aside
        row[EIGHT * LEAN + lane], row[EIGHT * (LEAN + 1) + lane] = s, t
        give = 0.0
        for c in range(6):
            row[EIGHT * (PATCH + c) + lane] = 0.0
        for entry in range(indptr[point], indptr[point + 1]):
            i = node[entry]
            give += hh * xw[i, 3] * acting_weight(entry, weight, tilt, s, t) ** 2
            moved = xw[i, 3] * (ahead * tilt[entry, 0] + aside * tilt[entry, 1])
            for c in range(3):
                a[i, c] += moved * row[EIGHT * (FORCE + c) + lane]
                row[EIGHT * (PATCH + c) + lane] += tilt[entry, 0] * xw[i, c]
                row[EIGHT * (PATCH + 3 + c) + lane] += tilt[entry, 1] * xw[i, c]
        row[EIGHT * GIVE + lane] = give


@njit(cache=True, error_model="numpy", forceinline=True)
def place_group(group, column, rows, indptr, node, weight, tilt, xw, pairs):
    """X (column X, or BEFORE), and W where points are nodes, from xw (n + 8, 4)."""
    if rows[group, DIRECT]:
        for half in range(0, EIGHT, LANES):
            at = WIDTH * group + EIGHT * column + half
            transpose_four(
                pairs,
                at,
                at + EIGHT,
                at + 2 * EIGHT,
                at + 3 * EIGHT,
                xw,
                4 * rows[group, NODE + half],
                4 * rows[group, NODE + half + 1],
                4 * rows[group, NODE + half + 2],
                4 * rows[group, NODE + half + 3],
            )
        return
    for lane in range(EIGHT):
        point = rows[group, POINT + lane]
        if point >= 0:
            x, y, z = follow(indptr[point], indptr[point + 1], node, weight, xw)
            s, t = pairs[group, EIGHT * LEAN + lane], pairs[group, EIGHT * (LEAN + 1) + lane]
            if s != 0.0 or t != 0.0:
                for entry in range(indptr[point], indptr[point + 1]):
                    i, n = node[entry], s * tilt[entry, 0] + t * tilt[entry, 1]
                    x, y, z = x + n * xw[i, 0], y + n * xw[i, 1], z + n * xw[i, 2]
            at = EIGHT * column + lane
            pairs[group, at], pairs[group, at + EIGHT], pairs[group, at + 2 * EIGHT] = x, y, z


@njit(cache=True, error_model="numpy", forceinline=True)
def move_group(group, rows, indptr, node, weight, tilt, hh, pairs, xw):
    """x_i += h^2 w_i N_i CHANGE; where points are nodes, X has moved already."""
    if rows[group, DIRECT]:
        for half in range(0, EIGHT, LANES):
            at = WIDTH * group + half
            transpose_four(
                xw,
                4 * rows[group, NODE + half],
                4 * rows[group, NODE + half + 1],
                4 * rows[group, NODE + half + 2],
                4 * rows[group, NODE + half + 3],
                pairs,
                at,
                at + EIGHT,
                at + 2 * EIGHT,
                at + 3 * EIGHT,
            )
        return
    for lane in range(EIGHT):
        point = rows[group, POINT + lane]
        if point >= 0:
            dx = pairs[group, EIGHT * CHANGE + lane]
            dy = pairs[group, EIGHT * (CHANGE + 1) + lane]
            dz = pairs[group, EIGHT * (CHANGE + 2) + lane]
            s, t = pairs[group, EIGHT * LEAN + lane], pairs[group, EIGHT * (LEAN + 1) + lane]
            for entry in range(indptr[point], indptr[point + 1]):
                i = node[entry]
                step = hh * xw[i, 3] * acting_weight(entry, weight, tilt, s, t)
                xw[i, 0] += step * dx
                xw[i, 1] += step * dy
                xw[i, 2] += step * dz


@njit(cache=True, error_model="numpy")
def farthest(before, xw):
    """Longest way of a node from one (n + 8, 4) to the other [m]."""
    longest = 0.0
    for i in range(len(before) - EIGHT):
        dx, dy, dz = xw[i, 0] - before[i, 0], xw[i, 1] - before[i, 1], xw[i, 2] - before[i, 2]
        longest = max(longest, dx * dx + dy * dy + dz * dz)
    return np.sqrt(longest)


@njit(cache=True, error_model="numpy")
def store_pairs(contacts, state, wrench):
    """Forces, pressures, slips and mean forces back to the state, mean wrenches on the tools to (t, 6), all updated in
    place.

    Returns the work of the tools [J].
    """
    start, rows, pairs = contacts.start, contacts.rows, contacts.pairs
    force, slip, force_mean = state.force, state.slip, state.force_mean
    work = 0.0
    for tool in range(len(start) - 1):
        wrench[tool] = 0.0
        for group in range(start[tool], start[tool + 1]):
            for lane in range(EIGHT):
                point = rows[group, POINT + lane]
                if point < 0:
                    continue
                work += pairs[group, EIGHT * WORK + lane]
                for c in range(2):
                    state.steady[point, tool, c] = pairs[group, EIGHT * (STEADY + c) + lane]
                    state.lean[point, tool, c] = pairs[group, EIGHT * (LEAN + c) + lane]
                for c in range(3):
                    mean = pairs[group, EIGHT * (MEAN + c) + lane]
                    force[point, tool, c] = pairs[group, EIGHT * (FORCE + c) + lane]
                    slip[point, tool, c] = pairs[group, EIGHT * (SLIP_SINCE + c) + lane]
                    force_mean[point, tool, c] = mean
                    wrench[tool, c] -= mean
                    wrench[tool, 3 + c] -= pairs[group, EIGHT * (MOMENT + c) + lane]
    return work
