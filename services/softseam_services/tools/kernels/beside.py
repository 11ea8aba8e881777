"""On which side of planes and plates points are."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import PLANE
from softseam_services.shapes.turns import rotate_back


@njit(cache=True, error_model="numpy")
def find_sides(middle, kind, shape, holding, position, orientation, across):
    """across (b, t) <- how far points (b, 3) [m] are on one side of each tool that is to hold them, negative on the
    other; 0 inside a plate, NaN beside one, and of other tools [m].

    kind, shape  of the tools (t,), (t, 3 and more); holding: which of them are to hold each point (b, t)
    """
    for tool in range(len(kind)):
        thin = 0
        for axis in range(3):
            if shape[tool, axis] < shape[tool, thin]:
                thin = axis
        for body in range(len(middle)):
            across[body, tool] = np.nan
            if not holding[body, tool]:
                continue
            x, y, z = (
                middle[body, 0] - position[tool, 0],
                middle[body, 1] - position[tool, 1],
                middle[body, 2] - position[tool, 2],
            )
            at = rotate_back(orientation[tool], x, y, z)
            if kind[tool] == PLANE:
                across[body, tool] = at[0] * shape[tool, 0] + at[1] * shape[tool, 1] + at[2] * shape[tool, 2]
                continue
            beside = False
            for axis in range(3):
                beside = beside or (axis != thin and abs(at[axis]) > shape[tool, axis])
            if not beside:
                across[body, tool] = 0.0 if abs(at[thin]) <= shape[tool, thin] else at[thin]
