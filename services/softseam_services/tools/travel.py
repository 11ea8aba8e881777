"""Tools that move or turn too far in a step: what was before them comes out behind them, and is held there."""

from __future__ import annotations

import math

import numpy as np

from softseam_protocol.messages.participant import ToolMotion
from softseam_services.tools.kernels import rotate, rotate_back
from softseam_services.tools.tool_set import BOX, CAPSULE, CYLINDER, SPHERE, ToolSet


def beyond_middle(tools: ToolSet, motion: ToolMotion) -> list[str]:
    """Tools whose middle gets in a step to where their face was; a point that lay before it is nearer to the far face.

    Of a box along each of its edges, of a round one along the way; where they turn, at any of their corners, or either
    end of their axis. Planes have no far side; meshes are not looked at.
    """
    found = []
    turns = np.zeros(len(tools.names), dtype=np.bool_)
    if motion.orientation_next is not motion.orientation:
        turns = (motion.orientation_next != motion.orientation).any(axis=1)
    for tool, (x, y, z) in enumerate((motion.position_next - motion.position).tolist()):
        if turns[tool]:
            if _turned_beyond(tools, motion, tool):
                found.append(tools.names[tool])
            continue
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


def _turned_beyond(tools: ToolSet, motion: ToolMotion, tool: int) -> bool:
    """The same of one tool that turns.

    What stood at a corner of a box at the start is past its middle plane at the end, in its own frame: by that of the
    corner's three faces on which it was. The axis of a round one moves by its radius at either end.
    """
    kind, half = tools.kind[tool], tools.shape[tool, :3].tolist()
    if kind == BOX:
        corners = np.array(np.meshgrid(*((-edge, edge) for edge in half))).reshape(3, 8).T
    elif kind in (SPHERE, CAPSULE, CYLINDER):
        corners = np.array([[0.0, 0.0, -half[1]], [0.0, 0.0, half[1]]])  # a sphere has none
    else:
        return False
    before, after = motion.orientation[tool], motion.orientation_next[tool]
    way = motion.position_next[tool] - motion.position[tool]
    farthest = float(np.linalg.norm(way) + 2.0 * np.linalg.norm(after - before) * np.linalg.norm(corners[0]))
    if farthest < 0.9 * (min(half) if kind == BOX else half[0]):
        return False  # nearly every step
    for corner in corners:
        turned, still = np.array(rotate(after, *corner)), np.array(rotate(before, *corner))
        if kind == BOX:
            seen = np.array(rotate_back(after, *(still - way)))
            if (seen * np.sign(corner) <= 1e-9 * np.abs(corner)).any():
                return True
        elif float(np.linalg.norm(way + turned - still)) >= (1.0 - 1e-9) * half[0]:
            return True
    return False
