"""Do the tools start outside the body?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body
from softseam_services.body.interpolate import rest_points
from softseam_services.body.kernels.surface import winding_number
from softseam_services.tools.errors import ToolError
from softseam_services.tools.kernels import least_gaps
from softseam_services.tools.tool_set import BOX, PLANE, ToolSet

TOUCHING = 1e-9
"""depth that counts as touching, relative to the body's size [1]"""


def check_clear(tools: ToolSet, body: Body) -> None:
    """Raise ToolError, naming each tool, where a tool and the body overlap at time 0; touching is allowed.

    Overlap means a surface point of the body inside the tool, or a point of the tool (its middle; a box's corners and
    the middles of its edges and faces; six points of a sphere) inside the body.
    """
    points = rest_points(body)
    slack = TOUCHING * float(np.ptp(points, axis=0).max())
    gap = np.empty(len(tools.names))
    least_gaps(points, tools.kind, tools.shape, tools.position, tools.orientation, gap)
    problems = []
    for tool, name in enumerate(tools.names):
        if gap[tool] < -slack:
            problems.append(f"the tool {name!r} starts {-1e3 * gap[tool]:.3g} mm inside the body")
        elif tools.kind[tool] != PLANE:
            # Slightly smaller than the tool, so that a touching face is outside whatever the rounding.
            probes = _probes(tools, tool, 1.0 - 1e-6)
            if any(winding_number(points, body.surface.triangles, probe) > 0.5 for probe in probes):
                problems.append(f"the tool {name!r} starts inside the body")
    if problems:
        raise ToolError("; ".join(problems) + ": move it clear of the body, whose bounding box is " + _bounds(points))


def _probes(tools: ToolSet, tool: int, shrink: float) -> NDArray[np.float64]:
    """Points of a box or sphere (n, 3) [m]; at time 0 tools are not turned."""
    steps = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.float64)
    if tools.kind[tool] == BOX:
        reach = tools.shape[tool]
    else:
        steps = steps[np.abs(steps).sum(axis=1) <= 1.0]
        reach = np.full(3, tools.shape[tool, 0])
    probes: NDArray[np.float64] = tools.position[tool] + shrink * steps * reach
    return probes


def _bounds(points: NDArray[np.float64]) -> str:
    low, high = points.min(axis=0), points.max(axis=0)
    return "; ".join(f"{axis} {low[c]:.4g} .. {high[c]:.4g} m" for c, axis in enumerate("xyz"))
