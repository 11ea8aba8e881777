"""Signed distance to a tool, for every participant's contact loop.

Quaternions are unit, w x y z, and turn the tool's frame into the world's: y_world = position + R y_tool.
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels.grid import grid_gap
from softseam_services.tools.kernels.solids import box_gap, capsule_gap, cylinder_gap
from softseam_services.tools.tool_set import BOX, CAPSULE, CYLINDER, PLANE, SPHERE


@njit(cache=True, error_model="numpy")
def rotate(q, x, y, z):
    """R(q) (x, y, z): from the tool's frame to the world's. v + w t + q x t with t = 2 q x v."""
    if q[1] == 0.0 and q[2] == 0.0 and q[3] == 0.0:
        return x, y, z  # the same bits, sooner
    tx = 2.0 * (q[2] * z - q[3] * y)
    ty = 2.0 * (q[3] * x - q[1] * z)
    tz = 2.0 * (q[1] * y - q[2] * x)
    return (
        x + q[0] * tx + q[2] * tz - q[3] * ty,
        y + q[0] * ty + q[3] * tx - q[1] * tz,
        z + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@njit(cache=True, error_model="numpy")
def rotate_back(q, x, y, z):
    """R(q)^T (x, y, z): from the world's frame to the tool's."""
    if q[1] == 0.0 and q[2] == 0.0 and q[3] == 0.0:
        return x, y, z
    tx = 2.0 * (q[3] * y - q[2] * z)
    ty = 2.0 * (q[1] * z - q[3] * x)
    tz = 2.0 * (q[2] * x - q[1] * y)
    return (
        x + q[0] * tx - q[2] * tz + q[3] * ty,
        y + q[0] * ty - q[3] * tx + q[1] * tz,
        z + q[0] * tz - q[1] * ty + q[2] * tx,
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def tool_gap(kind, shape, position, orientation, point):
    """Signed distance of a point to a tool and the tool's outward unit normal at the nearest point: gap, nx, ny, nz.

    gap < 0 inside. Planes, boxes, spheres, capsules and cylinders are exact outside, edges included; inside, the
    nearest face counts. A mesh is as exact as its grid, see `kernels.grid`.

    kind         PLANE, BOX, SPHERE, CAPSULE, CYLINDER or MESH
    shape        (w,)  as in `ToolSet.shape`, in the tool's frame
    position     (3,)  a point of the plane, or the centre [m]
    orientation  (4,)  unit quaternion w, x, y, z
    point        (3,)  [m]
    """
    dx = point[0] - position[0]
    dy = point[1] - position[1]
    dz = point[2] - position[2]
    if kind == PLANE:
        nx, ny, nz = rotate(orientation, shape[0], shape[1], shape[2])
        return dx * nx + dy * ny + dz * nz, nx, ny, nz
    if kind == SPHERE:
        distance = np.sqrt(dx * dx + dy * dy + dz * dz)
        if distance == 0.0:
            return -shape[0], 0.0, 0.0, 1.0
        return distance - shape[0], dx / distance, dy / distance, dz / distance
    x, y, z = rotate_back(orientation, dx, dy, dz)
    if kind == BOX:
        gap, nx, ny, nz = box_gap(shape[0], shape[1], shape[2], x, y, z)
    elif kind == CAPSULE:
        gap, nx, ny, nz = capsule_gap(shape[0], shape[1], x, y, z)
    elif kind == CYLINDER:
        gap, nx, ny, nz = cylinder_gap(shape[0], shape[1], x, y, z)
    else:
        gap, nx, ny, nz = grid_gap(shape, x, y, z)
    nx, ny, nz = rotate(orientation, nx, ny, nz)
    return gap, nx, ny, nz


@njit(cache=True, error_model="numpy")
def tool_reach(kind, shape):
    """Radius of a ball about the tool's position that holds the tool [m]; infinite for a plane."""
    if kind == PLANE:
        return np.inf
    if kind == SPHERE:
        return shape[0]
    if kind == CAPSULE:
        return shape[0] + shape[1]
    if kind == CYLINDER:
        return np.sqrt(shape[0] ** 2 + shape[1] ** 2)
    return np.sqrt(shape[0] ** 2 + shape[1] ** 2 + shape[2] ** 2)


@njit(cache=True, error_model="numpy")
def tool_travel(kind, shape, position, orientation, position_next, orientation_next, x):
    """Longest way that any point of a tool goes in a step [m]; of a plane, any point as far away as nodes x (n, 3) are.

    A turn by an angle a moves a point at distance R by 2 R sin(a/2), and sin(a/2)^2 = 1 - (q . q_next)^2.
    """
    longest = 0.0
    for tool in range(len(kind)):
        square = 0.0
        for i in range(3):
            square += (position_next[tool, i] - position[tool, i]) ** 2
        way = np.sqrt(square)
        dot = 0.0
        for i in range(4):
            dot += orientation[tool, i] * orientation_next[tool, i]
        if dot * dot < 1.0:
            reach = tool_reach(kind[tool], shape[tool])
            if kind[tool] == PLANE:
                reach = 0.0
                for node in range(len(x)):
                    square = 0.0
                    for i in range(3):
                        square += (x[node, i] - position[tool, i]) ** 2
                    reach = max(reach, square)
                reach = np.sqrt(reach)
            way += 2.0 * reach * np.sqrt(1.0 - dot * dot)
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
