"""How far tools go in a step, and how near they are, for every participant."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.distance import tool_gap

SLOW = 0.002
"""ways of a point in a step that are shorter than this part of a tool's reach are not marched along: what thickness no
tool has"""
_MARCHES = 65
_MET = 0.01
"""of the shortest way that is marched along: so near, the tool is met"""


@njit(cache=True, error_model="numpy")
def swept_gap(kind, shape, position, orientation, start, point, slow):
    """Whether a point that came from `start`, seen by the tool where it is now, met it on a way of more than `slow`
    [m], and gap and outward normal: those of the plane that it met first, else as of `tool_gap`.

    However fast it comes, it does not pass. By marching along the way by the distance (Hart, The Visual Computer 12,
    1996).
    """
    gap, nx, ny, nz = tool_gap(kind, shape, position, orientation, point)
    dx, dy, dz = point[0] - start[0], point[1] - start[1], point[2] - start[2]
    square = dx * dx + dy * dy + dz * dz
    if square <= slow * slow:
        return False, gap, nx, ny, nz
    length = np.sqrt(square)
    along = 0.0
    for _ in range(_MARCHES):
        if along >= length:
            break
        left = 1.0 - along / length
        at = point[0] - left * dx, point[1] - left * dy, point[2] - left * dz
        near, mx, my, mz = tool_gap(kind, shape, position, orientation, at)
        if near < _MET * slow:
            return True, near + left * (dx * mx + dy * my + dz * mz), mx, my, mz
        along += near
    return False, gap, nx, ny, nz


@njit(cache=True, error_model="numpy")
def tool_travel(reach, position, orientation, position_next, orientation_next, x):
    """Longest way that any point of a tool goes in a step [m]; of a plane, any point as far away as nodes x (n, 3) are.

    reach  (t,)  as in `ToolSet.reach` [m]; infinite for a plane

    A turn by an angle a moves a point at distance R by 2 R sin(a/2), and sin(a/2)^2 = 1 - (q . q_next)^2.
    """
    longest = 0.0
    for tool in range(len(reach)):
        square = 0.0
        for i in range(3):
            square += (position_next[tool, i] - position[tool, i]) ** 2
        way = np.sqrt(square)
        dot = 0.0
        for i in range(4):
            dot += orientation[tool, i] * orientation_next[tool, i]
        if dot * dot < 1.0:
            farthest = reach[tool]
            if np.isinf(farthest):
                farthest = 0.0
                for node in range(len(x)):
                    square = 0.0
                    for i in range(3):
                        square += (x[node, i] - position[tool, i]) ** 2
                    farthest = max(farthest, square)
                farthest = np.sqrt(farthest)
            way += 2.0 * farthest * np.sqrt(1.0 - dot * dot)
        longest = max(longest, way)
    return longest


@njit(cache=True, error_model="numpy")
def cell_distances(x, cell_nodes, kind, shape, position, orientation, near, node_gap, distance):
    """Least gap of each cell's 27 nodes to any near tool [m]; infinite without a near tool.

    x            (n, 3)   node positions [m]
    cell_nodes   (c, 27)  local node ids
    kind, shape, position, orientation  (t,), (t, 3), (t, 3), (t, 4)  as in `tool_gap`
    near         (t,)     tools that count
    node_gap     (n,)     workspace, overwritten
    distance     (c,)     updated in place
    """
    node_gap[:] = np.inf
    for tool in range(len(kind)):
        if near[tool]:
            # Tuples, because a view of a row costs as much as the distance.
            place = position[tool, 0], position[tool, 1], position[tool, 2]
            turn = orientation[tool, 0], orientation[tool, 1], orientation[tool, 2], orientation[tool, 3]
            for node in range(len(x)):
                point = x[node, 0], x[node, 1], x[node, 2]
                node_gap[node] = min(node_gap[node], tool_gap(kind[tool], shape[tool], place, turn, point)[0])
    for cell in range(len(cell_nodes)):
        least = np.inf
        for a in range(27):
            least = min(least, node_gap[cell_nodes[cell, a]])
        distance[cell] = least


@njit(cache=True, error_model="numpy")
def least_gaps(points, kind, shape, position, orientation, gap):
    """Least gap of any point (n, 3) to each tool [m]; gap (t,) updated in place."""
    for tool in range(len(kind)):
        least = np.inf
        for point in range(len(points)):
            least = min(least, tool_gap(kind[tool], shape[tool], position[tool], orientation[tool], points[point])[0])
        gap[tool] = least


@njit(cache=True, error_model="numpy")
def all_finite(position, orientation, position_next, orientation_next, force):
    """Whether poses (t, 3), (t, 4), (t, 3), (t, 4) and seam forces (s, 3) hold neither NaN nor infinity."""
    total = 0.0
    for tool in range(position.shape[0]):
        for i in range(3):
            total += 0.0 * (position[tool, i] + position_next[tool, i])
        for i in range(4):
            total += 0.0 * (orientation[tool, i] + orientation_next[tool, i])
    for node in range(force.shape[0]):
        for i in range(3):
            total += 0.0 * force[node, i]
    return total == 0.0  # 0 times infinity is NaN
