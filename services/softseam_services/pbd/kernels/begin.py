"""How a step begins: which tools go by slowly, edges of patches, a shape for a body that has none, and
forces that were handed over."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import tool_gap

from .trust import COLLAPSED


@njit(cache=True, error_model="numpy")
def find_slow(mass, v, position, position_next, dt, least, slow):
    """slow (t,) <- whether tools go, or go by, less than `least` [m] in a step of dt [s], as the world or the body sees
    them, in place. So one at rest is slow, whatever falls on it: its law does not change while it is touched.

    mass (n,) [kg], v (n, 3) [m/s]; position, position_next (t, 3) [m]
    """
    total, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    for i in range(len(mass)):
        total += mass[i]
        mx += mass[i] * v[i, 0]
        my += mass[i] * v[i, 1]
        mz += mass[i] * v[i, 2]
    for tool in range(len(slow)):
        x = position_next[tool, 0] - position[tool, 0]
        y = position_next[tool, 1] - position[tool, 1]
        z = position_next[tool, 2] - position[tool, 2]
        goes = np.sqrt(x * x + y * y + z * z)
        x, y, z = x - dt * mx / total, y - dt * my / total, z - dt * mz / total
        slow[tool] = min(goes, np.sqrt(x * x + y * y + z * z)) < least


@njit(cache=True, error_model="numpy")
def give_shape(x, x_rest):
    """x (n, 3) [m] of a body that has collapsed into a point, larger by `COLLAPSED` of its size at rest, in place."""
    for c in range(3):
        middle = 0.0
        for i in range(len(x)):
            middle += x_rest[i, c]
        middle /= len(x)
        for i in range(len(x)):
            x[i, c] += COLLAPSED * (x_rest[i, c] - middle)


@njit(cache=True, error_model="numpy")
def find_patches(model, parameters, x, patch):
    """patch (p, 2, 3) [m] <- edges of the patch of each point inside a face, where nodes are at x (n, 3); in place.

    By them tools with edges that press there are felt in part.
    """
    if not parameters.places.any():
        return
    indptr, node, tilt = model.indptr, model.node, parameters.tilt
    for point in range(model.n_surface, len(patch)):
        patch[point] = 0.0
        for entry in range(indptr[point], indptr[point + 1]):
            i = node[entry]
            for c in range(3):
                patch[point, 0, c] += tilt[entry, 0] * x[i, c]
                patch[point, 1, c] += tilt[entry, 1] * x[i, c]


@njit(cache=True, error_model="numpy")
def split_forces(kind, shape, position, orientation, point_x, touches, near_gap, force):
    """Share out the force of points that touch several tools but were handed over with one: force updated in place.

    Any shares with the same sum that lie in the friction cones balance as well. Here a further tool takes the part
    along its normal, as far as that pushes, and the first one keeps the rest. Points of coarse cells have forces of
    their neighbours as well, tool by tool (`points.hand_on`): the largest is shared out, the others gain or stay.

    near_gap       a tool that is closer than this touches [m]
    force (p, t, 3)  [N]
    """
    for point in range(len(point_x)):
        first, most = -1, 0.0
        for tool in range(len(kind)):
            size = force[point, tool, 0] ** 2 + force[point, tool, 1] ** 2 + force[point, tool, 2] ** 2
            if size > most:
                first, most = tool, size
        if first < 0:
            continue
        f = force[point, first]
        for tool in range(len(kind)):
            if tool == first or not touches[point, tool]:
                continue
            gap, nx, ny, nz = tool_gap(kind[tool], shape[tool], position[tool], orientation[tool], point_x[point])
            push = f[0] * nx + f[1] * ny + f[2] * nz
            _, mx, my, mz = tool_gap(kind[first], shape[first], position[first], orientation[first], point_x[point])
            # Only the part that the first tool does not push itself.
            push -= max(0.0, f[0] * mx + f[1] * my + f[2] * mz) * max(0.0, nx * mx + ny * my + nz * mz)
            if gap < near_gap and push > 0.0:
                force[point, tool, 0] += push * nx
                force[point, tool, 1] += push * ny
                force[point, tool, 2] += push * nz
                f[0] -= push * nx
                f[1] -= push * ny
                f[2] -= push * nz
