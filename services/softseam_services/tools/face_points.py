"""Contact points inside the faces of cells, for tools that are round, or whose edge presses into a face of a block.

A node of the surface is inside a tool's face or beside it; with nodes alone the pressed area comes in steps of half a
cell, and so does the force, and what is thinner than a cell is missed between them. Such tools touch at points at the
middles of 4 x 4 patches a face, and at no node.
"""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.interpolate import FUNCTION_NUMBER, Functions, hex27
from softseam_services.body.kernels.shape_functions import fill_weights
from softseam_services.body.outer_faces import FACE_NODES, outer_faces
from softseam_services.body.own_shapes import cell_volumes
from softseam_services.body.region import node_of_point
from softseam_services.tools.edged import PATCHES, pressing_between
from softseam_services.tools.tool_set import ToolSet

Mask = NDArray[np.bool_]


@cache
def _middles() -> tuple[Floats, Floats]:
    """Places of the patches of each face in the cell (6, 16, 3), and derivatives of the cell's functions along u and v
    there (6, 16, 27, 2)."""
    at = (2.0 * np.arange(PATCHES) + 1.0) / PATCHES - 1.0
    along = np.stack([np.repeat(at, PATCHES), np.tile(at, PATCHES)], axis=1)
    place, slope = np.empty((6, PATCHES**2, 3)), np.empty((6, PATCHES**2, 27, 2))
    value, full = np.empty(27), np.empty((27, 3))
    for face, (axis, side) in enumerate(product(range(3), (-1.0, 1.0))):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        place[face, :, axis] = side
        place[face][:, [u, v]] = along
        for point, out in zip(place[face], slope[face], strict=True):
            hex27(point, value, full)
            out[:] = full[:, [u, v]]
    return place, slope


_ASIDE = 0.1
"""half of the way over which weights are compared, in the cell: functions are quadratic at most, and the same there"""


@dataclass(frozen=True)
class FacePoints:
    """q points on f faces."""

    cell: Ints
    """(q,)"""
    local: Floats
    """(q, 3)"""
    face: Ints
    """(q,)"""
    area: Floats
    """(q,) [m^2]"""
    edge: Floats
    """of the face's cell, see `cell_edges` (f,) [m]"""
    indptr: Ints
    node: Ints
    weight: Floats
    """as of `point_weights`"""
    tilt: Floats
    """change of each weight from one edge of the point's patch to the other, along its first and second edge (m, 2)"""


def touched_faces(body: Body, region: Region, tools: ToolSet | None) -> tuple[Mask, Mask, Ints]:
    """Tools that touch at points inside faces (t,), surface points of the region that no such face holds, so that they
    touch every tool (p,), and these faces as of `outer_faces` (f, 2).

    No tools and no faces where all tools are planes, and boxes that cover the block; or another side owns its surface.
    """
    at_faces = np.zeros(0 if tools is None else len(tools.names), dtype=np.bool_)
    own = node_of_point(body)[region.points]
    owns = len(region.seam) == 0 or bool(np.isin(own, region.nodes[region.seam]).any())
    if tools is not None and owns:
        at_faces = pressing_between(tools, body)
    outer = outer_faces(body, region) if at_faces.any() else np.zeros((0, 2), dtype=np.int32)
    held = np.isin(own, region.nodes[np.unique(_nodes(region, outer))])
    return at_faces, ~held, outer


