"""The surface of a piece that is made of blocks, for pictures."""

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.recording import SurfaceMesh

_FACES = np.array([[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]])
"""corners around each face; corner i of a block is at x = i & 1, y = i >> 1 & 1, z = i >> 2"""


def block_surface(nodes: NDArray[np.int32], rest: NDArray[np.float64]) -> SurfaceMesh:
    """Two triangles for each face that only one block has; its points are the nodes.

    nodes  corners of the blocks (b, 8)
    rest   places of the nodes (n, 3) [m]
    """
    faces = nodes[:, _FACES].reshape(-1, 4)
    middles = np.repeat(rest[nodes].mean(axis=1), len(_FACES), axis=0)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = np.sort(first[count == 1])
    faces, middles = faces[outer], middles[outer]
    a, b, c = (rest[faces[:, i]] for i in range(3))
    inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - middles) < 0.0
    faces = np.where(inwards[:, None], faces[:, ::-1], faces)
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]).astype(np.int32)
    header, none = Header(SCHEMA_VERSION, "local", "", 0, 0, 0, 0.0), np.zeros((0, 3))
    return SurfaceMesh(header, "body", rest, triangles, none, np.ones(3), np.zeros((0, 8)), {})
