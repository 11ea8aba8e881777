"""Points of an embedded surface: refined to the lattice spacing, with areas, normals and contact shares."""

from __future__ import annotations

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.surface_check import triangle_areas


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


def contact_shares(vertices: Floats, area: Floats, normal: Floats, spacing: float) -> Floats:
    """Gather areas of vertices that are much closer than `spacing` [m] at one of them; the rest is for display, 0 (n,).

    Vertices in the same voxel that face the same way (largest component of the normal, with its sign) form a group;
    the one nearest to the group's centroid keeps its area.
    """
    voxel = np.floor((vertices - vertices.min(axis=0)) / spacing).astype(np.int64)
    axis = np.abs(normal).argmax(axis=1)
    facing = 2 * axis + (normal[np.arange(len(normal)), axis] > 0.0)
    _, group = np.unique(np.column_stack([voxel, facing]), axis=0, return_inverse=True)
    group = group.ravel()
    total = np.bincount(group, weights=area)
    centroid = np.stack([np.bincount(group, weights=area * vertices[:, c]) for c in range(3)], axis=1) / total[:, None]
    distance = np.linalg.norm(vertices - centroid[group], axis=1)
    order = np.lexsort((np.arange(len(group)), distance, group))
    leader = order[np.concatenate([[True], group[order][1:] != group[order][:-1]])]
    shares = np.zeros(len(vertices))
    shares[leader] = total
    return shares
