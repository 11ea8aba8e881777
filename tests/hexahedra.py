"""Meshes of hexahedra as files, for tests of cells of one's own: blocks bent and distorted at will."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Vector = tuple[float, float, float]
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
"""of a hexahedron in VTK's order, in cells"""


def lattice(counts: tuple[int, int, int], size: Vector, nodes: int = 8) -> tuple[Floats, Longs]:
    """Points of a block around the origin's x and y, from z = 0 up; cells of 8 or 27 nodes, x fastest."""
    per = 1 if nodes == 8 else 2
    lines = [np.arange(per * n + 1) for n in counts]
    k, j, i = (a.ravel() for a in np.meshgrid(*reversed(lines), indexing="ij"))
    grid = np.stack([i, j, k], axis=1)
    points = grid * (np.array(size) / (per * np.array(counts))) - np.array([0.5, 0.5, 0.0]) * np.array(size)
    stride = np.array([1, len(lines[0]), len(lines[0]) * len(lines[1])])
    local = per * CORNERS
    if nodes == 27:
        edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
        faces = [(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 1, 2, 3), (4, 5, 6, 7)]
        local = np.concatenate(
            [local, [(local[a] + local[b]) // 2 for a, b in edges], [local[list(f)].sum(axis=0) // 4 for f in faces]]
        )
        local = np.concatenate([local, [[1, 1, 1]]])
    at = np.stack([a.ravel() for a in np.meshgrid(*[np.arange(n) for n in reversed(counts)], indexing="ij")], axis=1)
    cells = ((per * at[:, None, ::-1] + local) @ stride).astype(np.int64)
    return points, cells


def distorted(points: Floats, size: Vector, amount: float) -> Floats:
    """Points inside moved by up to `amount` of the size; those of a face stay on it."""
    s = points / np.array(size) + np.array([0.5, 0.5, 0.0])
    bump = np.prod(np.sin(np.pi * s), axis=1)[:, None]
    along = np.sin(2.0 * np.pi * s)  # shifts along faces, and vanishes on those across
    twist = np.roll(np.cos(np.pi * s), 1, axis=1)
    moved: Floats = points + amount * np.array(size) * (0.4 * along * twist + bump * np.array([1.0, -1.0, 0.7]))
    return moved


def vtk(points: Floats, cells: Longs, suffix: str = ".vtk") -> bytes:
    """A file of these hexahedra, as meshio writes it."""
    kind = {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"}[cells.shape[1]]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"mesh{suffix}"
        meshio.write(file, meshio.Mesh(points, [(kind, cells)]))
        return file.read_bytes()


def mesh(
    counts: tuple[int, int, int],
    size: Vector,
    amount: float = 0.0,
    bend: Callable[[Floats], Floats] | None = None,
    nodes: int = 8,
) -> bytes:
    """A block of hexahedra, distorted inside and then bent."""
    points, cells = lattice(counts, size, nodes)
    points = distorted(points, size, amount)
    return vtk(points if bend is None else bend(points), cells)
