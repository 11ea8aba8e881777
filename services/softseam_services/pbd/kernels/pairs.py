"""Pairs of a surface point and a tool that may touch in a step: found once, then carried in rows of one array.

A row of `pairs` (k, N_COLUMNS) holds what the substeps need of a pair, so that they touch no other memory than its nodes:
FORCE       3  force of the tool on the point [N], carried from substep to substep
ANCHOR      3  where the tool's material under the point goes in this substep [m]
ALLOWED     1  gap that a point which was handed over inside a tool may keep in this substep, <= 0 [m]
GIVE        2  compliance of the point h^2 sum w_i N_i^2 [m/N], and its inverse or 0
SLIPPED     3  slip in this substep [m]
SLIP_SINCE  3  slip since the point began to touch [m]
MEAN        3  mean force over the substeps so far [N]
DEPTH       1  how deep the point was inside the tool at the start of the step [m]
`rows` (k, 3) are the point and the range of its entries in `node` and `weight`; pairs start[t] .. start[t + 1] belong to
tool t. At the end of the step forces and slips go back to where the state keeps them, by point and tool.
"""

from __future__ import annotations

from numba import njit

from softseam_services.tools.kernels import rotate, rotate_back, tool_gap, tool_reach

FORCE, ANCHOR, ALLOWED, GIVE, SLIPPED, SLIP_SINCE, MEAN, DEPTH = 0, 3, 6, 7, 9, 12, 15, 18
N_COLUMNS = 19
RELEASE = 0.005
"""time in which an old penetration falls to a third [s]"""
DEEP = 1e-9
"""penetrations below this are roundoff of a closed contact [m]"""


@njit(cache=True, error_model="numpy", forceinline=True)
def three(x, i):
    """The first three numbers of row i as a tuple: a view of the row would cost as much as what is done with it."""
    return x[i, 0], x[i, 1], x[i, 2]


@njit(cache=True, error_model="numpy", forceinline=True)
def four(q, i):
    """Row i of q (n, 4) as a tuple."""
    return q[i, 0], q[i, 1], q[i, 2], q[i, 3]


@njit(cache=True, error_model="numpy", forceinline=True)
def follow(begin, end, node, weight, x):
    """sum of weight N_i x_i over the entries begin .. end: where a surface point is when the nodes are at x (n, >= 3)."""
    i, n = node[begin], weight[begin]
    px, py, pz = n * x[i, 0], n * x[i, 1], n * x[i, 2]
    for entry in range(begin + 1, end):
        i, n = node[entry], weight[entry]
        px += n * x[i, 0]
        py += n * x[i, 1]
        pz += n * x[i, 2]
    return px, py, pz


@njit(cache=True, error_model="numpy", forceinline=True)
def carry_point(place, turn, place_next, turn_next, point):
    """Where a point that is fixed to a tool moves when the tool goes from one pose to the next; all of them tuples."""
    if turn == turn_next:
        return (
            point[0] + (place_next[0] - place[0]),
            point[1] + (place_next[1] - place[1]),
            point[2] + (place_next[2] - place[2]),
        )
    x, y, z = rotate_back(turn, point[0] - place[0], point[1] - place[1], point[2] - place[2])
    x, y, z = rotate(turn_next, x, y, z)
    return place_next[0] + x, place_next[1] + y, place_next[2] + z


@njit(cache=True, error_model="numpy")
def place_points(xw, indptr, node, weight, point_x):
    """Positions of the surface points, updated in place (p, 3) [m]."""
    for point in range(len(point_x)):
        x, y, z = follow(indptr[point], indptr[point + 1], node, weight, xw)
        point_x[point, 0], point_x[point, 1], point_x[point, 2] = x, y, z


@njit(cache=True, error_model="numpy")
def find_pairs(
    kind, shape, position, orientation, point_x, active, indptr, softness, force, slip, margin, hh, start, rows, pairs
):
    """Pairs of an active point and a tool that touch or lie within margin [m], tool after tool.

    softness     (p,)       sum w_i N_i^2 of each point [1/kg]; hh is the substep squared
    force, slip  (p, t, 3)  carried contact forces [N] and slips [m]; a pair that carries a force always counts
    start (t + 1,), rows (p t, 3) and pairs (p t, N_COLUMNS) are updated in place
    """
    n_pairs = 0
    start[0] = 0
    for tool in range(len(kind)):
        tool_kind, tool_shape = kind[tool], shape[tool]
        place, turn = three(position, tool), four(orientation, tool)
        # Cheap: outside the ball around the tool there is nothing to touch.
        reach = (margin + tool_reach(tool_kind, tool_shape)) ** 2
        for point in range(len(point_x)):
            if not active[point]:
                continue
            x = three(point_x, point)
            square = (x[0] - place[0]) ** 2 + (x[1] - place[1]) ** 2 + (x[2] - place[2]) ** 2
            carried = force[point, tool, 0] != 0.0 or force[point, tool, 1] != 0.0 or force[point, tool, 2] != 0.0
            if square > reach and not carried:
                continue
            gap = tool_gap(tool_kind, tool_shape, place, turn, x)[0]
            if gap < margin or carried:
                rows[n_pairs, 0], rows[n_pairs, 1], rows[n_pairs, 2] = point, indptr[point], indptr[point + 1]
                give = hh * softness[point]
                pairs[n_pairs, ALLOWED] = 0.0
                pairs[n_pairs, GIVE] = give
                pairs[n_pairs, GIVE + 1] = 1.0 / give if give > 0.0 else 0.0
                pairs[n_pairs, DEPTH] = -gap if gap < -DEEP else 0.0
                for c in range(3):
                    pairs[n_pairs, FORCE + c] = force[point, tool, c]
                    pairs[n_pairs, SLIPPED + c] = 0.0
                    pairs[n_pairs, SLIP_SINCE + c] = slip[point, tool, c]
                    pairs[n_pairs, MEAN + c] = 0.0
                n_pairs += 1
        start[tool + 1] = n_pairs


