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

from softseam_services.tools.kernels import rotate, rotate_back, tool_gap
from softseam_services.tools.tool_set import PLANE

RELEASE = 0.005
"""time in which an old penetration falls to a third [s]"""


@njit(cache=True, error_model="numpy")
def find_pairs(kind, shape, position, orientation, point_x, active, force, margin, pair_point, pair_tool, depth):
    """Pairs of an active point and a tool that touch or lie within margin [m]; returns their number.

    force  (p, t, 3)  carried contact forces [N]; a pair that carries one always counts
    depth  (p t,)     how deep each pair's point is inside the tool [m], overwritten for the pairs found
    """
    n_pairs = 0
    for point in range(len(point_x)):
        if not active[point]:
            continue
        for tool in range(len(kind)):
            if kind[tool] != PLANE:
                # Cheap: outside the ball around the tool there is nothing to touch.
                radius = margin + np.sqrt(shape[tool, 0] ** 2 + shape[tool, 1] ** 2 + shape[tool, 2] ** 2)
                square = 0.0
                for c in range(3):
                    square += (point_x[point, c] - position[tool, c]) ** 2
                if square > radius * radius and not force[point, tool].any():
                    continue
            gap = tool_gap(kind[tool], shape[tool], position[tool], orientation[tool], point_x[point])[0]
            carried = force[point, tool, 0] != 0.0 or force[point, tool, 1] != 0.0 or force[point, tool, 2] != 0.0
            if gap < margin or carried:
                pair_point[n_pairs] = point
                pair_tool[n_pairs] = tool
                depth[n_pairs] = max(0.0, -gap)
                n_pairs += 1
    return n_pairs


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
    n_pairs,
    pair_point,
    pair_tool,
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

    xw            (n + 8, 4)  positions and inverse masses; positions updated in place
    x_prev        (n, 3)      positions at the start of the substep
    position ...  (t, 3)      poses at the end of the substep, and at its start (_prev)
    force         (p, t, 3)   carried force on the point [N], updated in place
    slipped       (p, t, 3)   slip of each pair in this substep relative to the tool [m], overwritten where it touches
    """
    x = np.empty(3)
    x_old = np.empty(3)
    for pair in range(n_pairs):
        point, tool = pair_point[pair], pair_tool[pair]
        compliance = 0.0
        x[:] = 0.0
        x_old[:] = 0.0
        for entry in range(indptr[point], indptr[point + 1]):
            i = node[entry]
            compliance += weight[entry] * weight[entry] * xw[i, 3]
            for a in range(3):
                x[a] += weight[entry] * xw[i, a]
                x_old[a] += weight[entry] * x_prev[i, a]
        f = force[point, tool]
        slipped[point, tool] = 0.0
        if compliance == 0.0:
            f[:] = 0.0
            continue
        c = h * h * compliance
        gap, nx, ny, nz = tool_gap(kind[tool], shape[tool], position[tool], orientation[tool], x)
        old_n = max(0.0, f[0] * nx + f[1] * ny + f[2] * nz)
        p = max(0.0, old_n - gap / c)
        if p > 0.0:
            start = tool_gap(kind[tool], shape[tool], position_prev[tool], orientation_prev[tool], x_old)[0]
            p = max(0.0, old_n - (gap - min(0.0, start) / (1.0 + h / RELEASE)) / c)
        fx, fy, fz = 0.0, 0.0, 0.0
        if p > 0.0:
            cx, cy, cz = carry_point(
                position_prev[tool], orientation_prev[tool], position[tool], orientation[tool], x_old
            )
            sx, sy, sz = x[0] - cx, x[1] - cy, x[2] - cz
            sn = sx * nx + sy * ny + sz * nz
            sx, sy, sz = sx - sn * nx, sy - sn * ny, sz - sn * nz
            tx, ty, tz = f[0] - old_n * nx - sx / c, f[1] - old_n * ny - sy / c, f[2] - old_n * nz - sz / c
            tn = tx * nx + ty * ny + tz * nz
            tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
            size = np.sqrt(tx * tx + ty * ty + tz * tz)
            bound = friction[tool] * p
            scale = 1.0 if size <= bound else bound / size
            fx, fy, fz = p * nx + scale * tx, p * ny + scale * ty, p * nz + scale * tz
        dx, dy, dz = fx - f[0], fy - f[1], fz - f[2]
        if p > 0.0:
            # The part of the correction along the surface changes the slip that remains.
            dn = dx * nx + dy * ny + dz * nz
            slipped[point, tool, 0] = sx + c * (dx - dn * nx)
            slipped[point, tool, 1] = sy + c * (dy - dn * ny)
            slipped[point, tool, 2] = sz + c * (dz - dn * nz)
        f[0], f[1], f[2] = fx, fy, fz
        for entry in range(indptr[point], indptr[point + 1]):
            i = node[entry]
            step = h * h * xw[i, 3] * weight[entry]
            xw[i, 0] += step * dx
            xw[i, 1] += step * dy
            xw[i, 2] += step * dz
