"""The triangle of a surface that is nearest to a point, of `softseam_coupling.interfaces.contact`."""

import numpy as np

from softseam_coupling.kept_kernels import njit

LEVEL = 1e-9
"""of a distance's square: triangles so nearly as near count as alike"""
_FACING = 0.3
"""least cosine between a point's normal and the opposite of a triangle's that it may touch"""
UNIT, MIDDLE, RADIUS = 0, 3, 6
N_OF_FACE = 7
"""of a triangle: its unit normal, its middle [m], how far its corners are from there at most [m]"""
EVERY = -1
"""of how many triangles are listed for a point: all of the surface are to be tried"""


@njit(cache=True, error_model="numpy", forceinline=True)
def _nearest_in(px, py, pz, ax, ay, az, bx, by, bz, cx, cy, cz):
    """Weights of the second and third corner in the place of a triangle that is nearest to p.

    C. Ericson, Real-Time Collision Detection (2005), 5.1.5, by the regions of Voronoi of its corners and sides.
    """
    bx, by, bz, cx, cy, cz, px, py, pz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az, px - ax, py - ay, pz - az
    d1, d2 = bx * px + by * py + bz * pz, cx * px + cy * py + cz * pz
    bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    d3, d4, d5, d6 = d1 - bb, d2 - bc, d1 - bc, d2 - cc
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0
    if d3 >= 0.0 and d4 <= d3:
        return 1.0, 0.0
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 1.0
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return d1 / (d1 - d3), 0.0
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return 0.0, d2 / (d2 - d6)
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1.0 - v, v
    below = 1.0 / (va + vb + vc)
    return vb * below, vc * below


@njit(cache=True, error_model="numpy")
def point_normals(x, triangles, normals):
    """normals (n, 3) <- unit vectors out of a surface at its points x (n, 3), means of its triangles (t, 3) by area."""
    faces = np.empty((len(triangles), N_OF_FACE))
    look_at_surface(x, triangles, faces, normals)


@njit(cache=True, error_model="numpy")
def look_at_surface(x, triangles, faces, normals):
    """faces (t, N_OF_FACE) <- of the triangles (t, 3) of a surface with points x (n, 3) [m]; normals (n, 3) <- unit
    vectors out of it at the points, means of the triangles' by area."""
    normals[:] = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = x[i, 0], x[i, 1], x[i, 2]
        bx, by, bz, cx, cy, cz = x[j, 0] - ax, x[j, 1] - ay, x[j, 2] - az, x[k, 0] - ax, x[k, 1] - ay, x[k, 2] - az
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        for corner in range(3):
            point = triangles[t, corner]
            normals[point, 0] += nx
            normals[point, 1] += ny
            normals[point, 2] += nz
        size = np.sqrt(nx * nx + ny * ny + nz * nz)
        faces[t, UNIT], faces[t, UNIT + 1], faces[t, UNIT + 2] = nx / size, ny / size, nz / size
        mx, my, mz = (bx + cx) / 3.0, (by + cy) / 3.0, (bz + cz) / 3.0
        faces[t, MIDDLE], faces[t, MIDDLE + 1], faces[t, MIDDLE + 2] = ax + mx, ay + my, az + mz
        square = mx * mx + my * my + mz * mz
        square = max(square, (bx - mx) ** 2 + (by - my) ** 2 + (bz - mz) ** 2)
        faces[t, RADIUS] = np.sqrt(max(square, (cx - mx) ** 2 + (cy - my) ** 2 + (cz - mz) ** 2))
    for n in range(len(x)):
        size = np.sqrt(normals[n, 0] ** 2 + normals[n, 1] ** 2 + normals[n, 2] ** 2)
        if size > 0.0:
            for k in range(3):
                normals[n, k] /= size


