"""Whether tools are images of each other in planes of symmetry, over a step.

A plane at c across an axis e takes a place x to S x + 2 c e, S = 1 - 2 e e^T.
"""

import numpy as np

from softseam_services.body.body import SAME
from softseam_services.jit import njit
from softseam_services.shapes.branches import PLANE
from softseam_services.tools.kernels import rotate, rotate_back


@njit(cache=True, error_model="numpy")
def _seen(orientation, image_of, axis, seen):
    """seen (3, 3) <- R'^T S R: the axes of a tool, mirrored, in the frame of another one."""
    for column in range(3):
        ux = 1.0 if column == 0 else 0.0
        uy = 1.0 if column == 1 else 0.0
        uz = 1.0 if column == 2 else 0.0
        vx, vy, vz = rotate(orientation, ux, uy, uz)
        if axis == 0:
            vx = -vx
        elif axis == 1:
            vy = -vy
        else:
            vz = -vz
        seen[0, column], seen[1, column], seen[2, column] = rotate_back(image_of, vx, vy, vz)


@njit(cache=True, error_model="numpy")
def _fits(sameness, seen):
    """Whether a shape looks the same after `seen` (3, 3), by its row of `ToolSet.sameness`."""
    if np.isnan(sameness[0]):
        return False
    away = 0.0
    for i in range(3):
        for j in range(3):
            if sameness[i] != sameness[j] and seen[i, j] * seen[i, j] > 2.0 * SAME:  # of the cosine that is left
                return False
        away += abs(seen[i, 0] * sameness[3] + seen[i, 1] * sameness[4] + seen[i, 2] * sameness[5] - sameness[3 + i])
    return away <= SAME


@njit(cache=True, error_model="numpy")
def tool_astray(
    kind, shape, sameness, axis, place, image, near, position, orientation, position_next, orientation_next
):
    """The first plane and tool that is not, from the start of a step to its end, what its image says; (-1, -1) where
    all are.

    axis (k,), place (k,) of each plane, image (k, t) each tool's; near: as close as places must be [m]
    """
    start, end = np.empty((3, 3)), np.empty((3, 3))
    for m in range(len(axis)):
        e = axis[m]
        for t in range(len(kind)):
            other = image[m, t]
            _seen(orientation[t], orientation[other], e, start)
            _seen(orientation_next[t], orientation_next[other], e, end)
            if not _fits(sameness[t], start):
                return m, t
            for i in range(3):
                for j in range(3):
                    if abs(end[i, j] - start[i, j]) > SAME:
                        return m, t
            across = 0.0
            nx, ny, nz = rotate(orientation[other], shape[t, 0], shape[t, 1], shape[t, 2])  # of a plane
            for i in range(3):
                sign, shift = (-1.0, 2.0 * place[m]) if i == e else (1.0, 0.0)
                away = sign * position[t, i] + shift - position[other, i]
                across += away * (nx if i == 0 else (ny if i == 1 else nz))
                way, ways = position_next[t, i] - position[t, i], position_next[other, i] - position[other, i]
                if abs(sign * way - ways) > near or (kind[t] != PLANE and abs(away) > near):
                    return m, t
            if kind[t] == PLANE and abs(across) > near:
                return m, t
    return -1, -1
