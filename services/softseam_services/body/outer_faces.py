"""Faces of cells on the body's surface."""

from itertools import product

import numpy as np

from softseam_services.body.body import Body, Ints, Region


def _face_nodes() -> Ints:
    stride, found = np.array([1, 3, 9]), []
    for axis, side in product(range(3), (-1, 1)):
        u, v = stride[(axis + 1) % 3], side * stride[(axis + 2) % 3]
        found.append(13 + side * stride[axis] + np.array([0, -u, u, -v, v, -u - v, v - u, u - v, u + v]))
    return np.array(found, dtype=np.int32)


FACE_NODES = _face_nodes()
"""local ids of the middle of each face 2 axis + (0 or 1) of a cell, of the middles of its sides at -u, +u, -v, +v,
u x v being outward, and of its corners -u-v, -u+v, +u-v, +u+v (6, 9)"""


def outer_faces(body: Body, region: Region) -> Ints:
    """Local cell, and number 2 axis + (0 or 1) in it, of the region's faces on the body's surface (f, 2), by number."""
    count = np.bincount(body.cell_nodes[:, FACE_NODES[:, 0]].ravel(), minlength=body.n_nodes)
    number, cell = np.nonzero(count[body.cell_nodes[region.cells][:, FACE_NODES[:, 0]]].T == 1)
    return np.stack([cell, number], axis=1).astype(np.int32)


def is_covered_by_faces(body: Body) -> bool:
    """Whether the surface points are the lattice nodes of cells that are filled."""
    local = body.surface.local
    return bool(np.abs(local - np.rint(local)).max(initial=0.0) < 1e-9 and (body.fill == 1.0).all())
