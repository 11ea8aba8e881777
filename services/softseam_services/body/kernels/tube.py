"""Points of a tube around a line of particles."""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def tube_points(x, radius, ring, points):
    """Rings about particles x (n, 3), square to the line; `ring` points each into points (ring n, 3), in place.

    The frame is carried along the line by the least turn from one tangent to the next, so that the tube does not twist.
    """
    n = len(x)
    ux, uy, uz = 0.0, 0.0, 0.0
    for i in range(n):
        before, after = max(i - 1, 0), min(i + 1, n - 1)
        tx, ty, tz = x[after, 0] - x[before, 0], x[after, 1] - x[before, 1], x[after, 2] - x[before, 2]
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        if length > 0.0:
            tx, ty, tz = tx / length, ty / length, tz / length
        else:
            tx, ty, tz = 1.0, 0.0, 0.0
        along = ux * tx + uy * ty + uz * tz
        ux, uy, uz = ux - along * tx, uy - along * ty, uz - along * tz
        size = np.sqrt(ux * ux + uy * uy + uz * uz)
        if size < 1e-6:  # the first ring, or a line that turns back on itself: any vector across will do
            if abs(tz) < 0.8:
                ux, uy, uz = -tz * tx, -tz * ty, 1.0 - tz * tz
            else:
                ux, uy, uz = 1.0 - tx * tx, -tx * ty, -tx * tz
            size = np.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / size, uy / size, uz / size
        vx, vy, vz = ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux
        for k in range(ring):
            angle = 2.0 * np.pi * k / ring
            c, s = radius * np.cos(angle), radius * np.sin(angle)
            points[ring * i + k, 0] = x[i, 0] + c * ux + s * vx
            points[ring * i + k, 1] = x[i, 1] + c * uy + s * vy
            points[ring * i + k, 2] = x[i, 2] + c * uz + s * vz