@njit(cache=True, error_model="numpy")
def anchor_pairs(
    x, node, weight, kind, shape, position, orientation, position_prev, orientation_prev, h, start, rows, pairs
):
    """ANCHOR and ALLOWED for the substep h in which the tools go from the poses _prev; x (n, 3) is where it starts."""
    for tool in range(len(kind)):
        place, turn = three(position, tool), four(orientation, tool)
        place_prev, turn_prev = three(position_prev, tool), four(orientation_prev, tool)
        for pair in range(start[tool], start[tool + 1]):
            point = follow(rows[pair, 1], rows[pair, 2], node, weight, x)
            a = carry_point(place_prev, turn_prev, place, turn, point)
            pairs[pair, ANCHOR], pairs[pair, ANCHOR + 1], pairs[pair, ANCHOR + 2] = a
            if pairs[pair, DEPTH] > 0.0:
                gap = tool_gap(kind[tool], shape[tool], place_prev, turn_prev, point)[0]
                pairs[pair, ALLOWED] = min(0.0, gap) / (1.0 + h / RELEASE)


@njit(cache=True, error_model="numpy")
def account_pairs(
    xw, node, weight, position, orientation, position_prev, orientation_prev, start, rows, pairs, share, wrench
):
    """Add one substep to MEAN, to SLIP_SINCE and to the mean wrenches on the tools (t, 6); share = 1/m.

    Returns the work of the tools [J].
    """
    work = 0.0
    for tool in range(len(position)):
        place, turn = three(position, tool), four(orientation, tool)
        place_prev, turn_prev = three(position_prev, tool), four(orientation_prev, tool)
        wx, wy, wz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for pair in range(start[tool], start[tool + 1]):
            fx, fy, fz = pairs[pair, FORCE], pairs[pair, FORCE + 1], pairs[pair, FORCE + 2]
            if fx == 0.0 and fy == 0.0 and fz == 0.0:
                pairs[pair, SLIP_SINCE], pairs[pair, SLIP_SINCE + 1], pairs[pair, SLIP_SINCE + 2] = 0.0, 0.0, 0.0
                continue
            point = follow(rows[pair, 1], rows[pair, 2], node, weight, xw)
            # Where the tool's material under the point was at the start of the substep.
            bx, by, bz = carry_point(place, turn, place_prev, turn_prev, point)
            work += fx * (point[0] - bx) + fy * (point[1] - by) + fz * (point[2] - bz)
            for c in range(3):
                pairs[pair, MEAN + c] += share * pairs[pair, FORCE + c]
                pairs[pair, SLIP_SINCE + c] += pairs[pair, SLIPPED + c]
            x, y, z = point[0] - place[0], point[1] - place[1], point[2] - place[2]
            wx, wy, wz = wx + fx, wy + fy, wz + fz
            mx, my, mz = mx + (y * fz - z * fy), my + (z * fx - x * fz), mz + (x * fy - y * fx)
        wrench[tool, 0] -= share * wx
        wrench[tool, 1] -= share * wy
        wrench[tool, 2] -= share * wz
        wrench[tool, 3] -= share * mx
        wrench[tool, 4] -= share * my
        wrench[tool, 5] -= share * mz
    return work


@njit(cache=True, error_model="numpy")
def store_pairs(start, rows, pairs, force, slip, force_mean):
    """Forces, slips and mean forces back to (p, t, 3), each updated in place."""
    for tool in range(len(start) - 1):
        for pair in range(start[tool], start[tool + 1]):
            point = rows[pair, 0]
            for c in range(3):
                force[point, tool, c] = pairs[pair, FORCE + c]
                slip[point, tool, c] = pairs[pair, SLIP_SINCE + c]
                force_mean[point, tool, c] = pairs[pair, MEAN + c]
