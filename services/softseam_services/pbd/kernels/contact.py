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

from softseam_services.tools.kernels import tool_gap

from .pairs import ALLOWED, ANCHOR, FORCE, GIVE, SLIPPED, follow, four, three


@njit(cache=True, error_model="numpy")
def project_contacts(xw, node, weight, kind, shape, friction, position, orientation, hh, start, rows, pairs):
    """Solve (1) and (2) for each pair once, in order.

    xw                      (n + 8, 4)      positions and inverse masses; positions updated in place
    position, orientation   (t, 3), (t, 4)  poses at the end of the substep
    hh                                      the substep squared [s^2]
    start, rows, pairs                      see `pairs`; FORCE and SLIPPED are updated in place
    """
    for tool in range(len(kind)):
        tool_kind, tool_shape, mu = kind[tool], shape[tool], friction[tool]
        place, turn = three(position, tool), four(orientation, tool)
        for pair in range(start[tool], start[tool + 1]):
            begin, end = rows[pair, 1], rows[pair, 2]
            x = follow(begin, end, node, weight, xw)
            gap, nx, ny, nz = tool_gap(tool_kind, tool_shape, place, turn, x)
            old_x, old_y, old_z = pairs[pair, FORCE], pairs[pair, FORCE + 1], pairs[pair, FORCE + 2]
            if gap >= 0.0 and old_x == 0.0 and old_y == 0.0 and old_z == 0.0:
                continue
            c, per_c = pairs[pair, GIVE], pairs[pair, GIVE + 1]
            old_n = max(0.0, old_x * nx + old_y * ny + old_z * nz)
            p = max(0.0, old_n - (gap - pairs[pair, ALLOWED]) * per_c) if c > 0.0 else 0.0
            fx, fy, fz = 0.0, 0.0, 0.0
            sx, sy, sz = 0.0, 0.0, 0.0
            if p > 0.0:
                sx, sy, sz = x[0] - pairs[pair, ANCHOR], x[1] - pairs[pair, ANCHOR + 1], x[2] - pairs[pair, ANCHOR + 2]
                sn = sx * nx + sy * ny + sz * nz
                sx, sy, sz = sx - sn * nx, sy - sn * ny, sz - sn * nz
                tx = old_x - old_n * nx - sx * per_c
                ty = old_y - old_n * ny - sy * per_c
                tz = old_z - old_n * nz - sz * per_c
                tn = tx * nx + ty * ny + tz * nz
                tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
                square, bound = tx * tx + ty * ty + tz * tz, mu * p
                scale = 1.0 if square <= bound * bound else bound / np.sqrt(square)
                fx, fy, fz = p * nx + scale * tx, p * ny + scale * ty, p * nz + scale * tz
            dx, dy, dz = fx - old_x, fy - old_y, fz - old_z
            # The part of the correction along the surface changes the slip that remains.
            dn = dx * nx + dy * ny + dz * nz
            pairs[pair, SLIPPED] = sx + c * (dx - dn * nx)
            pairs[pair, SLIPPED + 1] = sy + c * (dy - dn * ny)
            pairs[pair, SLIPPED + 2] = sz + c * (dz - dn * nz)
            pairs[pair, FORCE], pairs[pair, FORCE + 1], pairs[pair, FORCE + 2] = fx, fy, fz
            for entry in range(begin, end):
                i = node[entry]
                step = hh * xw[i, 3] * weight[entry]
                xw[i, 0] += step * dx
                xw[i, 1] += step * dy
                xw[i, 2] += step * dz
