"""A block in cells: its surface where they fill it exactly, at lattice nodes; and hexahedra that are thinner where
contact makes stress peak, at its faces or at the edges of tools."""

from collections.abc import Sequence

import numpy as np

from softseam_protocol.material_borders import pieces
from softseam_protocol.tool_borders import Line
from softseam_services.body.body import Floats, Ints, Surface
from softseam_services.body.hexahedra import CORNERS
from softseam_services.body.lattice import LOCAL, number_nodes
from softseam_services.body.mesh_io import RawHexahedra

_SIMPSON_LINE = np.array([1.0, 4.0, 1.0]) / 6.0


def block_surface(counts: Ints, edges: Floats, cell_nodes: Ints, node_grid: Ints) -> Surface:
    """Surface points at the lattice nodes of the six faces, eight triangles a cell face.

    A point stands for the integral of its hex27 face shape functions (Simpson), so the areas sum to the block's and a
    uniform pressure gives each node its consistent force. Normals of edge and corner points are area-weighted means.
    """
    n_nodes = len(node_grid)
    area = np.zeros(n_nodes)
    normal = np.zeros((n_nodes, 3))
    triangles: list[Ints] = []
    cells = np.arange(len(cell_nodes)).reshape(counts[::-1]).transpose(2, 1, 0)
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        weight = edges[u] * edges[v] * np.outer(_SIMPSON_LINE, _SIMPSON_LINE)
        for side in (0, 2):
            face = np.take(cells, 0 if side == 0 else -1, axis=axis).ravel()
            stride = np.array([1, 3, 9])
            local = side * stride[axis] + np.arange(3)[:, None] * stride[u] + np.arange(3)[None, :] * stride[v]
            quads = cell_nodes[face][:, local]
            np.add.at(area, quads, weight)
            np.add.at(normal[:, axis], quads, weight if side == 2 else -weight)
            a, b = quads[:, :-1, :-1].ravel(), quads[:, 1:, :-1].ravel()
            c, d = quads[:, 1:, 1:].ravel(), quads[:, :-1, 1:].ravel()
            order = ((a, b, c), (a, c, d)) if side == 2 else ((a, c, b), (a, d, c))
            triangles.extend(np.stack(corners, axis=1) for corners in order)
    points = np.flatnonzero(area)
    number = np.full(n_nodes, -1, dtype=np.int32)
    number[points] = np.arange(len(points))
    grid = node_grid[points]
    cell = np.minimum(grid // 2, counts - 1)
    return Surface(
        cell=(cell[:, 0] + counts[0] * (cell[:, 1] + counts[1] * cell[:, 2])).astype(np.int32),
        local=(grid - 2 * cell - 1).astype(np.float64),
        area=area[points],
        normal=normal[points] / np.linalg.norm(normal[points], axis=1, keepdims=True),
        triangles=number[np.concatenate(triangles)],
    )


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
