"""Sides of a box, and gaps to their planes. A side is axis, or axis + 3 for the one whose outward normal is along
+axis."""

from softseam_services.jit import njit
from softseam_services.shapes.turns import rotate, rotate_back


@njit(cache=True, error_model="numpy")
def side_along(orientation, x, y, z):
    """Side whose outward normal is most along this vector."""
    f = rotate_back(orientation, x, y, z)
    axis = 0
    for i in range(1, 3):
        if abs(f[i]) > abs(f[axis]):
            axis = i
    return axis + 3 if f[axis] > 0.0 else axis


@njit(cache=True, error_model="numpy")
def side_gap(side, shape, position, orientation, point):
    """Gap to the plane of a box's side and its outward normal: gap, nx, ny, nz."""
    axis, sign = side % 3, (1.0 if side >= 3 else -1.0)
    nx, ny, nz = rotate(orientation, sign if axis == 0 else 0.0, sign if axis == 1 else 0.0, sign if axis == 2 else 0.0)
    away = nx * (point[0] - position[0]) + ny * (point[1] - position[1]) + nz * (point[2] - position[2])
    return away - shape[axis], nx, ny, nz
