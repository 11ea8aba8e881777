"""Contact of surface points with rigid tools at position level: exact non-penetration, Coulomb friction that sticks.

Each pair (point, tool) carries its force as blocks carry their stress: a normal part p >= 0 and a tangential part t.
With the gap g, the slip s of this substep relative to the tool, and the compliance c = h^2 sum w_i N_i^2 of the point,
p = max(0, p_old - (g - g_0)/c),  t = (t_old - s/c) min(1, mu p/|t_old - s/c|)                                 (1)
x_i += h^2 w_i N_i (df),  df = (p - p_old) n + (t - t_old)                                                     (2)
g_0 = 0 for points that were outside; a point that was handed over inside a tool comes out within some milliseconds,
g_0 = old gap/(1 + h/tau), because all at once would kick it. The forces stay in the nodes' accelerations from one
substep to the next, so at rest they are exact, the gap closes to zero and a sticking point does not creep. On a block
every point is one node and (1) is the exact local solution.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.tools.kernels import rotate, rotate_back, tool_gap, tool_reach

RELEASE = 0.005
"""time in which an old penetration falls to a third [s]"""
DEEP = 1e-9
"""penetrations below this are roundoff of a closed contact [m]"""


@njit(cache=True, error_model="numpy")
def find_pairs(kind, shape, position, orientation, point_x, active, force, margin, pair_start, pair_point, depth):
    """Pairs of an active point and a tool that touch or lie within margin [m], tool after tool.

    force       (p, t, 3)  carried contact forces [N]; a pair that carries one always counts
    pair_start  (t + 1,)   pairs pair_start[k] .. pair_start[k + 1] belong to tool k; updated in place
    pair_point  (p t,)     their points, updated in place
    depth       (p t,)     how deep each pair's point is inside the tool [m], updated in place
    """
    n_pairs = 0
    pair_start[0] = 0
    for tool in range(len(kind)):
        tool_shape, place, turn = shape[tool], position[tool], orientation[tool]
        # Cheap: outside the ball around the tool there is nothing to touch.
        reach = (margin + tool_reach(kind[tool], tool_shape)) ** 2
        for point in range(len(point_x)):
            if not active[point]:
                continue
            carried = force[point, tool, 0] != 0.0 or force[point, tool, 1] != 0.0 or force[point, tool, 2] != 0.0
            square = 0.0
            for c in range(3):
                square += (point_x[point, c] - place[c]) ** 2
            if square > reach and not carried:
                continue
            gap = tool_gap(kind[tool], tool_shape, place, turn, point_x[point])[0]
            if gap < margin or carried:
                pair_point[n_pairs] = point
                depth[n_pairs] = -gap if gap < -DEEP else 0.0
                n_pairs += 1
        pair_start[tool + 1] = n_pairs


@njit(cache=True, error_model="numpy")
def place_points(xw, indptr, node, weight, point_x):
    """Positions of the surface points, updated in place (p, 3) [m]."""
    for point in range(len(point_x)):
        for a in range(3):
            total = 0.0
            for entry in range(indptr[point], indptr[point + 1]):
                total += weight[entry] * xw[node[entry], a]
            point_x[point, a] = total


@njit(cache=True, error_model="numpy")
def split_forces(kind, shape, position, orientation, point_x, active, near_gap, force):
    """Share out the force of points that touch several tools but were handed over with one: force updated in place.

    Any shares with the same sum that lie in the friction cones balance as well. Here a further tool takes the part
    along its normal, as far as that pushes, and the first one keeps the rest.

    near_gap       a tool that is closer than this touches [m]
    force (p, t, 3)  one tool's entry per point is not zero
    """
    for point in range(len(point_x)):
        if not active[point]:
            continue
        first = -1
        for tool in range(len(kind)):
            if force[point, tool].any():
                first = tool
        if first < 0:
            continue
        f = force[point, first]
        for tool in range(len(kind)):
            if tool == first:
                continue
            gap, nx, ny, nz = tool_gap(kind[tool], shape[tool], position[tool], orientation[tool], point_x[point])
            push = f[0] * nx + f[1] * ny + f[2] * nz
            _, mx, my, mz = tool_gap(kind[first], shape[first], position[first], orientation[first], point_x[point])
            # Only the part that the first tool does not push itself.
            push -= max(0.0, f[0] * mx + f[1] * my + f[2] * mz) * max(0.0, nx * mx + ny * my + nz * mz)
            if gap < near_gap and push > 0.0:
                force[point, tool, 0], force[point, tool, 1], force[point, tool, 2] = push * nx, push * ny, push * nz
                f[0] -= push * nx
                f[1] -= push * ny
                f[2] -= push * nz


@njit(cache=True, error_model="numpy")
def carry_point(position, orientation, position_next, orientation_next, point):
    """Where a point that is fixed to a tool moves when the tool goes from one pose to the next."""
    if (
        orientation[0] == orientation_next[0]
        and orientation[1] == orientation_next[1]
        and orientation[2] == orientation_next[2]
        and orientation[3] == orientation_next[3]
    ):
        return (
            point[0] + (position_next[0] - position[0]),
            point[1] + (position_next[1] - position[1]),
            point[2] + (position_next[2] - position[2]),
        )
    x, y, z = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    x, y, z = rotate(orientation_next, x, y, z)
    return position_next[0] + x, position_next[1] + y, position_next[2] + z


@njit(cache=True, error_model="numpy")
def project_contacts(
    xw,
    x_prev,
    indptr,
    node,
    weight,
    point_softness,
    pair_start,
    pair_point,
    depth,
    kind,
    shape,
    friction,
    position,
    orientation,
    position_prev,
    orientation_prev,
    force,
    slipped,
    h,
):
    """Solve (1) and (2) for each pair once, in order.

    xw              (n + 8, 4)  positions and inverse masses; positions updated in place
    x_prev          (n, 3)      positions at the start of the substep
    point_softness  (p,)        sum w_i N_i^2 [1/kg]
    depth           (p t,)      how deep each pair was at the start of the step [m]
    position ...    (t, 3)      poses at the end of the substep, and at its start (_prev)
    force           (p, t, 3)   carried force on the point [N], updated in place
    slipped         (p, t, 3)   slip of each pair in this substep relative to the tool [m], overwritten where it touches
    """
    x = np.empty(3)
    x_old = np.empty(3)
    hh = h * h
    for tool in range(len(kind)):
        # Views are made once a tool: each costs as much as the arithmetic of a pair.
        tool_kind, tool_shape, mu = kind[tool], shape[tool], friction[tool]
        place, turn, place_prev, turn_prev = (
            position[tool],
            orientation[tool],
            position_prev[tool],
            orientation_prev[tool],
        )
        for pair in range(pair_start[tool], pair_start[tool + 1]):
            point = pair_point[pair]
            begin, end = indptr[point], indptr[point + 1]
            x[0], x[1], x[2] = 0.0, 0.0, 0.0
            for entry in range(begin, end):
                i, n = node[entry], weight[entry]
                x[0] += n * xw[i, 0]
                x[1] += n * xw[i, 1]
                x[2] += n * xw[i, 2]
            gap, nx, ny, nz = tool_gap(tool_kind, tool_shape, place, turn, x)
            old_x, old_y, old_z = force[point, tool, 0], force[point, tool, 1], force[point, tool, 2]
            if gap >= 0.0 and old_x == 0.0 and old_y == 0.0 and old_z == 0.0:
                continue
            c = hh * point_softness[point]
            old_n = max(0.0, old_x * nx + old_y * ny + old_z * nz)
            p = max(0.0, old_n - gap / c) if c > 0.0 else 0.0
            fx, fy, fz = 0.0, 0.0, 0.0
            sx, sy, sz = 0.0, 0.0, 0.0
            if p > 0.0:
                x_old[0], x_old[1], x_old[2] = 0.0, 0.0, 0.0
                for entry in range(begin, end):
                    i, n = node[entry], weight[entry]
                    x_old[0] += n * x_prev[i, 0]
                    x_old[1] += n * x_prev[i, 1]
                    x_old[2] += n * x_prev[i, 2]
                if depth[pair] > 0.0:
                    start = tool_gap(tool_kind, tool_shape, place_prev, turn_prev, x_old)[0]
                    p = max(0.0, old_n - (gap - min(0.0, start) / (1.0 + h / RELEASE)) / c)
                cx, cy, cz = carry_point(place_prev, turn_prev, place, turn, x_old)
                sx, sy, sz = x[0] - cx, x[1] - cy, x[2] - cz
                sn = sx * nx + sy * ny + sz * nz
                sx, sy, sz = sx - sn * nx, sy - sn * ny, sz - sn * nz
                tx, ty, tz = old_x - old_n * nx - sx / c, old_y - old_n * ny - sy / c, old_z - old_n * nz - sz / c
                tn = tx * nx + ty * ny + tz * nz
                tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
                size = np.sqrt(tx * tx + ty * ty + tz * tz)
                bound = mu * p
                scale = 1.0 if size <= bound else bound / size
                fx, fy, fz = p * nx + scale * tx, p * ny + scale * ty, p * nz + scale * tz
            dx, dy, dz = fx - old_x, fy - old_y, fz - old_z
            # The part of the correction along the surface changes the slip that remains.
            dn = dx * nx + dy * ny + dz * nz
            slipped[point, tool, 0] = sx + c * (dx - dn * nx)
            slipped[point, tool, 1] = sy + c * (dy - dn * ny)
            slipped[point, tool, 2] = sz + c * (dz - dn * nz)
            force[point, tool, 0], force[point, tool, 1], force[point, tool, 2] = fx, fy, fz
            for entry in range(begin, end):
                i = node[entry]
                step = hh * xw[i, 3] * weight[entry]
                xw[i, 0] += step * dx
                xw[i, 1] += step * dy
                xw[i, 2] += step * dz
