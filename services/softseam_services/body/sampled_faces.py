"""The surface of a body by points that follow its nodes, as close as its functions ask for, as a pile touches it.

A model whose functions are quadratic answers a pressure by other forces on its nodes than a linear one does: those of
points that nodes share as functions say. Where these are Simpson's for panels of half a cell's edge and of the other's
squares, an even pressure, and one that is bilinear in each square, gives nodes of both exactly their forces.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_protocol.scene.kinds import Functions
from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.errors import SettingError
from softseam_services.body.interpolate import FUNCTION_NUMBER
from softseam_services.body.kernels.shape_functions import fill_weights
from softseam_services.body.outer_faces import FACE_NODES, is_covered_by_faces
from softseam_services.tools.kernels import DENSE

Numbers = NDArray[np.int64]


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
    """points at places of nodes, between which each is (p, 4)"""
    part: Floats
    """and how much it is of each, by how near (p, 4) [1]"""
    spacing: float
    """of the nodes [m]"""
    yields: float
    """how far the surface sinks in under a pressure [m/Pa]"""
    functions: int
    """by which places within triangles follow nodes, as `fill_weights` takes it"""
    cell: Ints
    """of each triangle (t,)"""
    corner: Floats
    """local coordinates of its corners there (t, 3, 3)"""
    follows: Ints
    """numbers of the cells' nodes: of those in `nodes`, then of the clamped ones, one for all others (c, 27)"""
    rests: Floats
    """where clamped ones are (k, 3) [m]"""

    def places(self, x: Floats) -> Floats:
        """Of the points, with the nodes at x (s, 3) [m] (p, 3)."""
        return np.asarray(self.weights @ x) + self.clamped

    def within(self, triangle: Numbers, share: Floats) -> tuple[csr_array, Floats]:
        """Weights (q, s) by which places in these triangles (q,), with shares (q, 3) in their corners, follow the
        nodes, and what clamped nodes add (q, 3) [m]: as the cell's functions say, not their values at the points."""
        q, s = len(triangle), len(self.nodes)
        local = np.einsum("qk,qki->qi", share, self.corner[triangle])
        indptr = np.zeros(q + 1, dtype=np.int32)
        node, weight = np.empty(27 * q, dtype=np.int32), np.empty(27 * q)
        count = fill_weights(local, self.cell[triangle], self.follows, self.functions, indptr, node, weight)
        end = s + len(self.rests)
        found = csr_array((weight[:count], node[:count], indptr), shape=(q, end + 1))
        return csr_array(found[:, :s]), np.asarray(found[:, s:end] @ self.rests)


