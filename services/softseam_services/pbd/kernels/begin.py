"""How a step begins: which tools go by slowly, and a shape for a body that has none."""

import numpy as np

from softseam_services.jit import njit

COLLAPSE_STEP = 1e-4
"""size, relative to rest, that a body without shape is given again"""


@njit(cache=True, error_model="numpy")
def find_slow(mass, v, position, position_next, dt, least, slow):
    """slow (t,) <- whether tools go by less than `least` [m] in a step of dt [s], as the body sees them, in place.

    mass (n,) [kg], v (n, 3) [m/s]; position, position_next (t, 3) [m]
    """
    total, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    for i in range(len(mass)):
        total += mass[i]
        mx += mass[i] * v[i, 0]
        my += mass[i] * v[i, 1]
        mz += mass[i] * v[i, 2]
    for tool in range(len(slow)):
        x = position_next[tool, 0] - position[tool, 0] - dt * mx / total
        y = position_next[tool, 1] - position[tool, 1] - dt * my / total
        z = position_next[tool, 2] - position[tool, 2] - dt * mz / total
        slow[tool] = np.sqrt(x * x + y * y + z * z) < least


@njit(cache=True, error_model="numpy")
def give_shape(x, x_rest):
    """x (n, 3) [m] of a body that has collapsed into a point, a little larger, in place."""
    for c in range(3):
        middle = 0.0
        for i in range(len(x)):
            middle += x_rest[i, c]
        middle /= len(x)
        for i in range(len(x)):
            x[i, c] += COLLAPSE_STEP * (x_rest[i, c] - middle)
