"""Where a tool's edge presses into the body's surface: faces of blocks, built once, and shares, see `kernels.share`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.lattice import LOCAL
from softseam_services.body.outer_faces import FACE_NODES, outer_faces
from softseam_services.body.own_shapes import cell_volumes
from softseam_services.body.region import build_region, node_of_point
from softseam_services.jit import record
from softseam_services.tools.edged import edged_tools
from softseam_services.tools.tool_set import ToolSet

from .levels import Levels

SOFT = 3.5
"""stiffness of contact on what is covered of a face of a block, in E A/h; see the decision note"""
_QUARTERS = np.array([[5, 1, 3, 0], [1, 6, 0, 4], [3, 0, 7, 2], [0, 4, 2, 8]])
_WHOLE = np.array([5, 6, 7, 8])
"""corners -u-v, -u+v, +u-v, +u+v of the faces of blocks, in `FACE_NODES`"""


@record
class Edges(NamedTuple):
    """f faces of blocks on the surface, p points of the region, t tools."""

    edged: NDArray[np.bool_]
    """tools with an edge that may press into the body (t,)"""
    faces: Ints
    """nodes at the corners -u-v, -u+v, +u-v, +u+v, u x v being outward (f, 4)"""
    point: Ints
    """the region's point at each of these, -1 for none (f, 4)"""
    stiffness: Floats
    """SOFT E A/h, what a face adds where it is wholly covered (f,) [N/m]"""
    edge: Floats
    """h, of a cube of the block's volume (f,) [m]"""
    whole: Floats
    """of each point: area of the body's faces around it over that of the region's, 1 but on a seam (p,)"""
    side: Ints
    """side of the tool that covers a part of what the point stands for, -1 where it covers all or nothing (p, t)"""
    give: Floats
    """compliance of contact there (p, t) [m/N]"""
    patches: Ints
    """which patches of a face that it presses the tool covers, as bits (f, t)"""
    held: Floats
    """scratch: of each point the stiffness that a tool covers, and that of all faces that look at it, less what has
    faded (p, 2) [N/m]"""


def build_edges(body: Body, region: Region, tools: ToolSet, levels: Levels) -> Edges:
    """Without faces where no tool has an edge that may press into the body."""
    p, t = len(region.points), len(tools.names)
    edged = edged_tools(tools, body)
    outer = outer_faces(body, region) if edged.any() and p > 0 else np.zeros((0, 2), dtype=np.int32)
    coarse = levels.coarse[outer[:, 0]]
    quarters = FACE_NODES[outer[~coarse, 1]][:, _QUARTERS].reshape(-1, 4)
    local = np.concatenate([quarters, FACE_NODES[outer[coarse, 1]][:, _WHOLE]])
    cell = np.concatenate([np.repeat(outer[~coarse, 0], 4), outer[coarse, 0]])
    faces = np.ascontiguousarray(region.cell_nodes[cell[:, None], local])
    x = body.x_rest[region.nodes[faces]]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 3] - x[:, 0], x[:, 1] - x[:, 2]), axis=1)
    octant = (LOCAL[local].mean(axis=1) > 1.0) @ np.array([1, 2, 4])
    young = body.of_octants([material.young for material in body.materials])[region.cells[cell], octant]
    edge = np.cbrt(cell_volumes(body)[region.cells[cell]] / np.where(levels.coarse[cell], 1.0, 8.0))
    point_of = np.full(body.n_nodes, -1, dtype=np.int32)
    whole = np.ones(p)
    if len(faces):
        at = node_of_point(body)[region.points]
        point_of[at] = np.arange(p)
        all_cells, no_seam = np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32)
        own, area_of_all = _areas(body, region)[at], _areas(body, build_region(body, all_cells, no_seam))[at]
        whole = np.divide(area_of_all, own, out=whole, where=own > 0.0)
    return Edges(
        edged=edged,
        faces=faces,
        point=np.ascontiguousarray(point_of[region.nodes[faces]]),
        stiffness=SOFT * young * area / edge,
        edge=edge,
        whole=whole,
        side=np.full((p, t), -1, dtype=np.int32),
        give=np.zeros((p, t)),
        patches=np.zeros((len(faces), t), dtype=np.int32),
        held=np.zeros((p, 2)),
    )


def _areas(body: Body, region: Region) -> Floats:
    """Area of the region's faces on the body's surface around each node, flat between their corners (n,) [m^2]."""
    cell, number = outer_faces(body, region).T
    nodes = region.nodes[region.cell_nodes[cell[:, None], FACE_NODES[number]]]
    x = body.x_rest[nodes[:, _WHOLE]]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 3] - x[:, 0], x[:, 1] - x[:, 2]), axis=1)
    parts = np.repeat([4.0, 2.0, 1.0], [1, 4, 4]) / 16.0
    total = np.bincount(nodes.ravel(), (area[:, None] * parts).ravel(), minlength=body.n_nodes)
    return total.astype(np.float64, copy=False)
