"""Points of an embedded surface: refined to a spacing, with areas and normals, and where tools press them."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.body.surface_check import triangle_areas

Mask = NDArray[np.bool_]

NO_CREASE = 0.9
"""cosine of the angle by which a triangle is turned from the normal of its corner, 26 degrees"""


def refine(vertices: Floats, triangles: Ints, longest: float) -> tuple[Floats, Ints]:
    """Halve every edge longer than `longest` [m] until none is left; neighbours stay matched."""
    while True:
        sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        edges, number = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        split = length > longest
        if not split.any():
            return vertices, triangles
        middle = np.full(len(edges), -1, dtype=np.int64)
        middle[split] = len(vertices) + np.arange(int(split.sum()))
        midpoints = middle[number.reshape(-1, 3)]
        longest_side = length[number.reshape(-1, 3)].argmax(axis=1)
        vertices = np.concatenate([vertices, vertices[edges[split]].mean(axis=1)])
        # Turn each triangle so that its longest side comes first: halves are cut from that side.
        turn = (longest_side[:, None] + np.arange(3)) % 3
        row = np.arange(len(triangles))[:, None]
        triangles = _split(triangles[row, turn], midpoints[row, turn])


def _split(triangles: Ints, midpoints: Ints) -> Ints:
    """Cut triangles (T, 3) at the midpoints (T, 3) of sides 01, 12, 20; -1 where a side stays whole."""
    a, b, c = triangles.T
    ab, bc, ca = midpoints.T
    whole = (midpoints < 0).all(axis=1)
    pieces = [triangles[whole]]
    # The longest side, ab, is cut wherever any side is: the triangle falls into two halves, each cut once more at most.
    for first, apex, side in ((a, c, ca), (b, c, bc)):
        left = first is a
        cut = ~whole & (side >= 0)
        uncut = ~whole & (side < 0)
        for rows, corners in (
            (uncut, ((first, ab, apex),)),
            (cut, ((first, ab, side), (side, ab, apex))),
        ):
            for x, y, z in corners:
                ordered = (x, y, z) if left else (y, x, z)
                pieces.append(np.stack(ordered, axis=1)[rows])
    return np.concatenate(pieces).astype(np.int32)


def vertex_shares(vertices: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Area (n,) [m^2], a third of each triangle around a vertex, and area-weighted unit normal (n, 3)."""
    vectors = triangle_areas(vertices, triangles)
    area = np.zeros(len(vertices))
    normal = np.zeros((len(vertices), 3))
    np.add.at(area, triangles, np.linalg.norm(vectors, axis=1)[:, None] / 3.0)
    np.add.at(normal, triangles, vectors[:, None, :])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    flat = length[:, 0] == 0.0
    normal[flat] = (0.0, 0.0, 1.0)
    length[flat] = 1.0
    return area, normal / length


def contact_points(vertices: Floats, triangles: Ints, longest: float) -> tuple[Floats, Floats, Floats, Floats]:
    """The vertices of a surface, then points at which tools press it: where they are (n + k, 3) [m], what areas they
    stand for (n + k,) [m^2], unit normals (n + k, 3), and vertices that they stand for (n + k, 3) [m].

    Triangles are split until no edge is longer than `longest` [m], and a point stands for what is nearest to a vertex
    then. It is the middle of that, so that a pressure that varies linearly is summed exactly: vertices stick out of a
    surface of facets, and would bear too much. On creases vertices are pressed where they are; all others are for
    display, area 0. Where vertices are much closer than `longest`, those in the same voxel of half of it that face the
    same way (largest component of the normal, with its sign) share one point.
    """
    n = len(vertices)
    vertices, triangles = refine(vertices, triangles, longest)
    area, normal = vertex_shares(vertices, triangles)
    smooth = _smooth(vertices, triangles, normal)
    middles = np.where(smooth[:, None], _middles(vertices, triangles, area), vertices)
    voxel = np.floor((vertices - vertices.min(axis=0)) / (0.5 * longest)).astype(np.int64)
    axis = np.abs(normal).argmax(axis=1)
    facing = 2 * axis + (normal[np.arange(len(normal)), axis] > 0.0)
    _, group = np.unique(np.column_stack([voxel, facing, smooth]), axis=0, return_inverse=True)
    group = group.ravel()
    total = np.bincount(group, weights=area)
    middle = np.stack([np.bincount(group, weights=area * middles[:, c]) for c in range(3)], axis=1) / total[:, None]
    distance = np.linalg.norm(vertices - middle[group], axis=1)
    order = np.lexsort((np.arange(len(group)), distance, group))
    nearest = order[np.concatenate([[True], group[order][1:] != group[order][:-1]])]
    places = np.where(smooth[nearest, None], middle, vertices[nearest])
    added = smooth[nearest] | (nearest >= n)
    shares = np.zeros(n)
    shares[nearest[~added]] = total[~added]
    return (
        np.concatenate([vertices[:n], places[added]]),
        np.concatenate([shares, total[added]]),
        np.concatenate([normal[:n], normal[nearest[added]]]),
        np.concatenate([vertices[:n], vertices[nearest[added]]]),
    )


def _smooth(vertices: Floats, triangles: Ints, normal: Floats) -> Mask:
    """Whether no triangle around a vertex is turned from the vertex's normal as far as at a crease (n,)."""
    vectors = triangle_areas(vertices, triangles)
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)
    along = np.where(length > 0.0, np.einsum("ti,tki->tk", unit, normal[triangles]), 1.0)
    least = np.ones(len(vertices))
    np.minimum.at(least, triangles, along)
    return least > NO_CREASE


def _middles(vertices: Floats, triangles: Ints, area: Floats) -> Floats:
    """Centroid of what lies nearest to each vertex: of each triangle around it a third, which its medians bound
    (n, 3) [m]."""
    third = np.linalg.norm(triangle_areas(vertices, triangles), axis=1) / 3.0
    corners = vertices[triangles]
    # a third is two triangles, each of the corner, a side's middle and the centroid; its own centroid has weights 11/18
    # of the corner and 7/36 of each other one
    centroids = (15.0 * corners + 7.0 * corners.sum(axis=1, keepdims=True)) / 36.0
    moment = np.zeros_like(vertices)
    np.add.at(moment, triangles, third[:, None, None] * centroids)
    return np.divide(moment, area[:, None], out=vertices.copy(), where=area[:, None] > 0.0)