def face_points(body: Body, region: Region, faces: Ints, functions: Functions) -> FacePoints:
    """Points on the faces of `touched_faces` (f, 2); functions: what the region's element interpolates with."""
    carrier, side = faces.T
    nodes = _nodes(region, faces)
    area = _areas(body, region, faces)
    cell, local = np.repeat(carrier, PATCHES**2), _middles()[0][side].reshape(-1, 3)
    indptr = np.zeros(len(cell) + 1, dtype=np.int32)
    node, weight = np.empty(27 * len(cell), dtype=np.int32), np.empty(27 * len(cell))
    number = FUNCTION_NUMBER[functions]
    count = fill_weights(local, cell, region.cell_nodes, number, indptr, node, weight)
    tilt = np.zeros((count, 2))
    for along in range(2):
        aside = np.zeros_like(local)
        aside[np.arange(len(local)), (np.repeat(side, PATCHES**2) // 2 + 1 + along) % 3] = _ASIDE
        for sign in (-1.0, 1.0):
            there = np.empty_like(weight)
            other, at = np.empty_like(indptr), np.empty_like(node)
            fill_weights(local + sign * aside, cell, region.cell_nodes, number, other, at, there)
            if functions.startswith("tet"):  # between tetrahedra of a cell, other nodes count beside a point than at it
                there = _at_nodes(indptr, node[:count], other, at, there)
            tilt[:, along] += sign / (PATCHES * _ASIDE) * there[:count]
    return FacePoints(
        cell=cell,
        local=local,
        face=np.repeat(np.arange(len(nodes), dtype=np.int32), PATCHES**2),
        area=area.ravel(),
        edge=cell_edges(body, region.cells[carrier]),
        indptr=indptr,
        node=node[:count].copy(),
        weight=weight[:count].copy(),
        tilt=tilt,
    )


def _at_nodes(indptr: Ints, node: Ints, other: Ints, at: Ints, weight: Floats) -> Floats:
    """Weights in rows other, at as those of the entries of the rows indptr, node; what the latter lack goes to their
    first node, so that rows sum to 1 still."""
    found = np.zeros(len(node))
    for row in range(len(indptr) - 1):
        mine, theirs = slice(*indptr[row : row + 2]), slice(*other[row : row + 2])
        same = node[mine, None] == at[None, theirs]
        found[mine] = same @ weight[theirs]
        found[indptr[row]] += weight[theirs].sum() - found[mine].sum()
    return found


def _nodes(region: Region, faces: Ints) -> Ints:
    """Of faces (f, 2), in the order of `FACE_NODES` (f, 9)."""
    return region.cell_nodes[faces[:, 0][:, None], FACE_NODES[faces[:, 1]]]


def _areas(body: Body, region: Region, outer: Ints) -> Floats:
    """Of the patches of faces (f, 2) at rest (f, 16) [m^2]:  |x_u x x_v| du dv."""
    x = body.x_rest[body.cell_nodes[region.cells[outer[:, 0]]]]  # (f, 27, 3)
    along = np.einsum("fpak,fai->fpki", _middles()[1][outer[:, 1]], x)
    return np.asarray(np.linalg.norm(np.cross(along[:, :, 0], along[:, :, 1]), axis=2) * (2.0 / PATCHES) ** 2)


def cell_edges(body: Body, cells: Ints) -> Floats:
    """Edge of a cell [m], twice the spacing of nodes that contact goes by: of a cube of its volume where cells are of
    any shape, so that thin cells are neither too soft beside a tool's edge nor too stiff beneath it; of a regular
    tetrahedron of its volume (c,)."""
    if body.tetrahedra:
        return np.asarray(np.cbrt(6.0 * np.sqrt(2.0) * cell_volumes(body)[cells]))
    return np.full(len(cells), body.resolution) if body.boxes else np.cbrt(cell_volumes(body)[cells])


def point_edges(body: Body, region: Region) -> Floats:
    """The mean `cell_edges` of the body's cells around each of the region's surface points, or that of the cell which
    carries it (p,) [m]."""
    if body.boxes or body.tetrahedra:
        return cell_edges(body, region.cells)[region.point_cell]
    edge = cell_edges(body, np.arange(body.n_cells, dtype=np.int32))
    held = body.cell_nodes.ravel()
    count, total = np.bincount(held), np.bincount(held, np.repeat(edge, 27))
    at = node_of_point(body)[region.points]
    return np.asarray(total[at] / count[at])
