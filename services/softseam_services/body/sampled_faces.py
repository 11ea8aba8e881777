"""The surface of a body by points that follow its nodes, as close as its functions ask for, as a pile touches it.

A model whose functions are quadratic answers a pressure by other forces on its nodes than a linear one does; forces on
points at a quarter of a cell, which nodes share as functions say, are nearly those.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.sparse import csr_array

from softseam_protocol.scene.kinds import Functions
from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.errors import SettingError
from softseam_services.body.interpolate import FUNCTION_NUMBER
from softseam_services.body.kernels.shape_functions import fill_weights
from softseam_services.body.outer_faces import FACE_NODES, is_covered_by_faces
from softseam_services.tools.kernels import DENSE

_ALONG = 5
"""points along a cell's edge"""


@dataclass(frozen=True)
class SampledFaces:
    """p points on the outer faces of cells, t triangles between them, s nodes that may move."""

    nodes: Ints
    """that the points follow, ascending, but for those that are clamped (s,)"""
    weights: csr_array
    """by which they do (p, s) [1]"""
    clamped: Floats
    """what clamped nodes add (p, 3) [m]"""
    triangles: Ints
    """points, counter-clockwise from outside (t, 3)"""
    area: Floats
    """that each point stands for (p,) [m^2]"""
    among: Ints
    """points at places of nodes, between which each is, the first four times where it is one itself (p, 4)"""
    part: Floats
    """and how much it is of each, by how near (p, 4) [1]"""
    closeness: float
    """of the points [m]"""
    spacing: float
    """of the nodes [m]"""
    yields: float
    """how far the surface sinks in under a pressure [m/Pa]"""

    def places(self, x: Floats) -> Floats:
        """Of the points, with the nodes at x (s, 3) [m] (p, 3)."""
        return np.asarray(self.weights @ x) + self.clamped


def sampled_faces(body: Body, functions: Functions) -> SampledFaces:
    """Of a body in hexahedra, interpolated so. Raises SettingError where its surface runs through cells."""
    if body.tetrahedra or not is_covered_by_faces(body):
        raise SettingError("contact meets no surface that runs through cells yet: take a block")
    cell, local, quads, among = _lattices(body)
    indptr = np.zeros(len(local) + 1, dtype=np.int32)
    node, weight = np.empty(27 * len(local), dtype=np.int32), np.empty(27 * len(local))
    count = fill_weights(local, cell, body.cell_nodes, FUNCTION_NUMBER[functions], indptr, node, weight)
    follows = csr_array((weight[:count], node[:count], indptr), shape=(len(local), body.n_nodes))
    rest = np.asarray(follows @ body.x_rest)
    _, one, number = np.unique(np.rint(rest * (1e6 / body.resolution)), axis=0, return_index=True, return_inverse=True)
    number = number.ravel()  # points that faces share are one
    follows, rest = follows[one], rest[one]
    quads, among = number[quads].astype(np.int32), number[among[one]].astype(np.int32)
    side = np.cross(rest[quads[:, 2]] - rest[quads[:, 0]], rest[quads[:, 3]] - rest[quads[:, 1]])
    area = np.zeros(len(rest))
    np.add.at(area, quads, 0.125 * np.linalg.norm(side, axis=1)[:, None])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    used = np.unique(follows.tocoo().col[follows.tocoo().data != 0.0])
    free = used[~body.fixed[used]]
    clamped = np.asarray(follows[:, body.fixed] @ body.x_rest[body.fixed])
    spacing = 0.5 * body.resolution
    softest = min(material.young for material in body.materials)
    return SampledFaces(
        free.astype(np.int32),
        csr_array(follows[:, free]),
        clamped,
        triangles,
        area,
        among,
        np.full(among.shape, 0.25),
        body.resolution / (_ALONG - 1),
        spacing,
        spacing / (DENSE * softest),
    )


def _lattices(body: Body) -> tuple[Ints, Floats, Ints, Ints]:
    """Cell and local coordinates of the points of all outer faces, face by face; their quads, from outside; and of each
    the four points at nodes' places around it, of which some are one where it is near none or two."""
    count = np.bincount(body.cell_nodes[:, FACE_NODES[:, 0]].ravel(), minlength=body.n_nodes)
    steps = np.linspace(-1.0, 1.0, _ALONG)
    u, v = (each.ravel() for each in np.meshgrid(steps, steps, indexing="ij"))
    corner = np.array([_ALONG * i + j for i, j in product(range(_ALONG - 1), repeat=2)])
    quad = corner[:, None] + np.array([0, _ALONG, _ALONG + 1, 1])
    i, j = (each.ravel() for each in np.meshgrid(np.arange(_ALONG), np.arange(_ALONG), indexing="ij"))
    around = np.stack(
        [_ALONG * (2 * ((i + a) // 2)) + 2 * ((j + b) // 2) for a, b in product((0, 1), repeat=2)], axis=1
    )
    cells, locals_, quads, among, n = [], [], [], [], 0
    for number in range(6):
        axis, sign = number // 2, 2.0 * (number % 2) - 1.0
        outer = np.flatnonzero(count[body.cell_nodes[:, FACE_NODES[number, 0]]] == 1)
        local = np.empty((len(u), 3))
        local[:, axis], local[:, (axis + 1) % 3], local[:, (axis + 2) % 3] = sign, u, sign * v
        cells.append(np.repeat(outer, len(u)))
        locals_.append(np.tile(local, (len(outer), 1)))
        quads.append((n + len(u) * np.arange(len(outer))[:, None, None] + quad).reshape(-1, 4))
        among.append((n + len(u) * np.arange(len(outer))[:, None, None] + around).reshape(-1, 4))
        n += len(u) * len(outer)
    return np.concatenate(cells).astype(np.int32), np.concatenate(locals_), np.concatenate(quads), np.concatenate(among)