def sampled_faces(body: Body, functions: Functions, others: float = math.inf) -> SampledFaces:
    """Of a body in hexahedra, interpolated so, that touches nodes which are so far from one another [m]. Raises
    SettingError where its surface runs through cells."""
    if body.tetrahedra or not is_covered_by_faces(body):
        raise SettingError("contact meets no surface that runs through cells yet: take a block")
    panels = max(2, math.ceil(body.resolution / others - 1e-6))
    simpson = np.array([1.0, *(4.0, 2.0) * (panels - 1), 4.0, 1.0]) / (6.0 * panels)
    cell, local, side, quads, among, part = _lattices(body, panels)
    indptr = np.zeros(len(local) + 1, dtype=np.int32)
    node, weight = np.empty(27 * len(local), dtype=np.int32), np.empty(27 * len(local))
    count = fill_weights(local, cell, body.cell_nodes, FUNCTION_NUMBER[functions], indptr, node, weight)
    follows = csr_array((weight[:count], node[:count], indptr), shape=(len(local), body.n_nodes))
    rest = np.asarray(follows @ body.x_rest)
    # points that faces share are one, but at an edge, where each face looks its own way
    points = quads
    key = np.column_stack([np.rint(rest * (1e6 / body.resolution)), side])
    _, one, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    follows, rest = follows[one], rest[one]
    quads, among = number[quads].astype(np.int32), number[among[one]].astype(np.int32)
    spread = np.cross(rest[quads[:, 2]] - rest[quads[:, 0]], rest[quads[:, 3]] - rest[quads[:, 1]])
    of_face = 0.5 * np.linalg.norm(spread, axis=1).reshape(-1, (2 * panels) ** 2).sum(axis=1)
    area = np.zeros(len(rest))
    np.add.at(area, number, np.outer(of_face, np.outer(simpson, simpson)).ravel())
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = np.concatenate([quads[:, half] for half in halves]).astype(np.int32)
    corners = np.concatenate([points[:, half] for half in halves])
    used = np.unique(follows.tocoo().col[follows.tocoo().data != 0.0])
    free = used[~body.fixed[used]]
    clamped = np.asarray(follows[:, body.fixed] @ body.x_rest[body.fixed])
    held = np.flatnonzero(body.fixed)
    number_of = np.full(body.n_nodes, len(free) + len(held), dtype=np.int32)
    number_of[free], number_of[held] = np.arange(len(free)), len(free) + np.arange(len(held))
    spacing = 0.5 * body.resolution
    softest = min(material.young for material in body.materials)
    return SampledFaces(
        free.astype(np.int32),
        csr_array(follows[:, free]),
        clamped,
        triangles,
        area,
        among,
        part[one],
        spacing,
        spacing / (DENSE * softest),
        FUNCTION_NUMBER[functions],
        cell[corners[:, 0]],
        local[corners],
        number_of[body.cell_nodes],
        body.x_rest[held],
    )


def _lattices(body: Body, panels: int) -> tuple[Ints, Floats, Ints, Ints, Ints, Floats]:
    """Cell and local coordinates of the points of all outer faces, face by face, at the ends and middles of so many
    panels along an edge, and which side of its cell each is on; their quads, from outside; and of each the four points
    at places of nodes around it, with its share in them."""
    count = np.bincount(body.cell_nodes[:, FACE_NODES[:, 0]].ravel(), minlength=body.n_nodes)
    along = 2 * panels + 1
    i, j = (each.ravel() for each in np.meshgrid(np.arange(along), np.arange(along), indexing="ij"))
    corner = np.array([along * a + b for a, b in product(range(along - 1), repeat=2)])
    quad = corner[:, None] + np.array([0, along, along + 1, 1])
    before_i, before_j = panels * (i >= panels), panels * (j >= panels)  # of the places of nodes 0, panels, 2 panels
    u, v = (i - before_i) / panels, (j - before_j) / panels
    around = np.stack(
        [along * (before_i + a * panels) + before_j + b * panels for a, b in product((0, 1), repeat=2)], 1
    )
    share = np.stack([(1.0 - u) * (1.0 - v), (1.0 - u) * v, u * (1.0 - v), u * v], axis=1)
    cells, places, sides, quads, among, parts, n = [], [], [], [], [], [], 0
    for number in range(6):
        axis, sign = number // 2, 2.0 * (number % 2) - 1.0
        outer = np.flatnonzero(count[body.cell_nodes[:, FACE_NODES[number, 0]]] == 1)
        local = np.empty((along**2, 3))
        local[:, axis] = sign
        local[:, (axis + 1) % 3], local[:, (axis + 2) % 3] = i / panels - 1.0, sign * (j / panels - 1.0)
        first = n + along**2 * np.arange(len(outer))[:, None, None]
        cells.append(np.repeat(outer, along**2))
        sides.append(np.full(along**2 * len(outer), number))
        places.append(np.tile(local, (len(outer), 1)))
        quads.append((first + quad).reshape(-1, 4))
        among.append((first + around).reshape(-1, 4))
        parts.append(np.tile(share, (len(outer), 1)))
        n += along**2 * len(outer)
    cell, side, squares, points = (np.concatenate(each) for each in (cells, sides, quads, among))
    return cell.astype(np.int32), np.concatenate(places), side, squares, points, np.concatenate(parts)
