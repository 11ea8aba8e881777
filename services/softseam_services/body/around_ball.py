"""A block whose cells follow a ball inside it: a cube in the ball, layers between it and a box, a lattice outside.

In the box's own coordinates s in [-1, 1]^3 a direction is that of equal angles, and the cube bulges towards the ball,

    d(s) = t/|t|,  t = tan(pi s/4),          c_i(s) = s_i (1 - (s_j^2 + s_k^2)/10)/2                                (1)

with d of Ronchi, Iacono and Paolucci, J. Comput. Phys. 124 (1996) 93. From a place s on the surface of the cube layers
lead along x(w), with places p(s) on the box, centre, radius and reach of the ball b, a and r:

    x = b + a ((1 - w) c(s) + w d(s)),  0 <= w <= 1                                                                 (2)
    x = (1 - u) (b + a d(s)) + u p(s),  u = (q^(w - 1) - 1)/(q - 1),  q = 3 r/2,  1 <= w <= 2                       (3)

Layers outside are thinner at the ball. All 27 nodes of a cell are at their own places, so that cells are curved and
their faces on the ball biquadratic; a is such that they hold the ball's volume (by 3^3 Gauss points, exactly), which
they would miss by order 4 in their edge with the radius itself.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from softseam_protocol.inner_ball import Ball
from softseam_services.body.body import Floats, Ints
from softseam_services.body.formats.mesh_file import Cells
from softseam_services.body.hexahedra import cell_volumes_at
from softseam_services.body.lattice import LOCAL

_CUBE = 0.5
"""half edge of the cube at the middles of its faces [radii]"""
_BULGE = 0.1
"""share that its edges are drawn in by, and its corners twice"""
_THINNER = 1.5
"""q of eq. (3) over the ball's reach"""


def block_around(lines: Sequence[Floats], spans: Sequence[tuple[int, int]], ball: Ball) -> tuple[Floats, Ints]:
    """Nodes (N, 3) [m] from the block's lower corner, and those of each cell (C, 27).

    lines  where cells end along x, y and z, each (n + 1,) [m]
    spans  first and last of these at the box, along each
    """
    first, last = np.array(spans).T
    inside, outside = ball.layers((int(last[0] - first[0]), int(last[1] - first[1]), int(last[2] - first[2])))
    kept = np.ones([len(line) - 1 for line in lines], dtype=np.bool_)
    kept[tuple(slice(a, b) for a, b in spans)] = False
    box = 2 * (inside + outside)
    lattice, cube = (2 * cells[:, None] + LOCAL for cells in (np.argwhere(kept), np.argwhere(~kept)))
    shells = [_shell(first, last, face, layer) for face in range(6) for layer in range(inside + outside)]
    # layer of each node, and its place on the lattice (C, 27, 4)
    keys = np.concatenate([_at(box, lattice), _at(0, cube), *shells])
    nodes, number = np.unique(keys.reshape(-1, 4), axis=0, return_inverse=True)
    cell_nodes = np.asarray(number.reshape(-1, 27), dtype=np.int32)
    layer, place = nodes[:, 0], nodes[:, 1:]
    s = (place - 2 * first) / (last - first) - 1.0
    square = s * s
    core = _CUBE * s * (1.0 - _BULGE * (square.sum(axis=1, keepdims=True) - square))  # eq. (1)
    angle = np.tan(0.25 * np.pi * s)
    out = angle / np.maximum(np.linalg.norm(angle, axis=1, keepdims=True), 1e-300)
    w = np.minimum(layer / (2.0 * inside), 1.0)[:, None]
    unit = (1.0 - w) * core + w * out  # eq. (2)
    of_ball = keys[:, :, 0].max(axis=1) <= 2 * inside
    volume = float(cell_volumes_at(unit[cell_nodes[of_ball]]).sum())
    radius = ball.radius * (4.0 / 3.0 * np.pi / volume) ** (1.0 / 3.0)
    q = _THINNER * ball.reach
    u = (q ** np.maximum((layer - 2 * inside) / (2.0 * outside), 0.0)[:, None] - 1.0) / (q - 1.0)  # eq. (3)
    on_lattice = np.stack([_halved(line)[place[:, axis]] for axis, line in enumerate(lines)], axis=1)
    x = (1.0 - u) * (np.array(ball.centre) + radius * unit) + u * on_lattice
    return np.where((layer == box)[:, None], on_lattice, x), cell_nodes


def _at(layer: int, places: Cells) -> Cells:
    """Keys of nodes (..., 4) at these places (..., 3) on the lattice."""
    return np.concatenate([np.full((*places.shape[:-1], 1), layer), places], axis=-1)


def _shell(first: Cells, last: Cells, face: int, layer: int) -> Cells:
    """Keys (c, 27, 4) of one layer's cells on the face -x +x -y +y -z +z of the cube.

    Their own axes lead outwards, and as the box's do: so diagonals of faces are the neighbours', which tet10 wants.
    """
    axis, upper = divmod(face, 2)
    u, v = ((axis + 1) % 3, (axis + 2) % 3) if upper else ((axis + 2) % 3, (axis + 1) % 3)
    cells = np.array(list(product(range(first[u], last[u]), range(first[v], last[v]))))
    keys = np.empty((len(cells), 27, 4), dtype=np.int64)
    keys[:, :, 0] = 2 * layer + LOCAL[:, 0]
    keys[:, :, 1 + axis] = 2 * (last if upper else first)[axis]
    keys[:, :, 1 + u] = 2 * cells[:, :1] + LOCAL[:, 1]
    keys[:, :, 1 + v] = 2 * cells[:, 1:] + LOCAL[:, 2]
    return keys


def _halved(line: Floats) -> Floats:
    """Where cells end and their middles (2 n + 1,) [m]."""
    return np.interp(np.arange(2 * len(line) - 1), np.arange(0, 2 * len(line), 2), line)
