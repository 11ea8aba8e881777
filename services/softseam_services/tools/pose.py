"""Unit quaternions w, x, y, z of poses."""

from __future__ import annotations

import numpy as np

from softseam_services.body.body import Floats


def quaternion_turning(rotation: Floats) -> Floats:
    """The turn by a rotation vector (3,), axis times angle [rad]."""
    angle = float(np.linalg.norm(rotation))
    if angle == 0.0:
        return np.array([1.0, 0.0, 0.0, 0.0])
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) / angle * rotation])


def quaternion_onto(axis: Floats) -> Floats:
    """The shortest turn that takes z onto a direction (3,) of any length; half a turn about x takes z onto -z."""
    x, y, z = axis / np.linalg.norm(axis)
    if x == 0.0 and y == 0.0:
        return np.array([1.0, 0.0, 0.0, 0.0] if z > 0.0 else [0.0, 1.0, 0.0, 0.0])
    return quaternion_turning(np.arctan2(np.hypot(x, y), z) * np.array([-y, x, 0.0]) / np.hypot(x, y))


def turned(turn: Floats, orientation: Floats) -> Floats:
    """An orientation (4,) after a turn (4,), of unit length again."""
    after = product(turn, orientation)
    return np.asarray(after / np.linalg.norm(after))


def product(p: Floats, q: Floats) -> Floats:
    """p q (4,): first the turn q, then p."""
    w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.concatenate([[w], v])
