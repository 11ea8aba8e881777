"""The triangle of a surface that is nearest to a point, of `softseam_coupling.interfaces.contact`."""

import numpy as np

from softseam_coupling.kept_kernels import njit

_LEVEL = 1e-9
"""of a distance's square: triangles so nearly as near count as alike"""
_FACING = 0.3
"""least cosine between a point's normal and the opposite of a triangle's that it may touch"""


@njit(cache=True, error_model="numpy")
def _nearest_in(p, a, b, c, share):
    """share (3,) <- weights of the corners in the place of a triangle that is nearest to p (3,).

    C. Ericson, Real-Time Collision Detection (2005), 5.1.5, by the regions of Voronoi of its corners and sides.
    """
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    bp, cp = p - b, p - c
    d3, d4, d5, d6 = np.dot(ab, bp), np.dot(ac, bp), np.dot(ab, cp), np.dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    u = v = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        u = v = 0.0
    elif d3 >= 0.0 and d4 <= d3:
        u = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        v = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        u = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v = d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        u = 1.0 - v
    else:
        below = 1.0 / (va + vb + vc)
        u, v = vb * below, vc * below
    share[0], share[1], share[2] = 1.0 - u - v, u, v


@njit(cache=True, error_model="numpy")
def point_normals(x, triangles, normals):
    """normals (n, 3) <- unit vectors out of a surface at its points x (n, 3), means of its triangles (t, 3) by area."""
    normals[:] = 0.0
    for t in range(len(triangles)):
        a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            part = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])
            for corner in range(3):
                normals[triangles[t, corner], k] += part
    for n in range(len(x)):
        size = np.sqrt(normals[n, 0] ** 2 + normals[n, 1] ** 2 + normals[n, 2] ** 2)
        if size > 0.0:
            for k in range(3):
                normals[n, k] /= size


@njit(cache=True, error_model="numpy")
def nearest_faces(points, out, x, triangles, reach, face, share, beside, normal):
    """Of points (p, 3), on a surface with outward unit vectors out (p, 3), the nearest triangle that faces them of
    another surface, (t, 3) of corners at x (n, 3), within reach [m].

    face (p,) <- its number, -1 where there is none; share (p, 3) <- weights of its corners in the nearest place; beside
    (p,) <- how far the point is from there along the triangle [m]; normal (p, 3) <- the triangle's, out of the surface.
    Of triangles that are as near, at an edge, that counts across which the point is farthest.
    """
    own, side = np.empty(3), np.empty(3)
    for i in range(len(points)):
        p = points[i]
        face[i], best, most = -1, reach * reach, -1.0
        for t in range(len(triangles)):
            a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
            away = False
            for k in range(3):
                away = away or min(a[k], b[k], c[k]) - p[k] > reach or p[k] - max(a[k], b[k], c[k]) > reach
            if away:
                continue
            nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
            ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
            nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            size = np.sqrt(nx * nx + ny * ny + nz * nz)
            if nx * out[i, 0] + ny * out[i, 1] + nz * out[i, 2] > -_FACING * size:
                continue
            _nearest_in(p, a, b, c, own)
            square = 0.0
            for k in range(3):
                side[k] = p[k] - (own[0] * a[k] + own[1] * b[k] + own[2] * c[k])
                square += side[k] * side[k]
            if square > best * (1.0 + _LEVEL):
                continue
            across = (side[0] * nx + side[1] * ny + side[2] * nz) / size
            if square >= best * (1.0 - _LEVEL) and face[i] >= 0 and abs(across) <= most * (1.0 + _LEVEL):
                continue
            beside[i] = np.sqrt(max(0.0, square - across * across))
            best, most, face[i] = min(best, square), abs(across), t
            share[i, 0], share[i, 1], share[i, 2] = own[0], own[1], own[2]
            normal[i, 0], normal[i, 1], normal[i, 2] = nx / size, ny / size, nz / size
