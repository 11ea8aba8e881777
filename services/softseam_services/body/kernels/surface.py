"""Loops over triangles that find where a surface crosses itself."""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def _side(a, b, c, d):
    """Six times the signed volume of the tetrahedron a b c d (each (3,)); > 0 where d is above the triangle a b c."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    return wx * (uy * vz - uz * vy) + wy * (uz * vx - ux * vz) + wz * (ux * vy - uy * vx)


@njit(cache=True, error_model="numpy")
def crosses(p, q, a, b, c, tolerance):
    """Whether the segment p q passes from one side of the triangle a b c to the other, through it.

    tolerance: volumes below it count as zero; a segment that only touches the triangle does not cross it.
    """
    below, above = _side(a, b, c, p), _side(a, b, c, q)
    if not ((below < -tolerance and above > tolerance) or (below > tolerance and above < -tolerance)):
        return False
    s, t, u = _side(p, q, a, b), _side(p, q, b, c), _side(p, q, c, a)
    # An edge of the triangle met exactly counts: two boxes that overlap cross only there.
    return (s >= 0.0 and t >= 0.0 and u >= 0.0) or (s <= 0.0 and t <= 0.0 and u <= 0.0)


@njit(cache=True, error_model="numpy")
def grid_triangles(low, high, origin, spacing, counts, start, entries, fill):
    """Bin triangles by bounding box: counts them into start (fill False), or enters them (fill True).

    low, high (T, 3); start (cells + 1,) and entries (m,) updated in place
    """
    for triangle in range(len(low)):
        i0 = min(int((low[triangle, 0] - origin[0]) / spacing), counts[0] - 1)
        i1 = min(int((high[triangle, 0] - origin[0]) / spacing), counts[0] - 1)
        j0 = min(int((low[triangle, 1] - origin[1]) / spacing), counts[1] - 1)
        j1 = min(int((high[triangle, 1] - origin[1]) / spacing), counts[1] - 1)
        k0 = min(int((low[triangle, 2] - origin[2]) / spacing), counts[2] - 1)
        k1 = min(int((high[triangle, 2] - origin[2]) / spacing), counts[2] - 1)
        for k in range(k0, k1 + 1):
            for j in range(j0, j1 + 1):
                for i in range(i0, i1 + 1):
                    cell = i + counts[0] * (j + counts[1] * k)
                    if fill:
                        entries[start[cell]] = triangle
                    start[cell] += 1


@njit(cache=True, error_model="numpy")
def find_crossings(vertices, edges, triangles, low, high, origin, spacing, counts, start, entries, tolerance, first):
    """Number of pairs of an edge and a triangle, without a common vertex, that cross.

    start (cells + 1,), entries (m,)  triangles by grid cell
    first (2,)                        the first pair found, edge and triangle, updated in place
    """
    found = 0
    seen = np.full(len(triangles), -1, dtype=np.int64)
    for edge in range(len(edges)):
        p, q = edges[edge, 0], edges[edge, 1]
        lo = np.minimum(vertices[p], vertices[q])
        hi = np.maximum(vertices[p], vertices[q])
        i0 = min(int((lo[0] - origin[0]) / spacing), counts[0] - 1)
        i1 = min(int((hi[0] - origin[0]) / spacing), counts[0] - 1)
        j0 = min(int((lo[1] - origin[1]) / spacing), counts[1] - 1)
        j1 = min(int((hi[1] - origin[1]) / spacing), counts[1] - 1)
        k0 = min(int((lo[2] - origin[2]) / spacing), counts[2] - 1)
        k1 = min(int((hi[2] - origin[2]) / spacing), counts[2] - 1)
        for k in range(k0, k1 + 1):
            for j in range(j0, j1 + 1):
                for i in range(i0, i1 + 1):
                    cell = i + counts[0] * (j + counts[1] * k)
                    for slot in range(start[cell], start[cell + 1]):
                        triangle = entries[slot]
                        if seen[triangle] == edge:
                            continue
                        seen[triangle] = edge
                        a, b, c = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
                        if p == a or p == b or p == c or q == a or q == b or q == c:
                            continue
                        apart = False
                        for axis in range(3):
                            apart |= low[triangle, axis] > hi[axis] or high[triangle, axis] < lo[axis]
                        if apart:
                            continue
                        if crosses(vertices[p], vertices[q], vertices[a], vertices[b], vertices[c], tolerance):
                            if found == 0:
                                first[0], first[1] = edge, triangle
                            found += 1
    return found
