"""Points of a tool's surface: enough of them to tell whether it pokes into a body, and how far it reaches."""

from __future__ import annotations

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import BOX, CAPSULE, CYLINDER, PLANE, SPHERE, ToolSet

_AROUND = 16
_STEPS = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.float64)


def outline(kind: int, shape: Floats) -> Floats:
    """Points of the surface of a plane, box, sphere, capsule or cylinder, and its middle (n, 3) [m]."""
    if kind == PLANE:
        return np.zeros((0, 3))
    if kind == BOX:
        return np.asarray(_STEPS * shape[:3])
    axes = _STEPS[np.abs(_STEPS).sum(axis=1) <= 1.0]
    if kind == SPHERE:
        return np.asarray(shape[0] * axes)
    radius, half = shape[:2]
    turn = 2.0 * np.pi / _AROUND * np.arange(_AROUND)
    ring = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    levels = [ring + z * up for z in half * np.linspace(-1.0, 1.0, 5)]
    end = (half + radius if kind == CAPSULE else half) * up
    return np.concatenate([*levels, end[None], -end[None], 0.0 * end[None]])


def extent_along(tools: ToolSet, tool: int, direction: Floats, orientation: Floats) -> float:
    """How far a tool reaches from its position along a unit direction [m]; 0 for a plane.

    orientation (4,)  of the tool
    """
    kind, shape = tools.kind[tool], tools.shape[tool]
    if kind == PLANE:
        return 0.0
    if kind == SPHERE:
        return float(shape[0])
    own = np.array(rotate_back(orientation, *direction))
    if kind == BOX:
        return float(np.abs(own) @ shape[:3])
    if kind == CAPSULE:
        return float(shape[0] + abs(own[2]) * shape[1])
    if kind == CYLINDER:
        return float(shape[0] * np.hypot(own[0], own[1]) + abs(own[2]) * shape[1])
    return float((tools.outline[tool] @ own).max())
