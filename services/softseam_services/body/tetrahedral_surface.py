"""The surface of cells that are tetrahedra: points all over their outer faces, triangles, and what viewers draw.

Each edge is divided into four parts, so that a face has 15 points, as dense as those of embedded surfaces: more than it
has freedoms, and so they press as those do (docs/decisions/45).
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints, Surface
from softseam_services.body.formats.mesh_file import Cells
from softseam_services.body.surface_points import vertex_shares
from softseam_services.body.tetrahedron import CORNERS, FACES, NODES, local_of, shape_functions

PARTS = 4
"""of an edge"""


class Layout(NamedTuple):
    """Where the P points of the surface are in cells, those of a cell one after another."""

    cell: Ints
    """that carries each (P,)"""
    barycentric: Floats
    """in that cell (P, 4)"""
    triangles: Ints
    """counter-clockwise from outside (T, 3)"""
    lines: Ints
    """ends of the parts of cells' edges (L, 2)"""


def _face_points() -> Ints:
    """Barycentric coordinates of a face's points, times PARTS (15, 3)."""
    steps = range(PARTS + 1)
    return np.array([(i, j, PARTS - i - j) for i in steps for j in steps if i + j <= PARTS], dtype=np.int32)


def _at(*places: tuple[int, int, int]) -> list[int]:
    """Numbers of a face's points."""
    return [int(np.flatnonzero((_POINTS == place).all(axis=1))[0]) for place in places]


_POINTS = _face_points()
_TRIANGLES = np.array(
    [_at((i, j, k), (i + 1, j, k - 1), (i, j + 1, k - 1)) for i, j, k in _POINTS.tolist() if k]
    + [_at((i, j, k), (i, j + 1, k - 1), (i - 1, j + 1, k)) for i, j, k in _POINTS.tolist() if i and k]
)
"""of a face, counter-clockwise as its corners (16, 3)"""
_SIDES = [_at(*(tuple(np.roll((0, i, PARTS - i), turn)) for i in range(PARTS + 1))) for turn in range(3)]
_LINES = np.array([ends for side in _SIDES for ends in pairwise(side)])
"""ends of the parts of a face's edges (12, 2)"""


def outer_faces(corners: Cells) -> tuple[Cells, Cells]:
    """Cell and number of each face that no two of the tetrahedra (C, 4) share (f, 2), and its corners (f, 3),
    counter-clockwise from outside."""
    faces = corners[:, FACES].reshape(-1, 3)
    _, number, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    outer = np.flatnonzero(count[number.ravel()] == 1)
    return np.stack([outer // 4, outer % 4], axis=1), faces[outer]


def lay_out(cell_nodes: Ints) -> Layout:
    """The points of cells with these nodes (C, 27)."""
    faces, corners = outer_faces(cell_nodes[:, CORNERS].astype(np.int64))
    # points that faces share are in the same parts of the same corners
    key = np.sort(np.where(_POINTS > 0, corners[:, None] * (PARTS + 1) + _POINTS, -1), axis=2)
    _, first, number = np.unique(key.reshape(-1, 3), axis=0, return_index=True, return_inverse=True)
    face, point = np.divmod(first, len(_POINTS))
    order = np.argsort(faces[face, 0], kind="stable")  # kernels take the points of a cell together
    cell, side = faces[face[order]].T
    barycentric = np.zeros((len(order), 4))
    np.put_along_axis(barycentric, FACES[side], _POINTS[point[order]] / PARTS, axis=1)
    at = np.argsort(order)[number].reshape(len(faces), len(_POINTS))
    return Layout(
        cell=cell.astype(np.int32),
        barycentric=barycentric,
        triangles=at[:, _TRIANGLES].reshape(-1, 3).astype(np.int32),
        lines=np.unique(np.sort(at[:, _LINES].reshape(-1, 2), axis=1), axis=0).astype(np.int32),
    )


def surface_of(x_rest: Floats, cell_nodes: Ints, layout: Layout) -> Surface:
    """The surface of cells (C, 27) of nodes (N, 3) [m]: a point stands for a third of each triangle around it."""
    x = x_rest[cell_nodes[layout.cell][:, NODES]]
    points = np.einsum("pa,pai->pi", shape_functions(layout.barycentric)[0], x)
    area, normal = vertex_shares(points, layout.triangles)
    return Surface(layout.cell, local_of(layout.barycentric), area, normal, layout.triangles)
