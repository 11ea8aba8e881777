"""The triangle of a surface that is nearest to a point, of `softseam_coupling.interfaces.contact`."""

import numpy as np

from softseam_coupling.kept_kernels import njit

_LEVEL = 1e-9
"""of a distance's square: triangles so nearly as near count as alike"""
_FACING = 0.3
"""least cosine between a point's normal and the opposite of a triangle's that it may touch"""


@njit(cache=True, error_model="numpy")
def _nearest_in(p, a, b, c):
    """Weights of the second and third corner in the place of a triangle that is nearest to p.

    C. Ericson, Real-Time Collision Detection (2005), 5.1.5, by the regions of Voronoi of its corners and sides.
    """
    d1 = d2 = bb = bc = cc = 0.0
    for k in range(3):
        ab, ac, ap = b[k] - a[k], c[k] - a[k], p[k] - a[k]
        d1, d2 = d1 + ab * ap, d2 + ac * ap
        bb, bc, cc = bb + ab * ab, bc + ab * ac, cc + ac * ac
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
    normals = np.empty((len(triangles), 3))
    for t in range(len(triangles)):
        a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
        size = 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            normals[t, k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])
            size += normals[t, k] ** 2
        for k in range(3):
            normals[t, k] /= np.sqrt(size)
    for i in range(len(points)):
        p = points[i]
        face[i], best, most = -1, reach * reach, -1.0
        for t in range(len(triangles)):
            nx, ny, nz = normals[t, 0], normals[t, 1], normals[t, 2]
            if nx * out[i, 0] + ny * out[i, 1] + nz * out[i, 2] > -_FACING:
                continue
            a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
            away = False
            for k in range(3):
                away = away or min(a[k], b[k], c[k]) - p[k] > reach or p[k] - max(a[k], b[k], c[k]) > reach
            if away:
                continue
            u, v = _nearest_in(p, a, b, c)
            w = 1.0 - u - v
            square, across = 0.0, 0.0
            for k in range(3):
                d = p[k] - (w * a[k] + u * b[k] + v * c[k])
                square += d * d
                across += d * normals[t, k]
            if square > best * (1.0 + _LEVEL):
                continue
            if square >= best * (1.0 - _LEVEL) and face[i] >= 0 and abs(across) <= most * (1.0 + _LEVEL):
                continue
            beside[i] = np.sqrt(max(0.0, square - across * across))
            best, most, face[i] = min(best, square), abs(across), t
            share[i, 0], share[i, 1], share[i, 2] = w, u, v
            normal[i, 0], normal[i, 1], normal[i, 2] = nx, ny, nz
