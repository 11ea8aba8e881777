"""Exact moments of a polyhedron inside each octant of a grid, by clipping its surface.

By the divergence theorem in z, for an octant with local coordinates s, t, w in [0, 1],
M_pqr = int s^p t^q w^r dV = sum over surface pieces of int s^p t^q W_r(w) n_z dA,  W_r = clamp(w, 0, 1)^(r+1)/(r+1) (1)
so that a piece inside the octant counts with its height, and a piece above it, in the same column, with height 1.
Pieces are triangles clipped to the octants. No ray is cast, so nothing depends on how rays meet edges.
"""

import numpy as np
from numpy.typing import NDArray

from softseam_services.jit import njit

_MAX_CORNERS = 16


def _triangle_rule():
    """Points (20, 2) and weights (20,), sum 1, of a collapsed Gauss rule of degree 7 on the unit triangle."""
    u, wu = np.polynomial.legendre.leggauss(5)
    v, wv = np.polynomial.legendre.leggauss(4)
    u, v = 0.5 * (u + 1.0), 0.5 * (v + 1.0)
    weights = np.outer(wu * (1.0 - u), wv)
    first = np.repeat(u, 4)
    return np.stack([first, (1.0 - first) * np.tile(v, 5)], axis=1), (weights / weights.sum()).ravel()


_RULE_POINTS, _RULE_WEIGHTS = _triangle_rule()


@njit(cache=True, error_model="numpy")
def _clip(polygon, n_corners, axis, plane, keep_above, out):
    """Part of a planar polygon on one side of a grid plane (Sutherland-Hodgman); returns the corners of `out`."""
    count = 0
    sign = 1.0 if keep_above else -1.0
    for a in range(n_corners):
        b = a + 1 if a + 1 < n_corners else 0
        da = sign * (polygon[a, axis] - plane)
        db = sign * (polygon[b, axis] - plane)
        if da >= 0.0:
            out[count] = polygon[a]
            count += 1
        if (da > 0.0 and db < 0.0) or (da < 0.0 and db > 0.0):
            t = da / (da - db)
            for c in range(3):
                out[count, c] = polygon[a, c] + t * (polygon[b, c] - polygon[a, c])
            out[count, axis] = plane
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _slab(polygon, n_corners, axis, index, work, out):
    """Part of a polygon between the grid planes index and index + 1; returns the corners of `out`."""
    count = _clip(polygon, n_corners, axis, float(index), True, work)
    if count < 3:
        return 0
    return _clip(work, count, axis, float(index + 1), False, out)


@njit(cache=True, error_model="numpy")
def _add_piece(polygon, n_corners, i, j, k, points, weights, inside, above):
    """Add a piece of surface that lies in octant (i, j, k): `inside` (27,) of it, `above` (9,) of those below it."""
    for corner in range(1, n_corners - 1):
        ax, ay, az = polygon[0, 0] - i, polygon[0, 1] - j, polygon[0, 2] - k
        bx, by, bz = polygon[corner, 0] - i, polygon[corner, 1] - j, polygon[corner, 2] - k
        cx, cy, cz = polygon[corner + 1, 0] - i, polygon[corner + 1, 1] - j, polygon[corner + 1, 2] - k
        area = 0.5 * ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
        if area == 0.0:
            continue
        for g in range(len(weights)):
            u, v = points[g, 0], points[g, 1]
            s = ax + u * (bx - ax) + v * (cx - ax)
            t = ay + u * (by - ay) + v * (cy - ay)
            w = az + u * (bz - az) + v * (cz - az)
            s_power = area * weights[g]
            for p in range(3):
                st_power = s_power
                for q in range(3):
                    above[p + 3 * q] += st_power
                    w_power = w
                    for r in range(3):
                        inside[p + 3 * q + 9 * r] += st_power * w_power / (r + 1.0)  # eq. (1)
                        w_power *= w
                    st_power *= t
                s_power *= s


@njit(cache=True, error_model="numpy")
def _octant_range(polygon, n_corners, axis, n_octants):
    """First and last octant along an axis that a polygon touches."""
    low, high = polygon[0, axis], polygon[0, axis]
    for a in range(1, n_corners):
        low = min(low, polygon[a, axis])
        high = max(high, polygon[a, axis])
    first = min(max(int(np.floor(low)), 0), n_octants - 1)
    last = min(max(int(np.ceil(high)) - 1, first), n_octants - 1)
    return first, last


@njit(cache=True, error_model="numpy")
def _moments(vertices, triangles, points, weights, moments, above):
    """Sum eq. (1) over all triangles, then down each column."""
    nx, ny, nz = above.shape[0], above.shape[1], above.shape[2]
    polygon = np.empty((3, 3))
    work = np.empty((_MAX_CORNERS, 3))
    column = np.empty((_MAX_CORNERS, 3))
    strip = np.empty((_MAX_CORNERS, 3))
    piece = np.empty((_MAX_CORNERS, 3))
    for triangle in range(len(triangles)):
        for a in range(3):
            polygon[a] = vertices[triangles[triangle, a]]
        first_i, last_i = _octant_range(polygon, 3, 0, nx)
        for i in range(first_i, last_i + 1):
            n_strip = _slab(polygon, 3, 0, i, work, strip)
            if n_strip < 3:
                continue
            first_j, last_j = _octant_range(strip, n_strip, 1, ny)
            for j in range(first_j, last_j + 1):
                n_column = _slab(strip, n_strip, 1, j, work, column)
                if n_column < 3:
                    continue
                first_k, last_k = _octant_range(column, n_column, 2, nz)
                for k in range(first_k, last_k + 1):
                    n_piece = _slab(column, n_column, 2, k, work, piece)
                    _add_piece(piece, n_piece, i, j, k, points, weights, moments[i, j, k], above[i, j, k])
    for i in range(nx):
        for j in range(ny):
            total = np.zeros(9)
            for k in range(nz - 1, -1, -1):
                for pq in range(9):
                    for r in range(3):
                        moments[i, j, k, pq + 9 * r] += total[pq] / (r + 1.0)
                    total[pq] += above[i, j, k, pq]


def octant_moments(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], n_octants: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Moments M_pqr of the solid inside each octant, eq. (1), p, q, r = 0 .. 2; M_000 is the filled fraction.

    vertices   (n, 3)  in units of the octants, within 0 .. n_octants
    triangles  (T, 3)  closed, counter-clockwise from outside
    n_octants  (3,)    octants of the grid per axis
    Returns (nx, ny, nz, 27), index p + 3 q + 9 r.
    """
    shape = (int(n_octants[0]), int(n_octants[1]), int(n_octants[2]))
    moments = np.zeros((*shape, 27))
    _moments(vertices, triangles, _RULE_POINTS, _RULE_WEIGHTS, moments, np.zeros((*shape, 9)))
    return moments
