"""Exact signed distance of points to a closed triangle mesh: a tree of boxes, the sign by pseudonormals.

The point of the surface nearest to p lies on a triangle, an edge or a vertex; p is outside where (p - nearest) . n > 0
with n the triangle's normal, the sum of the normals of the edge's two triangles, or the sum of the normals of the
vertex's triangles weighted by their angles there.
Source: Baerentzen and Aanaes 2005, IEEE Trans. Vis. Comput. Graph. 11, 243.
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit

FACE, EDGE, VERTEX = 0, 1, 4
"""features of a triangle a b c: the face; edges ab, bc, ca; vertices a, b, c"""
LEAF = 4
"""most triangles in a leaf of the tree"""


@njit(cache=True, error_model="numpy")
def nearest_on_triangle(p, a, b, c, nearest):
    """The point of a triangle nearest to p into nearest (3,); returns the feature it lies on.

    By the signs of the dot products that bound the Voronoi regions of vertices, edges and face.
    Source: Ericson 2005, Real-Time Collision Detection, section 5.1.5.
    """
    ab0, ab1, ab2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac0, ac1, ac2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    q0, q1, q2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1, d2 = ab0 * q0 + ab1 * q1 + ab2 * q2, ac0 * q0 + ac1 * q1 + ac2 * q2
    if d1 <= 0.0 and d2 <= 0.0:
        nearest[:] = a
        return VERTEX
    q0, q1, q2 = p[0] - b[0], p[1] - b[1], p[2] - b[2]
    d3, d4 = ab0 * q0 + ab1 * q1 + ab2 * q2, ac0 * q0 + ac1 * q1 + ac2 * q2
    if d3 >= 0.0 and d4 <= d3:
        nearest[:] = b
        return VERTEX + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3)
        nearest[0], nearest[1], nearest[2] = a[0] + s * ab0, a[1] + s * ab1, a[2] + s * ab2
        return EDGE
    q0, q1, q2 = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    d5, d6 = ab0 * q0 + ab1 * q1 + ab2 * q2, ac0 * q0 + ac1 * q1 + ac2 * q2
    if d6 >= 0.0 and d5 <= d6:
        nearest[:] = c
        return VERTEX + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s = d2 / (d2 - d6)
        nearest[0], nearest[1], nearest[2] = a[0] + s * ac0, a[1] + s * ac1, a[2] + s * ac2
        return EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        s = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        for i in range(3):
            nearest[i] = b[i] + s * (c[i] - b[i])
        return EDGE + 1
    scale = 1.0 / (va + vb + vc)
    v, w = vb * scale, vc * scale
    nearest[0] = a[0] + v * ab0 + w * ac0
    nearest[1] = a[1] + v * ab1 + w * ac1
    nearest[2] = a[2] + v * ab2 + w * ac2
    return FACE


@njit(cache=True, error_model="numpy")
def pseudonormals(vertices, triangles, neighbours, normal):
    """normal (T, 7, 3) <- pseudonormals of face, edges and vertices of each triangle, of any length.

    neighbours (T, 3)  the triangles across edges ab, bc, ca
    """
    at_vertex = np.zeros((len(vertices), 3))
    face = np.empty((len(triangles), 3))
    for t in range(len(triangles)):
        a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        n = np.cross(b - a, c - a)
        face[t] = n / np.sqrt(n @ n)
        for corner in range(3):
            o = vertices[triangles[t, corner]]
            u = vertices[triangles[t, (corner + 1) % 3]] - o
            v = vertices[triangles[t, (corner + 2) % 3]] - o
            cosine = (u @ v) / np.sqrt((u @ u) * (v @ v))
            at_vertex[triangles[t, corner]] += np.arccos(min(max(cosine, -1.0), 1.0)) * face[t]
    for t in range(len(triangles)):
        normal[t, FACE] = face[t]
        for side in range(3):
            normal[t, EDGE + side] = face[t] + face[neighbours[t, side]]
            normal[t, VERTEX + side] = at_vertex[triangles[t, side]]


@njit(cache=True, error_model="numpy")
def box_tree(low, high, levels, tree):
    """Boxes of a full binary tree over triangles in order; tree (2^(levels + 1), 6) updated in place, root at 1.

    low, high (2^levels LEAF, 3)  boxes of the triangles; empty ones (inf, -inf) fill up
    """
    first = 1 << levels
    for leaf in range(first):
        box = tree[first + leaf]
        box[:3], box[3:] = np.inf, -np.inf
        for t in range(leaf * LEAF, (leaf + 1) * LEAF):
            for i in range(3):
                box[i] = min(box[i], low[t, i])
                box[3 + i] = max(box[3 + i], high[t, i])
    for node in range(first - 1, 0, -1):
        for i in range(3):
            tree[node, i] = min(tree[2 * node, i], tree[2 * node + 1, i])
            tree[node, 3 + i] = max(tree[2 * node, 3 + i], tree[2 * node + 1, 3 + i])


@njit(cache=True, error_model="numpy")
def _square_to_box(box, p):
    total = 0.0
    for i in range(3):
        out = max(box[i] - p[i], 0.0, p[i] - box[3 + i])
        total += out * out
    return total


@njit(cache=True, error_model="numpy")
def signed_distance(p, bound, vertices, triangles, normal, tree, stack, nearest, best):
    """Signed distance of p (3,) to the mesh [m], < 0 inside, where it is no more than bound.

    triangles in the tree's order; stack, nearest (3,) and best (3,) are scratch
    """
    first = len(tree) // 2
    least = bound * bound
    found, feature = -1, 0
    stack[0] = 1
    n = 1
    while n:
        n -= 1
        node = stack[n]
        if _square_to_box(tree[node], p) > least:
            continue
        if node >= first:
            begin = (node - first) * LEAF
            for t in range(begin, min(begin + LEAF, len(triangles))):
                on = nearest_on_triangle(
                    p, vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]], nearest
                )
                square = (p[0] - nearest[0]) ** 2 + (p[1] - nearest[1]) ** 2 + (p[2] - nearest[2]) ** 2
                if square <= least:
                    least, found, feature = square, t, on
                    best[:] = nearest
            continue
        left, right = 2 * node, 2 * node + 1
        closer = _square_to_box(tree[left], p) <= _square_to_box(tree[right], p)
        stack[n], stack[n + 1] = (right, left) if closer else (left, right)
        n += 2
    m = normal[found, feature]
    side = (p[0] - best[0]) * m[0] + (p[1] - best[1]) * m[1] + (p[2] - best[2]) * m[2]
    return np.sqrt(least) if side >= 0.0 else -np.sqrt(least)


@njit(cache=True, error_model="numpy")
def fill_grid(origin, spacing, vertices, triangles, normal, tree, value):
    """value (n0, n1, n2) <- signed distances at origin + spacing (i, j, k), updated in place.

    The distance changes by no more than the way to the point before, which bounds the search.
    """
    stack = np.empty(128, dtype=np.int64)
    nearest, best, p = np.empty(3), np.empty(3), np.empty(3)
    for i in range(value.shape[0]):
        for j in range(value.shape[1]):
            bound = np.inf
            for k in range(value.shape[2]):
                p[0], p[1], p[2] = origin[0] + spacing * i, origin[1] + spacing * j, origin[2] + spacing * k
                value[i, j, k] = signed_distance(p, bound, vertices, triangles, normal, tree, stack, nearest, best)
                bound = (abs(value[i, j, k]) + spacing) * (1.0 + 1e-12)
