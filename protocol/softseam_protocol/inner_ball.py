"""A ball inside a block, and how many cells follow it: client and builder count alike.

Around it is a box whose faces are planes that cells end in, or the block's own. Outside the box cells lie on the
lattice of these planes. In it a cube in the ball takes up the box's own cells, and layers of cells lie between its six
faces and the ball's surface, and between that and the six faces of the box.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from softseam_protocol.material_borders import Piece, Planes, half_edges, material_borders
from softseam_protocol.scene.materials import InclusionSpec
from softseam_protocol.scene.parts import BoxPart, SpherePart
from softseam_protocol.scene.spec import Vector

REACH = 1.5
"""least distance of the faces of the box from the ball's middle [radii]"""
WIDTH = 0.5
"""least width of the box, so that finer cells are finer at a small ball, too [shortest edge of the block]"""
_REST = 0.25
"""between the box and a face of the block, or a plane where materials meet; with less the box ends there [reach]"""
_CLEAR = 0.1
"""of the ball from there; with less no cells lie between [radii]"""


@dataclass(frozen=True)
class Ball:
    """A sphere that cells can follow."""

    centre: Vector
    """from the block's lower corner [m]"""
    radius: float
    """[m]"""
    reach: float
    """from the ball's middle to the faces of the box, where these are no planes of others [radii]"""
    planes: tuple[Planes, Planes, Planes]
    """of all that cells end in along x, y and z: faces of the box, and where materials meet [m]"""

    def span(self, pieces: Sequence[Piece], axis: int) -> tuple[int, int]:
        """The first of the box's cells along an axis, and the first behind it."""
        at, cells = self.centre[axis], [0, 0]
        for low, high, count in pieces:
            cells[0] += count if high <= at - self.radius else 0
            cells[1] += count if low < at + self.radius else 0
        return cells[0], cells[1]

    def n_cells(self, lines: Sequence[Sequence[Piece]]) -> int:
        """How many cells there are, for pieces along x, y and z."""
        ends = [self.span(pieces, axis) for axis, pieces in enumerate(lines)]
        a, b, c = (last - first for first, last in ends)
        whole = [sum(count for *_, count in pieces) for pieces in lines]
        return whole[0] * whole[1] * whole[2] + 2 * (a * b + b * c + c * a) * sum(self.layers((a, b, c)))

    def layers(self, counts: tuple[int, int, int]) -> tuple[int, int]:
        """Layers of cells from the cube to the ball's surface, and from there to the box, which has `counts` cells
        along x, y and z.

        Inside they are as thick as cells at the surface are wide; outside, where stress falls with the third power of
        the distance, at most half as thick.
        """
        most = max(counts)
        return max(1, most // 3), math.ceil(0.5 * most * math.log(self.reach) / math.log(REACH) - 1e-9)


def inner_ball(size: Vector, position: Vector, inclusions: Sequence[InclusionSpec]) -> Ball | None:
    """The one sphere among inclusions that cells can follow, for a block of `size` with its base's centre at `position`
    [m]; None where there are more, where others are no boxes along the axes, where a later one covers it, and where it
    reaches to a plane in which materials meet, or to a face of the block."""
    parts = [inclusion.shape for inclusion in inclusions]
    spheres = [part for part in parts if isinstance(part, SpherePart)]
    boxes = [part for part in parts if isinstance(part, BoxPart) and half_edges(part.size, part.rotation) is not None]
    if len(spheres) != 1 or len(boxes) + 1 != len(parts):
        return None
    radius, away = spheres[0].radius, spheres[0].position
    if any(isinstance(part, BoxPart) and _holds(part, away) for part in parts[parts.index(spheres[0]) :]):
        return None
    centre = (away[0] - position[0] + 0.5 * size[0], away[1] - position[1] + 0.5 * size[1], away[2] - position[2])
    reach = max(REACH * radius, 0.5 * WIDTH * min(size))
    found: list[Planes] = []
    for edge, at, planes in zip(size, centre, material_borders(size, position, inclusions), strict=True):
        ends = (0.0, *planes, edge)
        low = max((end for end in ends if end <= at), default=at)
        high = min((end for end in ends if end > at), default=at)
        if min(at - low, high - at) < (1.0 + _CLEAR) * radius:
            return None
        box = [end for end in (at - reach, at + reach) if min(end - low, high - end) > _REST * reach]
        found.append(tuple(sorted((*planes, *box))))
    x, y, z = found
    return Ball(centre, radius, reach / radius, (x, y, z))


def _holds(box: BoxPart, point: Vector) -> bool:
    half = half_edges(box.size, box.rotation)
    assert half is not None
    return all(abs(point[axis] - box.position[axis]) < half[axis] for axis in range(3))
