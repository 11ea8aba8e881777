"""Tools that move too far in a step: what was before them comes out behind them, and is held there."""

from __future__ import annotations

import numpy as np

from softseam_protocol.messages import ToolMotion
from softseam_services.tools.tool_set import BOX, CAPSULE, CYLINDER, SPHERE, ToolSet


def beyond_middle(tools: ToolSet, motion: ToolMotion) -> list[str]:
    """Tools whose middle gets in a step to where their face was; a point that lay before it is nearer to the far face.

    Of a box along each of its edges, of a round one along the way. Planes have no far side; meshes are not looked at.
    """
    way = motion.position_next - motion.position
    if not way.any():
        return []
    found = []
    for tool, name in enumerate(tools.names):
        kind, shape, d = tools.kind[tool], tools.shape[tool], way[tool]
        if kind == BOX:
            w, q = motion.orientation[tool, 0], -motion.orientation[tool, 1:]
            inside = d + 2.0 * np.cross(q, np.cross(q, d) + w * d)
            far = bool((np.abs(inside) >= (1.0 - 1e-9) * shape[:3]).any())
        else:
            far = kind in (SPHERE, CAPSULE, CYLINDER) and bool(np.linalg.norm(d) >= (1.0 - 1e-9) * shape[0])
        if far:
            found.append(name)
    return found
