"""The surface of a body by points that follow its nodes, as close as its functions ask for, as others touch it.

A model whose functions are quadratic answers a pressure by other forces on its nodes than a linear one does: those of
points that nodes share as functions say. Where these are Simpson's for panels of half a cell's edge and of the other's
squares, an even pressure, and one that is bilinear in each square, gives nodes of both exactly their forces. A surface
that runs through cells has the points at which tools press it (`surface_points`), and its triangles as they are drawn.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_coupling.kernels.nearest_face import nearest_faces, point_normals
from softseam_protocol.scene.kinds import Functions
from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.bulges import curvatures_everywhere
from softseam_services.body.contact_points import PENALTY
from softseam_services.body.errors import SettingError
from softseam_services.body.interpolate import FUNCTION_NUMBER, rest_points
from softseam_services.body.kernels.shape_functions import fill_weights
from softseam_services.body.outer_faces import FACE_NODES, is_covered_by_faces
from softseam_services.body.surface_points import NO_CREASE
from softseam_services.tools.kernels import DENSE

Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class _Functions:
    """By which places within triangles follow nodes."""

    number: int
    """as `fill_weights` takes it"""
    cell: Ints
    """of each triangle (t,)"""
    corner: Floats
    """local coordinates of its corners there (t, 3, 3)"""
    nodes: Ints
    """numbers of the cells' nodes: of those that may move, then of the clamped ones, one for all others (c, 27)"""
    held: Floats
    """where clamped ones are (k, 3) [m]"""


@dataclass(frozen=True)
class SampledFaces:
    """p points of a surface, t triangles between some of them, s nodes that may move."""

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
    """patches into which each may be gathered, around places of nodes (p, 4), of a surface that runs through cells
    (p, 8); numbers below `n_patches`"""
    part: Floats
    """and how much it is of each, by how near, 1 in all (p, 4 or 8) [1]"""
    n_patches: int
    upon: Ints
    """corners between which each point is, whose normals make its own (p, 3)"""
    upon_share: Floats
    """and their shares (p, 3) [1]"""
    rounded: NDArray[np.bool_]
    """whether the surface is smooth around each corner of a triangle: between such corners normals go over into one
    another, at others the triangle has its own (t, 3)"""
    bends: Floats
    """how its normal turns along it at each point, at rest (p, 3, 3) [1/m]"""
    spacing: float
    """of the nodes [m]"""
    yields: float
    """how far the surface sinks in under a pressure [m/Pa]"""
    functions: _Functions | None = None
    """by which places within triangles follow nodes; None: as linear ones between corners"""

    @property
    def through_cells(self) -> bool:
        """Whether it runs through cells, in place of along their faces."""
        return self.functions is None

    def places(self, x: Floats) -> Floats:
        """Of the points, with the nodes at x (s, 3) [m] (p, 3)."""
        return np.asarray(self.weights @ x) + self.clamped

    def within(self, triangle: Numbers, share: Floats) -> tuple[csr_array, Floats]:
        """Weights (q, s) by which places in these triangles (q,), with shares (q, 3) in their corners, follow the
        nodes, and what clamped nodes add (q, 3) [m]: as the cell's functions say, not their values at the points."""
        q, s, of = len(triangle), len(self.nodes), self.functions
        if of is None:
            corners, ends = self.triangles[triangle].ravel(), 3 * np.arange(q + 1)
            between = csr_array((share.ravel(), corners, ends), shape=(q, len(self.area)))
            return csr_array(between @ self.weights), np.asarray(between @ self.clamped)
        local = np.einsum("qk,qki->qi", share, of.corner[triangle])
        found, end = _filled(local, of.cell[triangle], of.nodes, of.number, s + len(of.held) + 1), s + len(of.held)
        return csr_array(found[:, :s]), np.asarray(found[:, s:end] @ of.held)


def sampled_faces(body: Body, functions: Functions, others: float = math.inf) -> SampledFaces:
    """Of a body in hexahedra, interpolated so, that touches nodes which are so far from one another [m]. Raises
    SettingError for tetrahedra."""
    if body.tetrahedra:
        raise SettingError("contact meets no cells that are tetrahedra yet: take a block, or a closed surface")
    if not is_covered_by_faces(body):
        return _through_cells(body, functions)
    panels = max(2, math.ceil(body.resolution / others - 1e-6))
    simpson = np.array([1.0, *(4.0, 2.0) * (panels - 1), 4.0, 1.0]) / (6.0 * panels)
    cell, local, side, quads, among, part = _lattices(body, panels)
    follows = _interpolate(body, local, cell, functions)
    rest = np.asarray(follows @ body.x_rest)
    # points that faces share are one, but at an edge, where each face looks its own way
    points = quads
    key = np.column_stack([np.rint(rest * (1e6 / body.resolution)), side])
    _, one, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    follows, rest = follows[one], rest[one]
    quads = number[quads].astype(np.int32)
    spread = np.cross(rest[quads[:, 2]] - rest[quads[:, 0]], rest[quads[:, 3]] - rest[quads[:, 1]])
    of_face = 0.5 * np.linalg.norm(spread, axis=1).reshape(-1, (2 * panels) ** 2).sum(axis=1)
    area = np.zeros(len(rest))
    np.add.at(area, number, np.outer(of_face, np.outer(simpson, simpson)).ravel())
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = np.concatenate([quads[:, half] for half in halves]).astype(np.int32)
    corners = np.concatenate([points[:, half] for half in halves])
    patches, gathered = np.unique(number[among[one]], return_inverse=True)
    nodes, weights, clamped = _follow(body, follows)
    held = np.flatnonzero(body.fixed)
    number_of = np.full(body.n_nodes, len(nodes) + len(held), dtype=np.int32)
    number_of[nodes], number_of[held] = np.arange(len(nodes)), len(nodes) + np.arange(len(held))
    return SampledFaces(
        nodes,
        weights,
        clamped,
        triangles,
        area,
        gathered.reshape(-1, 4).astype(np.int32),
        part[one],
        len(patches),
        *_themselves(len(rest)),
        np.zeros(triangles.shape, dtype=np.bool_),
        np.zeros((len(rest), 3, 3)),
        *_yields(body, DENSE),
        _Functions(
            FUNCTION_NUMBER[functions],
            cell[corners[:, 0]],
            local[corners],
            number_of[body.cell_nodes],
            body.x_rest[held],
        ),
    )


