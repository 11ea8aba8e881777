"""Patches inside faces of blocks that a flat face of a tool covers: they touch its plane, and yield by 1/r_c.

All others yield as under what is round (tools/kernels/patch.py).
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.face_points import PATCHES
from softseam_services.tools.kernels import FLAT, cover_patch, has_flats

from .pairs import FIRM, follow

_NEAR = 5.0
"""half a block, in margins of contact: so far from a tool's reach middles of patches are looked at"""


@njit(cache=True, error_model="numpy")
def find_patch_shares(model, parameters, x, position, orientation, slow, shares):
    """`Shares` of points inside faces, by tools that are no boxes, where body and tools stand; in place.

    x (n, 3) positions of the nodes [m]; position (t, 3) and orientation (t, 4) as in `tool_gap`; slow (t,): tools that
    do not go by a patch before the step ends. Others would cover other patches then, and cut into what yields more than
    under what is flat: they are met by their gap.
    """
    indptr, node, weight = model.indptr, model.node, parameters.weight
    kind, shape, side = parameters.kind, parameters.shape, shares.side
    first = len(model.touches) - len(model.outward)
    middle, u, v = np.empty(3), np.empty(3), np.empty(3)
    for point in range(first, len(model.touches)):
        middle[0], middle[1], middle[2] = follow(indptr[point], indptr[point + 1], node, weight, x)
        number = (point - first) % PATCHES**2
        up, on = 1 - 2 * (number // PATCHES % 2), 1 - 2 * (number % 2)
        there, beside = point + PATCHES * up, point + on
        for tool in range(len(kind)):
            side[point, tool] = -1
            if not model.touches[point, tool]:
                continue
            if not slow[tool]:
                side[point, tool] = FIRM
                shares.give[point, tool] = parameters.point_give[point]
                continue
            if not has_flats(kind[tool]):
                continue
            away, reach = 0.0, parameters.reach[tool] + _NEAR * parameters.margin
            for i in range(3):
                away += (middle[i] - position[tool, i]) ** 2
            if away > reach * reach:
                continue
            u[0], u[1], u[2] = follow(indptr[there], indptr[there + 1], node, weight, x)
            v[0], v[1], v[2] = follow(indptr[beside], indptr[beside + 1], node, weight, x)
            for i in range(3):
                u[i], v[i] = up * (u[i] - middle[i]), on * (v[i] - middle[i])
            firm = cover_patch(
                kind[tool], shape[tool], position[tool], orientation[tool], middle, u, v, model.outward[point - first],
                shares.plane[point, tool],
            )  # fmt: skip
            if firm > 0.0:
                side[point, tool] = FLAT
                shares.give[point, tool] = parameters.point_give[point] / firm
