"""Tools that move or turn too far in a step: what was before them comes out behind them, and is held there.

So FEM takes such a step in parts (`parts_needed`), and an event reports it (`beyond_middle`).
"""

import math

import numpy as np

from softseam_protocol.messages.participant import ToolMotion
from softseam_services.body.body import SAME, Floats
from softseam_services.shapes.branches import BOX
from softseam_services.tools.kernels import rotate, rotate_back
from softseam_services.tools.tool_set import ToolSet

FINEST = 32
"""parts of a step, at most, in which bodies follow what a tool does"""
_SHARE = 0.5
"""of a tool's radius, that it may come on by in a part"""


def parts_needed(tools: ToolSet, motion: ToolMotion, x: Floats, v: Floats, dt: float) -> int:
    """In how many equal parts to take a step, so that no round tool comes on by half its radius in one: a power of 2.

    1 as a rule: where tools stand, move with what they touch, or come near nothing; FINEST at most. Seen from the nodes
    that the ball about a tool meets on its way.
    x, v (n, 3)  nodes of a body as the step begins [m], and their velocities [m/s]
    dt           of the step [s]
    """
    farthest = max((_comes_on(tools, motion, tool, x, v, dt) for tool in tools.round), default=0.0)
    parts = 1
    while parts < FINEST and farthest > _SHARE * parts:
        parts *= 2
    return parts


def _comes_on(tools: ToolSet, motion: ToolMotion, tool: int, x: Floats, v: Floats, dt: float) -> float:
    """How far a round tool that moves comes on in a step towards any node near its way, or past it, in its radii."""
    begin, end, reach = motion.position[tool], motion.position_next[tool], tools.reach[tool]
    turned = 2.0 * reach * math.dist(motion.orientation[tool], motion.orientation_next[tool])
    if turned == 0.0 and (begin == end).all():
        return 0.0
    low, high, way = np.minimum(begin, end) - reach, np.maximum(begin, end) + reach, dt * v
    near = ((np.maximum(x, x + way) >= low) & (np.minimum(x, x + way) <= high)).all(axis=1)
    return float(np.linalg.norm(way[near] - (end - begin), axis=1).max(initial=0.0) + turned) / tools.thin[tool]


def beyond_middle(tools: ToolSet, motion: ToolMotion) -> list[str]:
    """Tools whose middle gets in a step to where their face was; a point that lay before it is nearer to the far face.

    Of a box along each of its edges, of others by the balls of their core; where they turn, at any of a box's corners,
    or of these balls. Planes have no far side; shapes without a core, as meshes, are not looked at.
    """
    found = []
    turns = np.zeros(len(tools.names), dtype=np.bool_)
    if motion.orientation_next is not motion.orientation:
        turns = (motion.orientation_next != motion.orientation).any(axis=1)
    for tool, (x, y, z) in enumerate((motion.position_next - motion.position).tolist()):
        turned = bool(turns[tool])
        if not turned and x * x + y * y + z * z < tools.short[tool]:
            continue  # nearly every step: whichever way it points, it is too short
        if tools.kind[tool] == BOX:
            far = _box_beyond(tools.shape[tool, :3], motion, tool, turned)
        else:
            far = any(_ball_beyond(ball, motion, tool, turned) for ball in tools.geometry[tool].core)
        if far:
            found.append(tools.names[tool])
    return found


def _way(motion: ToolMotion, tool: int) -> Floats:
    return np.asarray(motion.position_next[tool] - motion.position[tool])


def _ball_beyond(ball: Floats, motion: ToolMotion, tool: int, turned: bool) -> bool:
    """Whether a ball of a tool's core, centre and radius (4,), goes as far as its radius."""
    way, centre = _way(motion, tool), ball[:3]
    if turned:
        before, after = motion.orientation[tool], motion.orientation_next[tool]
        way = way + np.array(rotate(after, *centre)) - np.array(rotate(before, *centre))
    return math.hypot(*way) >= (1.0 - SAME) * float(ball[3])


def _box_beyond(half: Floats, motion: ToolMotion, tool: int, turned: bool) -> bool:
    """The same of a box with half edges (3,).

    Where it turns, what stood at a corner at the start is past its middle plane at the end, in its own frame: by that
    of the corner's three faces on which it was.
    """
    way = _way(motion, tool)
    before, after = motion.orientation[tool], motion.orientation_next[tool]
    farthest = math.hypot(*way) + (2.0 * math.hypot(*(after - before)) * math.hypot(*half) if turned else 0.0)
    if farthest < 0.9 * min(half):
        return False
    if not turned:
        inside = rotate_back(before, *way)
        return any(abs(part) >= (1.0 - SAME) * edge for part, edge in zip(inside, half, strict=True))
    for corner in np.array(np.meshgrid(*((-edge, edge) for edge in half))).reshape(3, 8).T:
        still = np.array(rotate(before, *corner))
        seen = np.array(rotate_back(after, *(still - way)))
        if (seen * np.sign(corner) <= SAME * np.abs(corner)).any():
            return True
    return False
