"""Unit quaternions w, x, y, z of poses.

They turn a shape's own frame into the world's: y_world = position + R y_own.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from softseam_services.body.body import Floats
from softseam_services.jit import njit


def quaternion_turning(rotation: Floats) -> Floats:
    """The turn by a rotation vector (3,), axis times angle [rad]."""
    return np.asarray(Rotation.from_rotvec(rotation).as_quat(scalar_first=True))


def quaternion_onto(axis: Floats) -> Floats:
    """The shortest turn that takes z onto a direction (3,) of any length; half a turn about x takes z onto -z."""
    x, y, z = axis / np.linalg.norm(axis)
    if x == 0.0 and y == 0.0:
        return np.array([1.0, 0.0, 0.0, 0.0] if z > 0.0 else [0.0, 1.0, 0.0, 0.0])
    return quaternion_turning(np.arctan2(np.hypot(x, y), z) * np.array([-y, x, 0.0]) / np.hypot(x, y))


def turned(rotation: Floats, orientation: Floats) -> Floats:
    """An orientation (4,) after a turn by a rotation vector (3,) [rad], of unit length again."""
    after = Rotation.from_rotvec(rotation) * Rotation.from_quat(orientation, scalar_first=True)
    return np.asarray(after.as_quat(scalar_first=True))


@njit(cache=True, error_model="numpy")
def rotate(q, x, y, z):
    """R(q) (x, y, z): from the shape's frame to the world's. v + w t + q x t with t = 2 q x v."""
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
    """R(q)^T (x, y, z): from the world's frame to the shape's."""
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
