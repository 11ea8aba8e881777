"""Where a block's materials meet, and the cells that end there.

A border of two materials through a cell is a kink in what the cell takes for smooth. Inclusions that are boxes end in
planes; continued through the block, these cut it into pieces along each axis, each of a whole number of cells.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

from softseam_protocol.scene.materials import InclusionSpec
from softseam_protocol.scene.parts import BoxPart
from softseam_protocol.scene.spec import Vector

Planes = tuple[float, ...]
"""along one axis, from the block's lower face, inside it, ascending [m]"""
Piece = tuple[float, float, int]
"""where a piece between planes begins and ends [m], and how many cells it has"""

APART = 0.1
"""planes that are closer than that to another, or to a face, are left out [wanted cell edges]"""
ROUNDING = 1e-9


def material_borders(
    size: Vector, position: Vector, inclusions: Sequence[InclusionSpec]
) -> tuple[Planes, Planes, Planes]:
    """Planes along x, y and z in which boxes among the inclusions end, for a block of `size` with its base's centre at
    `position` [m]. Boxes that are turned otherwise than by quarters, and other shapes, have none."""
    planes: tuple[set[float], ...] = (set(), set(), set())
    lower = (position[0] - 0.5 * size[0], position[1] - 0.5 * size[1], position[2])
    for inclusion in inclusions:
        part = inclusion.shape
        half = half_edges(part.size, part.rotation) if isinstance(part, BoxPart) else None
        if half is None:
            continue
        middle = [part.position[axis] - lower[axis] for axis in range(3)]
        ends = [(middle[axis] - half[axis], middle[axis] + half[axis]) for axis in range(3)]
        if any(ends[axis][1] <= 0.0 or ends[axis][0] >= size[axis] for axis in range(3)):
            continue
        for axis in range(3):
            inside = (at for at in ends[axis] if ROUNDING * size[axis] < at < (1.0 - ROUNDING) * size[axis])
            planes[axis].update(at for at in inside if all(abs(at - p) > ROUNDING * size[axis] for p in planes[axis]))
    x, y, z = (tuple(sorted(each)) for each in planes)
    return x, y, z


def half_edges(size: Vector, rotation: Vector) -> Vector | None:
    """Half edges of a box along x, y and z, turned by quarters; None where it is turned otherwise."""
    x, y, z = (0.5 * edge for edge in size)
    turns = [angle / (0.5 * math.pi) for angle in rotation]
    about = [axis for axis in range(3) if abs(turns[axis]) > ROUNDING]
    if len(about) > 1 or any(abs(turn - round(turn)) > 1e-6 for turn in turns):
        return None
    if not about or round(turns[about[0]]) % 2 == 0:
        return x, y, z
    return ((x, z, y), (z, y, x), (y, x, z))[about[0]]


def pieces(edge: float, wanted: float, planes: Sequence[float]) -> tuple[Piece, ...]:
    """[0, edge] cut by planes: where each piece begins and ends, and how many cells of about `wanted` it has [m].

    Every piece has one cell at least.
    """
    ends = [0.0]
    for plane in planes:
        if min(plane - ends[-1], edge - plane) > APART * wanted:
            ends.append(plane)
    ends.append(edge)
    return tuple(
        (low, high, max(1, math.floor((high - low) / wanted + 0.5 + ROUNDING))) for low, high in pairwise(ends)
    )


def cells_along(edge: float, wanted: float, planes: Sequence[float]) -> int:
    """How many cells these pieces have."""
    return sum(count for _, _, count in pieces(edge, wanted, planes))


def wanted_for(edge: float, count: int, planes: Sequence[float]) -> float | None:
    """A wanted edge that leads to `count` cells [m]; None where none does, because a plane would cut one.

    It divides `edge`, for a wanted edge is first rounded to one that does. Rounding may take half a cell of each piece,
    so that also more equal cells than `count` may lead to it: as many are tried first, then those nearest to it.
    """
    for equal in sorted(range(1, count + len(planes) + 1), key=lambda equal: abs(equal - count)):
        if cells_along(edge, edge / equal, planes) == count:
            return edge / equal
    return None


def are_equal(edge: float, wanted: float, planes: Sequence[float]) -> bool:
    """Whether these cells are of one length, so that equal ones end in the planes by themselves."""
    lengths = [(high - low) / count for low, high, count in pieces(edge, wanted, planes)]
    return max(lengths) - min(lengths) <= 1e-9 * edge
