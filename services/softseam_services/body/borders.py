"""Where a body's materials meet, as lines that viewers draw."""

from itertools import product

import numpy as np

from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.lattice import OCTANT_NODES

_FLAT = 0.95
"""cosine between faces that are drawn as one"""


def _octant_faces() -> Ints:
    """Local nodes of the faces of an octant, corner by corner around each (6, 4)."""
    stride, faces = np.array([1, 2, 4]), []
    for axis, side in product(range(3), (0, 1)):
        u, v = stride[(axis + 1) % 3], stride[(axis + 2) % 3]
        faces.append(side * stride[axis] + np.array([0, u, u + v, v]))
    return np.array(faces, dtype=np.int32)


_FACES = _octant_faces()


def border_lines(body: Body) -> Ints:
    """Ends of the edges of borders between materials, as nodes (L, 2): where a border bends, ends or meets another.

    A smooth one does nowhere: it is drawn as the net of its octants' edges.
    """
    none = np.zeros((0, 2), dtype=np.int32)
    if (body.octant_material == body.octant_material[:1, :1]).all():
        return none
    filled = (body.fill > 0.0).ravel()
    octants = body.cell_nodes[:, OCTANT_NODES].reshape(-1, 8)[filled]
    faces = octants[:, _FACES].reshape(-1, 4)
    material = np.repeat(body.octant_material.ravel()[filled], 6)
    _, first, number = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True)
    low, high = np.full(len(first), np.iinfo(np.int32).max), np.full(len(first), -1)
    np.minimum.at(low, number.ravel(), material)
    np.maximum.at(high, number.ravel(), material)
    border = np.flatnonzero(low != high)
    if len(border) == 0:
        return none
    return _bends(body.x_rest, faces[first[border]], low[border] * len(body.materials) + high[border])


def _bends(x: Floats, faces: Ints, pair: Ints) -> Ints:
    """Edges of the faces (f, 4) but for those between two flat neighbours of one pair of materials (f,)."""
    normal = np.cross(x[faces[:, 2]] - x[faces[:, 0]], x[faces[:, 3]] - x[faces[:, 1]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, number, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(number.ravel(), kind="stable") // 4
    begin = np.concatenate([[0], np.cumsum(count)[:-1]])
    one, other = order[begin], order[np.minimum(begin + 1, len(order) - 1)]
    flat = np.abs(np.einsum("ei,ei->e", normal[one], normal[other])) > _FLAT
    drawn = ~((count == 2) & flat & (pair[one] == pair[other]))
    return np.asarray(edges[drawn] if drawn.any() else edges, dtype=np.int32)
