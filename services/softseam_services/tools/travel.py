"""Tools that move too far in a step: what was before them comes out behind them, and is held there."""

from __future__ import annotations

import math

from softseam_protocol.messages import ToolMotion
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import BOX, CAPSULE, CYLINDER, SPHERE, ToolSet


def beyond_middle(tools: ToolSet, motion: ToolMotion) -> list[str]:
    """Tools whose middle gets in a step to where their face was; a point that lay before it is nearer to the far face.

    Of a box along each of its edges, of a round one along the way. Planes have no far side; meshes are not looked at.
    """
    found = []
    for tool, (x, y, z) in enumerate((motion.position_next - motion.position).tolist()):
        if x == y == z == 0.0:
            continue
        kind, half = tools.kind[tool], tools.shape[tool, :3].tolist()
        least = min(half) if kind == BOX else half[0]
        if x * x + y * y + z * z < 0.9 * least * least:
            continue  # nearly every step: whichever way it points, it is too short
        if kind == BOX:
            inside = rotate_back(motion.orientation[tool], x, y, z)
            far = any(abs(way) >= (1.0 - 1e-9) * edge for way, edge in zip(inside, half, strict=True))
        else:
            far = kind in (SPHERE, CAPSULE, CYLINDER) and math.hypot(x, y, z) >= (1.0 - 1e-9) * half[0]
        if far:
            found.append(tools.names[tool])
    return found