@njit(cache=True, error_model="numpy")
def nearest_faces(points, out, x, triangles, reach, deepest, face, share, beside, normal):
    """Of points (p, 3), on a surface with outward unit vectors out (p, 3), the nearest triangle that faces them of
    another surface, (t, 3) of corners at x (n, 3), within reach [m], behind which they are by no more than deepest [m]:
    a body that is passed has other sides.

    face (p,) <- its number, -1 where there is none; share (p, 3) <- weights of its corners in the nearest place; beside
    (p,) <- how far the point is from there along the triangle [m]; normal (p, 3) <- the triangle's, out of the surface.
    Of triangles that are as near, at an edge, that counts across which the point is farthest.
    """
    p = len(points)
    faces, normals = np.empty((len(triangles), N_OF_FACE)), np.empty((len(x), 3))
    look_at_surface(x, triangles, faces, normals)
    counts, listed, last = np.full(p, EVERY, dtype=np.int32), np.empty((p, 0), dtype=np.int32), np.empty(p, np.int32)
    last[:] = -1
    near = np.arange(p).astype(np.int32)
    nearest_listed(points, out, near, counts, listed, last, x, triangles, faces, reach, deepest, share, beside)
    for i in range(p):
        face[i] = last[i]
        if last[i] >= 0:
            for k in range(3):
                normal[i, k] = faces[last[i], UNIT + k]


@njit(cache=True, error_model="numpy", forceinline=True)
def _faces(ox, oy, oz, faces, t):
    """Whether a triangle looks towards a point with this normal."""
    return faces[t, UNIT] * ox + faces[t, UNIT + 1] * oy + faces[t, UNIT + 2] * oz <= -_FACING


@njit(cache=True, error_model="numpy", forceinline=True)
def _away(px, py, pz, x, triangles, faces, t):
    """Of the place of a triangle that is nearest to p: weights of its corners, the distance's square [m^2], and how far
    p is across the triangle [m]."""
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    ax, ay, az, bx, by, bz = x[a, 0], x[a, 1], x[a, 2], x[b, 0], x[b, 1], x[b, 2]
    cx, cy, cz = x[c, 0], x[c, 1], x[c, 2]
    second, third = _nearest_in(px, py, pz, ax, ay, az, bx, by, bz, cx, cy, cz)
    first = 1.0 - second - third
    dx = px - (first * ax + second * bx + third * cx)
    dy = py - (first * ay + second * by + third * cy)
    dz = pz - (first * az + second * bz + third * cz)
    across = dx * faces[t, UNIT] + dy * faces[t, UNIT + 1] + dz * faces[t, UNIT + 2]
    return first, second, third, dx * dx + dy * dy + dz * dz, across


@njit(cache=True, error_model="numpy")
def nearest_listed(points, out, near, counts, listed, last, x, triangles, faces, reach, deepest, share, beside):
    """As `nearest_faces`, of the points near (n,) among (p, 3), where only some triangles come into question: for each
    the first counts (n,) of those listed (n, k), ascending, or `EVERY`.

    last (n,): the triangle that was nearest lately, -1 where there was none, which spares a look at others; <- the one
    that is. share (n, 3), beside (n,) are written where there is one. faces: of the triangles, by `look_at_surface`
    """
    for i in range(len(near)):
        point = near[i]
        px, py, pz = points[point, 0], points[point, 1], points[point, 2]
        ox, oy, oz = out[point, 0], out[point, 1], out[point, 2]
        every = counts[i] == EVERY
        n = len(triangles) if every else counts[i]
        best, most, found = reach * reach, -1.0, -1
        bound = reach
        lately, latest = last[i], (0.0, 0.0, 0.0, 0.0, 0.0)
        if lately >= 0:
            latest = _away(px, py, pz, x, triangles, faces, lately)
            if latest[3] < best and not latest[4] < -deepest and _faces(ox, oy, oz, faces, lately):
                bound = np.sqrt(latest[3])
        for k in range(n):
            t = k if every else listed[i, k]
            if not _faces(ox, oy, oz, faces, t):
                continue
            dx, dy, dz = px - faces[t, MIDDLE], py - faces[t, MIDDLE + 1], pz - faces[t, MIDDLE + 2]
            beyond = (faces[t, RADIUS] + bound) * (1.0 + LEVEL)
            if not dx * dx + dy * dy + dz * dz <= beyond * beyond:
                continue
            u, v, w, square, across = latest if t == lately else _away(px, py, pz, x, triangles, faces, t)
            if across < -deepest or not square <= best * (1.0 + LEVEL):
                continue
            if square >= best * (1.0 - LEVEL) and found >= 0 and abs(across) <= most * (1.0 + LEVEL):
                continue
            beside[i] = np.sqrt(max(0.0, square - across * across))
            if square < best:
                bound = min(bound, np.sqrt(square))
            best, most, found = min(best, square), abs(across), t
            share[i, 0], share[i, 1], share[i, 2] = u, v, w
        last[i] = found
