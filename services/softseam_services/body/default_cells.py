"""Edges of cells where a scene leaves them open: as long as forces stay within some per cent."""

from itertools import product
from typing import Any

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.embed import DROPPED, fill_of_cells, moments_of
from softseam_services.body.lattice import divide

_ACROSS = 3.0
"""cells along a block's least extent"""
_MOST, _MOST_FOR_TOOLS = 3_000, 512
"""cells of a body: a step of some seconds by FEM, of some tenths by XPBD; and those that narrow tools may ask for, of
which a step of FEM takes some hundredths"""
_HALF_WIDTHS = 1.0
"""cells that are longer, in half widths of a tool, are bitten by it, and hold with too little friction
(docs/decisions/43)"""
_WALLS, _LEAST_CELLS = 1.2, 48.0
_LARGER, _FULLER = 1.25, 1.02
"""volume of a cell over that of a cube of the wanted edge, where longer cells fit a solid better, and by how much more
of them it fills then"""


def block_edge(size: Any, half_width: float = np.inf) -> float:
    """Of a block [m]: a third of its least extent, less where a tool is narrow, but longer where that were thousands:
    thin plates and long sticks have fewer through their thickness.

    size (3,) [m], half_width: of the narrowest tool that presses between nodes [m]
    """
    whole = _at_most(_MOST, size, min(size) / _ACROSS)
    narrow = _HALF_WIDTHS * half_width
    return whole if narrow >= whole else min(whole, _at_most(_MOST_FOR_TOOLS, size, narrow))


def _at_most(n_cells: int, size: Any, edge: float) -> float:
    """The edge, or a longer one that leaves so many cells [m]."""
    while int(divide(np.array(size), np.full(3, edge))[0].prod()) > n_cells:
        edge *= 1.05
    return edge


def solid_edges(vertices: Floats, triangles: Ints, half_width: float = np.inf) -> Floats:
    """Along each axis of what a closed surface encloses (3,) [m]: `solid_edge` as its bounding box divides, rounded
    otherwise where there are fewer cells then, and fuller ones. Arguments as of `solid_edge`."""
    size, edge = np.ptp(vertices, axis=0), solid_edge(vertices, triangles, half_width)
    best = divide(size, np.full(3, edge))[0]
    if edge < solid_edge(vertices, triangles):
        return np.asarray(size / best)

    def filled(counts: Ints) -> tuple[int, float]:
        fill = fill_of_cells(moments_of(vertices, triangles, counts)[..., 0])
        return int((fill > DROPPED).sum()), float(fill[fill > DROPPED].mean())

    most, fullest = filled(best)
    for counts in product(*(sorted({max(1, int(n)), int(np.ceil(n))}) for n in size / edge)):
        if np.prod(size / counts) <= _LARGER * edge**3:
            n_cells, fill = filled(np.array(counts, dtype=np.int32))
            if n_cells < most and fill > _FULLER * fullest:
                best, fullest = np.array(counts, dtype=np.int32), fill
    return np.asarray(size / best)


def solid_edge(vertices: Floats, triangles: Ints, half_width: float = np.inf) -> float:
    """Of what a closed surface encloses [m]: 1.2 times 2V/S, a wall's thickness, and so short that there are some 50
    cells, less where a tool is narrow. Quadratic cells of that size give forces within 5 to 7 %.

    vertices (n, 3) [m], triangles (T, 3) closed and outward, half_width: of the narrowest tool [m]
    """
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    volume = float(np.einsum("ti,ti->", a, np.cross(b, c))) / 6.0
    surface = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    whole = min(_WALLS * 2.0 * volume / surface, (volume / _LEAST_CELLS) ** (1.0 / 3.0))
    return float(min(whole, max(_HALF_WIDTHS * half_width, (volume / _MOST_FOR_TOOLS) ** (1.0 / 3.0))))
