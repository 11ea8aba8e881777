"""Tools whose edge presses into a face of a block: contact counts by the share of area that they cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body
from softseam_services.body.interpolate import rest_points
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.shapes.branches import BOX
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import ToolSet

MARGIN = 0.02
"""cell edges by which a tool's face has to stand out beyond the body if no edge of it is to touch"""


def edged_tools(tools: ToolSet, body: Body) -> NDArray[np.bool_]:
    """Boxes whose face that looks at the body at time 0 does not cover it (t,); none where the surface is embedded."""
    edged = np.zeros(len(tools.names), dtype=np.bool_)
    if is_covered_by_faces(body):
        edged[:] = [_has_edge(tools, tool, body) for tool in range(len(edged))]
    return edged


def _has_edge(tools: ToolSet, tool: int, body: Body) -> bool:
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
