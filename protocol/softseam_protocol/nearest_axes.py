"""Which of a body's own axes is called x, y and z: each the one next to the scene's."""

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

_BETTER = 1e-6
"""a sum of cosines that is larger by less is the same: of axes halfway between the scene's the first order is taken"""


def nearest_axes(axes: NDArray[np.float64]) -> list[int]:
    """The order in which orthogonal unit vectors, columns (3, 3) of either sign, lie next to x, y and z."""
    cosines = np.abs(axes)
    best, order = 0.0, [0, 1, 2]
    for candidate in permutations(range(3)):
        found = float(sum(cosines[axis, column] for axis, column in enumerate(candidate)))
        if found > best + _BETTER:
            best, order = found, list(candidate)
    return order
