"""Tools that press a block's faces between their nodes: what is round, and what has an edge on a face."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body
from softseam_services.body.interpolate import rest_points
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.shapes.branches import BOX, CYLINDER, PLANE
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import ToolSet

PATCHES = 4
"""along each edge of a face"""
ROUND = 0.15
"""radius by which edges are rounded that press into a face, in edges of its cell: points lie a quarter of one apart,
and a sharper edge lets go of them one row at a time (docs/decisions/19)"""
_AXIS = 2
"""of a cylinder, in its frame"""
MARGIN = 0.02
"""cell edges by which a tool's face has to stand out beyond the body if no edge of it is to touch"""


def edged_tools(tools: ToolSet, body: Body) -> NDArray[np.bool_]:
    """Boxes whose face that looks at the body at time 0 does not cover it (t,); none where the surface is embedded."""
    edged = np.zeros(len(tools.names), dtype=np.bool_)
    if is_covered_by_faces(body):
        margin = MARGIN * float(body.edges.min())
        for tool in np.flatnonzero(tools.kind == BOX):
            edged[tool] = _bared(tools, int(tool), body) > -margin
    return edged


def pressing_between(tools: ToolSet, body: Body) -> NDArray[np.bool_]:
    """Tools that press a body's faces between their nodes (t,): all but planes, and boxes that cover the block, which
    nodes feel. None where the surface is embedded: its points are dense for every tool."""
    return (~np.isin(tools.kind, (PLANE, BOX)) & is_covered_by_faces(body)) | edged_tools(tools, body)


def with_round_edges(tools: ToolSet, body: Body) -> ToolSet:
    """The tools as the body feels them: no edge is rounded by more than the body stands out beyond it at time 0, and a
    cylinder is flat whose end looks at the body then, else round all over: were it both, the energy of contact would
    change where one ends."""
    radius, geometry = np.zeros(len(tools.names)), list(tools.geometry)
    for tool in np.flatnonzero(pressing_between(tools, body)):
        if tools.kind[tool] == CYLINDER and _seen(tools, int(tool), body)[0] == _AXIS:
            geometry[tool] = replace(geometry[tool], bends=0.0)
        if tools.geometry[tool].rounded is not None:
            radius[tool] = np.clip(_bared(tools, int(tool), body), 0.0, ROUND * body.resolution)
    return replace(tools, geometry=tuple(geometry)).felt(float(body.edges.max()) / PATCHES, radius)


def face_width(tools: ToolSet, tool: int, body: Body) -> float:
    """How wide the tool's face is that looks at the body at time 0, where it is narrowest [m]."""
    facing, _, half = _seen(tools, tool, body)
    return 2.0 * float(np.delete(half, facing).min())


def _bared(tools: ToolSet, tool: int, body: Body) -> float:
    """How far the body stands out beyond the edges of the tool's face that looks at it at time 0 [m]; less than 0 where
    the face covers it."""
    facing, out, half = _seen(tools, tool, body)
    return float(np.delete(out - half, facing).max())


def _seen(tools: ToolSet, tool: int, body: Body) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """The axis of the tool along which the body is at time 0, how far the body reaches along each (3,) [m], and the
    tool's half extents (3,) [m]."""
    turn, shape = tools.orientation[tool], tools.geometry[tool]
    half = np.array([shape.reach_along(axis) for axis in np.eye(3)])
    points = rest_points(body) - tools.position[tool]
    own = np.array([rotate_back(turn, *p) for p in (points.min(axis=0), points.max(axis=0))])
    if not np.array_equal(turn, [1.0, 0.0, 0.0, 0.0]):
        own = np.array([rotate_back(turn, *p) for p in points])
    low, high = own.min(axis=0), own.max(axis=0)
    return int(np.argmax(np.abs(0.5 * (low + high)) / half)), np.maximum(high, -low), half
