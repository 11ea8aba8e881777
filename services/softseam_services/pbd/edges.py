"""Where a tool's edge presses into the body's surface: faces of blocks, and what they weigh; see `kernels.share`."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.lattice import LOCAL
from softseam_services.body.outer_faces import FACE_NODES, outer_faces
from softseam_services.body.own_shapes import cell_volumes
from softseam_services.body.region import node_of_point
from softseam_services.tools.edged import edged_tools
from softseam_services.tools.tool_set import ToolSet

SOFT = 3.5
"""stiffness of contact on what is covered of a face of a block, in E A/h; see the decision note"""
_QUARTERS = np.array([[5, 1, 3, 0], [1, 6, 0, 4], [3, 0, 7, 2], [0, 4, 2, 8]])
_WHOLE = np.array([5, 6, 7, 8])
"""corners -u-v, -u+v, +u-v, +u+v of the faces of blocks, in `FACE_NODES`"""


class OuterFaces(NamedTuple):
    """What the structure of a region's faces follows from: o faces of cells on the body's surface, n nodes."""

    cells: Ints
    """local cell, and number in it as in `FACE_NODES` (o, 2)"""
    point: Ints
    """the region's point at each node, -1 for none (n,)"""


class Faces(NamedTuple):
    """f faces of blocks on the surface; none where no tool has an edge that may press into the body."""

    nodes: Ints
    """at the corners -u-v, -u+v, +u-v, +u+v, u x v being outward (f, 4)"""
    point: Ints
    """the region's point at each of these, -1 for none (f, 4)"""
    cell: Ints
    """(f,)"""
    octant: NDArray[np.int64]
    """in the cell; of a whole cell any (f,)"""
    whole: NDArray[np.bool_]
    """whether it is the face of a whole cell (f,)"""


class FaceParameters(NamedTuple):
    """f faces of blocks, p points of the region, t tools."""

    edged: NDArray[np.bool_]
    """tools with an edge that may press into the body (t,)"""
    stiffness: Floats
    """SOFT E A/h, what a face adds where it is wholly covered (f,) [N/m]"""
    edge: Floats
    """h, of a cube of the block's volume (f,) [m]"""
    whole: Floats
    """of each point: area of the body's faces around it over that of the region's, 1 but on a seam (p,)"""


def find_outer_faces(body: Body, region: Region, tools: ToolSet) -> OuterFaces:
    """Without faces where no tool has an edge that may press into the body."""
    some = edged_tools(tools, body).any() and len(region.points) > 0
    if not some:
        return OuterFaces(np.zeros((0, 2), dtype=np.int32), np.zeros(0, dtype=np.int32))
    point = np.full(body.n_nodes, -1, dtype=np.int32)
    point[node_of_point(body)[region.points]] = np.arange(len(region.points))
    return OuterFaces(outer_faces(body, region), point[region.nodes])


def build_faces(cell_nodes: Ints, coarse: NDArray[np.bool_], outer: OuterFaces) -> Faces:
    """Four quarters of each face on the surface, but one where the cell is one block."""
    cells, number = outer.cells.T
    whole = coarse[cells]
    quarters = FACE_NODES[number[~whole]][:, _QUARTERS].reshape(-1, 4)
    local = np.concatenate([quarters, FACE_NODES[number[whole]][:, _WHOLE]])
    cell = np.concatenate([np.repeat(cells[~whole], 4), cells[whole]])
    nodes = np.ascontiguousarray(cell_nodes[cell[:, None], local])
    return Faces(
        nodes=nodes,
        point=np.ascontiguousarray(outer.point[nodes]) if len(nodes) else nodes.copy(),
        cell=cell,
        octant=(LOCAL[local].mean(axis=1) > 1.0) @ np.array([1, 2, 4]),
        whole=coarse[cell],
    )


def build_face_parameters(faces: Faces, body: Body, region: Region, tools: ToolSet) -> FaceParameters:
    """What each face weighs, and each point of its faces."""
    x = body.x_rest[region.nodes[faces.nodes]]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 3] - x[:, 0], x[:, 1] - x[:, 2]), axis=1)
    young = body.of_octants([material.young for material in body.materials])[region.cells[faces.cell], faces.octant]
    edge = np.cbrt(cell_volumes(body)[region.cells[faces.cell]] / np.where(faces.whole, 1.0, 8.0))
    whole = np.ones(len(region.points))
    if len(faces.nodes) and len(region.cells) < body.n_cells:
        at = node_of_point(body)[region.points]
        everything = replace(region, cells=np.arange(body.n_cells, dtype=np.int32))
        own, of_all = _areas(body, region)[at], _areas(body, everything)[at]
        whole = np.divide(of_all, own, out=whole, where=own > 0.0)
    return FaceParameters(edged_tools(tools, body), SOFT * young * area / edge, edge, whole)


def _areas(body: Body, region: Region) -> Floats:
    """Area of the faces of the region's cells on the body's surface around each node, flat between their corners
    (n,) [m^2]."""
    cell, number = outer_faces(body, region).T
    nodes = body.cell_nodes[region.cells[cell][:, None], FACE_NODES[number]]
    x = body.x_rest[nodes[:, _WHOLE]]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 3] - x[:, 0], x[:, 1] - x[:, 2]), axis=1)
    parts = np.repeat([4.0, 2.0, 1.0], [1, 4, 4]) / 16.0
    total = np.bincount(nodes.ravel(), (area[:, None] * parts).ravel(), minlength=body.n_nodes)
    return total.astype(np.float64, copy=False)
