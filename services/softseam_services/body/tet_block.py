"""A block of tetrahedra, five to a cube: its points are a lattice, and cubes that meet are each other's images."""

from itertools import product
from typing import NamedTuple

import numpy as np

from softseam_protocol.scene.spec import Vector
from softseam_services.body.body import Floats, Ints

FIVE = np.array(
    [
        [[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]],
        [[1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 0, 1]],
        [[0, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 1]],
        [[0, 0, 1], [0, 1, 1], [1, 0, 1], [0, 0, 0]],
        [[1, 1, 1], [0, 1, 1], [1, 1, 0], [1, 0, 1]],
    ]
)
"""corners of the tetrahedra of a cube whose place is even: a regular one in the middle, and four in corners"""


class TetBlock(NamedTuple):
    """n points and m tetrahedra."""

    points: Floats
    """about the middle, z fastest (n, 3) [m]"""
    tetrahedra: Ints
    """of positive volume (m, 4)"""
    share: Floats
    """of the block's mass at each point: an eighth of each cube's at its corners (n,) [1]"""


def tet_block(size: Vector, divisions: tuple[int, int, int]) -> TetBlock:
    """A block of this size [m] in so many cubes along x, y and z.

    A quarter of each tetrahedron's mass at its corners would give five neighbours' mass to every other point; so mass
    is lumped by cubes.
    """
    counts = np.array(divisions)
    lines = [np.arange(count + 1) for count in divisions]
    place = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    step = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    cubes = place[(place < counts).all(axis=1)]
    odd = cubes.sum(axis=1) % 2 == 1
    corners = np.where(odd[:, None, None, None], 1 - FIVE, FIVE)
    tetrahedra = ((cubes[:, None, None] + corners) @ step).reshape(-1, 4)
    mirrored = np.repeat(odd, len(FIVE))
    tetrahedra[mirrored] = tetrahedra[mirrored][:, [0, 2, 1, 3]]
    share = np.zeros(len(place))
    for corner in product((0, 1), repeat=3):
        np.add.at(share, (cubes + corner) @ step, 0.125 / len(cubes))
    return TetBlock((place / counts - 0.5) * np.array(size), tetrahedra.astype(np.int32), share)
