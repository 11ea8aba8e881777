"""How tools move within a step, and the points that are fixed to them."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import rotate, rotate_back

from .lanes import four, three


@njit(cache=True, error_model="numpy")
def tool_pose(fraction, position, orientation, position_next, orientation_next, position_out, orientation_out):
    """Poses at a fraction of the step: positions linear, quaternions linear and normalised; outputs in place."""
    for tool in range(len(position)):
        for a in range(3):
            position_out[tool, a] = (1.0 - fraction) * position[tool, a] + fraction * position_next[tool, a]
        dot = 0.0
        for a in range(4):
            dot += orientation[tool, a] * orientation_next[tool, a]
        sign = 1.0 if dot >= 0.0 else -1.0
        square = 0.0
        for a in range(4):
            q = (1.0 - fraction) * orientation[tool, a] + sign * fraction * orientation_next[tool, a]
            orientation_out[tool, a] = q
            square += q * q
        scale = 1.0 / np.sqrt(square)
        for a in range(4):
            orientation_out[tool, a] *= scale


@njit(cache=True, error_model="numpy")
def rigid_motion(place, turn, place_next, turn_next):
    """A row by row, then b (12 values): a point x of a tool goes to A x + b from one pose to the next (tuples)."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    if turn == turn_next:
        dx, dy, dz = place_next[0] - place[0], place_next[1] - place[1], place_next[2] - place[2]
        return xx, xy, xz, yx, yy, yz, zx, zy, zz, dx, dy, dz
    x, y, z = rotate_back(turn, 1.0, 0.0, 0.0)
    xx, yx, zx = rotate(turn_next, x, y, z)
    x, y, z = rotate_back(turn, 0.0, 1.0, 0.0)
    xy, yy, zy = rotate(turn_next, x, y, z)
    x, y, z = rotate_back(turn, 0.0, 0.0, 1.0)
    xz, yz, zz = rotate(turn_next, x, y, z)
    dx = place_next[0] - (xx * place[0] + xy * place[1] + xz * place[2])
    dy = place_next[1] - (yx * place[0] + yy * place[1] + yz * place[2])
    dz = place_next[2] - (zx * place[0] + zy * place[1] + zz * place[2])
    return xx, xy, xz, yx, yy, yz, zx, zy, zz, dx, dy, dz


@njit(cache=True, error_model="numpy")
def tool_motions(position, orientation, position_next, orientation_next, motion):
    """The `rigid_motion` of all tools forth (0) and back (1): motion (2, t, 12), updated in place."""
    for tool in range(len(position)):
        place, turn = three(position, tool), four(orientation, tool)
        place_next, turn_next = three(position_next, tool), four(orientation_next, tool)
        forth = rigid_motion(place, turn, place_next, turn_next)
        back = rigid_motion(place_next, turn_next, place, turn)
        for entry in range(12):
            motion[0, tool, entry] = forth[entry]
            motion[1, tool, entry] = back[entry]


@njit(cache=True, error_model="numpy", forceinline=True)
def twelve(motion, way, tool):
    """One of `tool_motions` as a tuple."""
    return (
        *(motion[way, tool, 0], motion[way, tool, 1], motion[way, tool, 2], motion[way, tool, 3]),
        *(motion[way, tool, 4], motion[way, tool, 5], motion[way, tool, 6], motion[way, tool, 7]),
        *(motion[way, tool, 8], motion[way, tool, 9], motion[way, tool, 10], motion[way, tool, 11]),
    )
