"""Contact points inside the faces of cells, for tools whose edge presses into a face of a block.

A node of the surface is inside a tool's face or beside it; with nodes alone the pressed area comes in steps of half a
cell, and so does the force. Points at the middles of 4 x 4 patches a face know which part of their patch is covered
(`kernels.cover`). Such tools touch at these points and at no node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.interpolate import FUNCTION_NUMBER, Functions, rest_points
from softseam_services.body.kernels.shape_functions import fill_weights
from softseam_services.body.region import node_of_point
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import BOX, ToolSet

PATCHES = 4
"""along each edge of a face"""
SOFT = 8.0
"""contact penalty at these points, E A/h with h the spacing of nodes; see the decision note"""
MARGIN = 0.02
"""cell edges by which a tool's face has to stand out beyond the body if no edge of it is to touch"""
_STRIDE = (1, 3, 9)


@dataclass(frozen=True)
class FacePoints:
    """q points on f faces."""

    edged: NDArray[np.bool_]
    """tools that touch here (t,)"""
    alone: NDArray[np.bool_]
    """surface points of the region that no face here holds: they touch every tool (p,)"""
    cell: Ints
    """(q,)"""
    local: Floats
    """(q, 3)"""
    face: Ints
    """(q,)"""
    area: Floats
    """(q,) [m^2]"""
    face_nodes: Ints
    """local ids of the middle, and of the middles of the sides at -u, +u, -v, +v; u x v is outward (f, 5)"""
    indptr: Ints
    node: Ints
    weight: Floats
    """as of `point_weights`"""


def face_points(body: Body, region: Region, tools: ToolSet | None, functions: Functions) -> FacePoints:
    """Points on the block's surface; none where no tool has an edge that presses into it, or another side owns it.

    functions: what the region's element interpolates with
    """
    n_tools = 0 if tools is None else len(tools.names)
    edged = np.zeros(n_tools, dtype=np.bool_)
    own = node_of_point(body)[region.points]
    owns = len(region.seam) == 0 or bool(np.isin(own, region.nodes[region.seam]).any())
    if tools is not None and owns and _is_block(body):
        edged[:] = [_has_edge(tools, tool, body) for tool in range(n_tools)]
    cells: list[Ints] = []
    locals_: list[Floats] = []
    nodes: list[Ints] = []
    middles = (2.0 * np.arange(PATCHES) + 1.0) / PATCHES - 1.0
    areas: list[Floats] = []
    if edged.any():
        taken = {tuple(cell) for cell in body.cell_grid.tolist()}
        grid = body.cell_grid[region.cells]
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for side in (-1, 1):
                beyond = grid.copy()
                beyond[:, axis] += side
                outer = np.flatnonzero([tuple(cell) not in taken for cell in beyond.tolist()]).astype(np.int32)
                centre = _STRIDE[0] + _STRIDE[1] + _STRIDE[2] + side * _STRIDE[axis]
                across = (-_STRIDE[u], _STRIDE[u], -side * _STRIDE[v], side * _STRIDE[v])
                nodes.append(region.cell_nodes[outer][:, [centre, *(centre + step for step in across)]])
                place = np.empty((PATCHES * PATCHES, 3))
                place[:, axis] = side
                place[:, u], place[:, v] = np.repeat(middles, PATCHES), np.tile(middles, PATCHES)
                cells.append(np.repeat(outer, PATCHES * PATCHES))
                locals_.append(np.tile(place, (len(outer), 1)))
                areas.append(np.full(len(cells[-1]), body.edges[u] * body.edges[v] / PATCHES**2))
    cell = np.concatenate(cells) if cells else np.zeros(0, dtype=np.int32)
    local = np.concatenate(locals_) if cells else np.zeros((0, 3))
    face_nodes = np.concatenate(nodes) if cells else np.zeros((0, 5), dtype=np.int32)
    indptr = np.zeros(len(cell) + 1, dtype=np.int32)
    node, weight = np.empty(27 * len(cell), dtype=np.int32), np.empty(27 * len(cell))
    count = fill_weights(local, cell, region.cell_nodes, FUNCTION_NUMBER[functions], indptr, node, weight)
    held = np.isin(own, region.nodes[np.unique(node[:count])])
    return FacePoints(
        edged=edged,
        alone=~held,
        cell=cell,
        local=local,
        face=np.repeat(np.arange(len(face_nodes), dtype=np.int32), PATCHES * PATCHES),
        area=np.concatenate(areas) if cells else np.zeros(0),
        face_nodes=np.ascontiguousarray(face_nodes, dtype=np.int32),
        indptr=indptr,
        node=node[:count].copy(),
        weight=weight[:count].copy(),
    )


def _is_block(body: Body) -> bool:
    """Whether the surface points are the lattice nodes of filled boxes."""
    local = body.surface.local
    return body.boxes and bool(np.abs(local - np.rint(local)).max(initial=0.0) < 1e-9 and (body.fill == 1.0).all())


def _has_edge(tools: ToolSet, tool: int, body: Body) -> bool:
    """Whether a box's face that looks at the body at time 0 does not cover it."""
    if tools.kind[tool] != BOX:
        return False
    turn, half = tools.orientation[tool], tools.shape[tool, :3]
    points = rest_points(body) - tools.position[tool]
    own = np.array([rotate_back(turn, *p) for p in (points.min(axis=0), points.max(axis=0))])
    if not np.array_equal(turn, [1.0, 0.0, 0.0, 0.0]):
        own = np.array([rotate_back(turn, *p) for p in points])
    low, high = own.min(axis=0), own.max(axis=0)
    facing = int(np.argmax(np.abs(0.5 * (low + high)) / half))
    margin = MARGIN * float(body.edges.min())
    beside = [axis for axis in range(3) if axis != facing]
    return any(low[axis] - margin < -half[axis] or high[axis] + margin > half[axis] for axis in beside)
