"""A block in hexahedra that are thinner where contact makes stress peak: at its faces, or at the edges of tools."""

from collections.abc import Sequence

import numpy as np

from softseam_protocol.material_borders import pieces
from softseam_protocol.tool_borders import Line
from softseam_services.body.body import Floats
from softseam_services.body.hexahedra import CORNERS
from softseam_services.body.lattice import LOCAL, number_nodes
from softseam_services.body.mesh_io import RawHexahedra


def graded_block(lines: Sequence[Floats]) -> RawHexahedra:
    """A block in cells whose borders along x, y and z are `lines`, each (n + 1,) [m]."""
    counts = np.array([len(line) - 1 for line in lines])
    x, y, z = np.meshgrid(*lines, indexing="ij")
    points = np.stack([place.ravel(order="F") for place in (x, y, z)], axis=1)
    cells = number_nodes(np.ones(counts, dtype=np.bool_))[0].astype(np.int64)
    corners = cells[:, None, :] + LOCAL[CORNERS] // 2
    strides = np.cumprod([1, counts[0] + 1, counts[1] + 1])
    return RawHexahedra(points, (corners @ strides,))


def graded_line(count: int, grading: float, ends: tuple[bool, bool] = (True, True)) -> Floats:
    """Where `count` cells on [0, 1] end (count + 1,): each is longer by one factor than its neighbour towards an end.

    ends: whether they are thinner towards 0, and towards 1. The longest is `grading` times as long as the thinnest.
    """
    up, down = np.arange(count), np.arange(count)[::-1]
    inward = {(True, True): np.minimum(up, down), (True, False): up, (False, True): down}.get(ends, 0 * up)
    widths = grading ** (inward / max(1, int(inward.max())))
    return np.concatenate([[0.0], np.cumsum(widths) / widths.sum()])


def bordered_line(edge: float, wanted: float, grading: float, line: Line) -> Floats:
    """Where cells on [0, edge] end, with borders in the line's planes and thinner towards them [m].

    Each piece between planes has about `wanted` [m] long cells, one at least.
    """
    cut = pieces(edge, wanted, line.planes)
    ends = [line.faces[0], *[True] * (len(cut) - 1), line.faces[1]]
    found = [np.zeros(1)]
    for i, (low, high, count) in enumerate(cut):
        found.append(low + (high - low) * graded_line(count, grading, (ends[i], ends[i + 1]))[1:])
    return np.concatenate(found)
