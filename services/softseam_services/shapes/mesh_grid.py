"""Signed distance to a closed mesh from values on a grid: tricubic, with a continuous gradient.

Along each axis the value between grid points 1 and 2 of four is the cubic through them whose slopes there are the
central differences (Catmull-Rom; Keys 1981, IEEE Trans. Acoust. 29, 1153, eq. 4 with a = -1/2): where the distance is
smooth the value is accurate to third order in the spacing, and exact where it is linear, as beside a flat face. A sharp
edge of the mesh is rounded by about half a spacing.

The numbers of the shape hold it all: half edges of the mesh's bounding box, the grid's first point, spacing, counts,
then the values with the last axis fastest.
"""

import numpy as np

from softseam_services.jit import njit

HALF, ORIGIN, SPACING, COUNTS, VALUES = 0, 3, 6, 7, 10
"""where in the row they start"""


@njit(cache=True, error_model="numpy", forceinline=True)
def _weights(t):
    """Catmull-Rom weights of four values at t in [0, 1] between the middle two, and their derivatives."""
    tt = t * t
    ttt = tt * t
    return (
        (
            0.5 * (-t + 2.0 * tt - ttt),
            0.5 * (2.0 - 5.0 * tt + 3.0 * ttt),
            0.5 * (t + 4.0 * tt - 3.0 * ttt),
            0.5 * (ttt - tt),
        ),
        (
            0.5 * (-1.0 + 4.0 * t - 3.0 * tt),
            0.5 * (-10.0 * t + 9.0 * tt),
            0.5 * (1.0 + 8.0 * t - 9.0 * tt),
            0.5 * (3.0 * tt - 2.0 * t),
        ),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _hold(shape, axis, at):
    """A coordinate on the grid in spacings, held where four values are around it; and how far beyond it was [m]."""
    u = (at - shape[ORIGIN + axis]) / shape[SPACING]
    held = min(max(u, 1.0), shape[COUNTS + axis] - 2.0)
    return held, (u - held) * shape[SPACING]


@njit(cache=True, error_model="numpy")
def grid_gap(shape, x, y, z):
    """Gap and outward unit normal at a point of the tool's frame; the normal is the gradient's direction.

    Beyond the grid, which ends well outside the mesh, the gap is the distance to the point of the surface that is
    nearest to the closest point of the grid: never too small, and continuous where the grid ends.
    """
    n1, n2 = int(shape[COUNTS + 1]), int(shape[COUNTS + 2])
    u, beyond_x = _hold(shape, 0, x)
    v, beyond_y = _hold(shape, 1, y)
    w, beyond_z = _hold(shape, 2, z)
    i0, j0 = min(int(u), int(shape[COUNTS]) - 3), min(int(v), n1 - 3)
    k0 = min(int(w), n2 - 3)
    ax, bx = _weights(u - i0)
    ay, by = _weights(v - j0)
    az, bz = _weights(w - k0)
    gap = gx = gy = gz = 0.0
    for i in range(4):
        for j in range(4):
            row = VALUES + ((i0 - 1 + i) * n1 + j0 - 1 + j) * n2 + k0 - 1
            v0, v1, v2, v3 = shape[row], shape[row + 1], shape[row + 2], shape[row + 3]
            value = az[0] * v0 + az[1] * v1 + az[2] * v2 + az[3] * v3
            slope = bz[0] * v0 + bz[1] * v1 + bz[2] * v2 + bz[3] * v3
            gap += ax[i] * ay[j] * value
            gx += bx[i] * ay[j] * value
            gy += ax[i] * by[j] * value
            gz += ax[i] * ay[j] * slope
    size = np.sqrt(gx * gx + gy * gy + gz * gz)
    if size == 0.0:
        nx, ny, nz = 0.0, 0.0, 1.0
    else:
        nx, ny, nz = gx / size, gy / size, gz / size
    if beyond_x == 0.0 and beyond_y == 0.0 and beyond_z == 0.0:
        return gap, nx, ny, nz
    rx, ry, rz = beyond_x + gap * nx, beyond_y + gap * ny, beyond_z + gap * nz
    gap = np.sqrt(rx * rx + ry * ry + rz * rz)
    return gap, rx / gap, ry / gap, rz / gap