def _follow(body: Body, weights: csr_array) -> tuple[Ints, csr_array, Floats]:
    """Nodes, weights and what clamped ones add, of points with weights (p, N) of all nodes."""
    used = np.unique(weights.tocoo().col[weights.tocoo().data != 0.0])
    free = used[~body.fixed[used]]
    clamped = np.asarray(weights[:, body.fixed] @ body.x_rest[body.fixed])
    return free.astype(np.int32), csr_array(weights[:, free]), clamped


def _yields(body: Body, dense: float) -> tuple[float, float]:
    """Spacing of the nodes [m], and how far the surface sinks in under a pressure [m/Pa]."""
    spacing = 0.5 * body.resolution
    return spacing, spacing / (dense * min(material.young for material in body.materials))


def _themselves(p: int) -> tuple[Ints, Floats]:
    """Points each of which has its own normal."""
    return np.repeat(np.arange(p, dtype=np.int32)[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (p, 1))


def _through_cells(body: Body, functions: Functions) -> SampledFaces:
    """Of a body whose surface runs through cells."""
    surface, rest = body.surface, rest_points(body)
    triangles, p = surface.triangles, len(surface.area)
    among, part = np.zeros((p, 8), dtype=np.int32), np.zeros((p, 8))
    near = _interpolate(body, surface.local, surface.cell, "hex8")
    place = np.arange(near.nnz) - np.repeat(near.indptr[:-1], np.diff(near.indptr))
    point = np.repeat(np.arange(p), np.diff(near.indptr))
    nodes, number = np.unique(near.indices, return_inverse=True)
    among[point, place], part[point, place] = number, near.data
    normal = np.empty_like(rest)
    point_normals(rest, triangles, normal)
    own = np.cross(rest[triangles[:, 1]] - rest[triangles[:, 0]], rest[triangles[:, 2]] - rest[triangles[:, 0]])
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    rounded = np.einsum("ti,tki->tk", own, normal[triangles]) > NO_CREASE
    return SampledFaces(
        *_follow(body, _interpolate(body, surface.local, surface.cell, functions)),
        triangles,
        surface.area,
        among,
        part,
        len(nodes),
        *_upon(rest, triangles, surface.normal, body.resolution),
        rounded,
        curvatures_everywhere(body),
        *_yields(body, PENALTY),
    )


def _interpolate(body: Body, local: Floats, cell: Ints, functions: Functions) -> csr_array:
    """Weights of all nodes (p, N) at local coordinates (p, 3) of cells (p,)."""
    return _filled(local, cell, body.cell_nodes, FUNCTION_NUMBER[functions], body.n_nodes)


def _filled(local: Floats, cell: Ints, nodes: Ints, functions: int, n: int) -> csr_array:
    """Weights (p, n) at local coordinates (p, 3) of cells (p,) with these nodes (c, 27), see `fill_weights`."""
    indptr = np.zeros(len(local) + 1, dtype=np.int32)
    node, weight = np.empty(27 * len(local), dtype=np.int32), np.empty(27 * len(local))
    count = fill_weights(local, cell, nodes, functions, indptr, node, weight)
    return csr_array((weight[:count], node[:count], indptr), shape=(len(local), n))


def _upon(rest: Floats, triangles: Ints, normal: Floats, reach: float) -> tuple[Ints, Floats]:
    """`upon` and its shares, of points at rest (p, 3) [m] that look this way (p, 3): corners of the nearest triangle
    that does, within reach [m], where they are no corners."""
    upon, share = _themselves(len(rest))
    free = np.setdiff1d(np.arange(len(rest)), triangles)
    n = len(free)
    face, own, beside, faces = np.empty(n, dtype=np.int64), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
    nearest_faces(rest[free], -normal[free], rest, triangles, reach, reach, face, own, beside, faces)
    assert (face >= 0).all()  # points are on the surface, or inside it by less than a triangle is long
    upon[free], share[free] = triangles[face], own
    return upon, share


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
