"""The surface of a block that cells fill exactly: its points are lattice nodes."""

import numpy as np

from softseam_services.body.body import Floats, Ints, Surface

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
