"""Where box tools' edges come to lie on a block: the planes that graded cells have borders in.

A tool looks at the block along the one axis that keeps them apart at time 0, and is taken to reach it along that
axis. It presses the face there, and the four sides of its own face, continued through the block, are planes.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from softseam_protocol.material_borders import ROUNDING, half_edges
from softseam_protocol.scene.spec import Vector, wrong
from softseam_protocol.scene.tools import BoxTool, ToolSpec

_AT = ("body", "shape", "towards")


@dataclass(frozen=True)
class Line:
    """Along one axis of a block."""

    planes: tuple[float, ...]
    """from the block's lower face, inside it, ascending [m]"""
    faces: tuple[bool, bool]
    """whether cells are thinner towards the lower face, and towards the upper one"""


def tool_borders(
    size: Vector, position: Vector, tools: Mapping[str, ToolSpec], towards: tuple[str, ...]
) -> tuple[Line, Line, Line]:
    """Planes along x, y and z for the tools that `towards` names, for a block of `size` with its base's centre at
    `position` [m]. Raises an error about its entry where one has no edges there."""
    planes: tuple[set[float], ...] = (set(), set(), set())
    faces = [[False, False], [False, False], [False, False]]
    for i, name in enumerate(towards):
        tool = tools[name]
        if not isinstance(tool, BoxTool):
            raise wrong(f"{name} is a {tool.kind}: cells are graded towards edges of boxes only, leave it out", *_AT, i)
        half = half_edges(tool.size, tool.rotation)
        if half is None:
            raise wrong(f"{name} stands askew to the block: leave it out, or turn it by quarters alone", *_AT, i)
        middle = (position[0], position[1], position[2] + 0.5 * size[2])
        away = [tool.position[axis] - middle[axis] for axis in range(3)]
        clear = [abs(away[axis]) - half[axis] - 0.5 * size[axis] for axis in range(3)]
        facing = max(range(3), key=lambda axis: clear[axis])
        if sum(gap > ROUNDING for gap in clear) > 1:
            raise wrong(f"{name} is past an edge of the block at time 0, and looks at no face: leave it out", *_AT, i)
        faces[facing][away[facing] > 0.0] = True
        for axis in {0, 1, 2} - {facing}:
            for side, edge in enumerate((away[axis] - half[axis], away[axis] + half[axis])):
                at = edge + 0.5 * size[axis]
                if ROUNDING * size[axis] < at < (1.0 - ROUNDING) * size[axis]:
                    planes[axis].add(at)
                else:
                    faces[axis][side] = True
    x, y, z = (Line(tuple(sorted(p)), (f[0], f[1])) for p, f in zip(planes, faces, strict=True))
    return x, y, z
