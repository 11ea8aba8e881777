"""Signed distance to a shape anywhere in the world: a branch each of softseam's own, a call of those from outside."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.box import box_gap
from softseam_services.shapes.branches import BOX, CAPSULE, CYLINDER, DISTANCE, MESH, PLANE, SPHERE
from softseam_services.shapes.capsule import capsule_gap
from softseam_services.shapes.cylinder import cylinder_gap
from softseam_services.shapes.mesh_grid import grid_gap
from softseam_services.shapes.turns import rotate, rotate_back

_call_distance = DISTANCE.call


@njit(cache=True, error_model="numpy", forceinline=True)
def turned_gap(kind, shape, x, y, z):
    """`tool_gap` in the frame of a shape that is neither a plane nor a sphere."""
    if kind == BOX:
        gap, nx, ny, nz = box_gap(shape[0], shape[1], shape[2], shape[3], x, y, z)
    elif kind == CAPSULE:
        gap, nx, ny, nz = capsule_gap(shape[0], shape[1], x, y, z)
    elif kind == CYLINDER:
        gap, nx, ny, nz = cylinder_gap(shape[0], shape[1], shape[2], x, y, z)
    elif kind == MESH:
        gap, nx, ny, nz = grid_gap(shape, x, y, z)
    else:
        gap, nx, ny, nz = _call_distance(kind, len(shape), shape, x, y, z)
    return gap, nx, ny, nz


@njit(cache=True, error_model="numpy", forceinline=True)
def tool_gap(kind, shape, position, orientation, point):
    """Signed distance of a point to a tool and the tool's outward unit normal at the nearest point: gap, nx, ny, nz.

    gap < 0 inside. Planes, boxes, spheres, capsules and cylinders are exact outside, edges included; inside, the
    nearest face counts. A mesh is as exact as its grid, see `mesh_grid`.

    kind         one of `branches`, or the address of a distance from outside
    shape        (w,)  as in `Geometry.numbers`, in the tool's frame
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
    gap, nx, ny, nz = turned_gap(kind, shape, x, y, z)
    nx, ny, nz = rotate(orientation, nx, ny, nz)
    return gap, nx, ny, nz


@njit(cache=True, error_model="numpy")
def shape_gaps(points, kind, shape, position, orientation, gap):
    """Gap of each point (n, 3) to one shape, as in `tool_gap` [m]; gap (n,) updated in place."""
    for point in range(len(points)):
        gap[point] = tool_gap(kind, shape, position, orientation, points[point])[0]
