"""Bars of tetrahedra, six to a cube, and their VTK files, for tests of solids of particles."""

from __future__ import annotations

from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from particle_run import ParticleRun, particle_scene

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


def bar(counts: tuple[int, int, int], size: Vector) -> tuple[Floats, NDArray[np.int64]]:
    """Points about the middle and tetrahedra of a box in so many cubes along x, y, z."""
    place = np.stack(np.meshgrid(*[np.arange(c + 1) for c in counts], indexing="ij"), axis=-1).reshape(-1, 3)
    step = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    corner = np.flatnonzero((place < np.array(counts)).all(axis=1))
    cells = []
    for order in permutations(range(3)):
        way = corner[:, None] + np.concatenate([[0], np.cumsum(step[list(order)])])
        even = np.linalg.det(np.eye(3)[list(order)]) > 0.0
        cells.append(way if even else way[:, [0, 2, 1, 3]])
    return (place / np.array(counts) - 0.5) * np.array(size), np.concatenate(cells)


def vtk(points: Floats, tetrahedra: NDArray[np.int64]) -> bytes:
    """VTK's legacy format."""
    lines = ["# vtk DataFile Version 3.0", "bar", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(points)} double"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}"]
    lines += ["4 " + " ".join(map(str, cell)) for cell in tetrahedra.tolist()]
    lines += [f"CELL_TYPES {len(tetrahedra)}", *["10"] * len(tetrahedra)]
    return ("\n".join(lines) + "\n").encode()


def bar_run(
    counts: tuple[int, int, int],
    size: Vector,
    *,
    clamped: bool = True,
    poisson: float = 0.3,
    young: float = 2e4,
    pbd: dict[str, Any] | None = None,
    gravity: Vector = (0.0, 0.0, 0.0),
    tools: dict[str, Any] | None = None,
    **body: Any,
) -> ParticleRun:
    """A bar of 1000 kg/m^3, clamped at its left end or free."""
    fixed = [{"min": (-9.0, -9.0, -9.0), "max": (-0.5 * size[0], 9.0, 9.0)}] if clamped else []
    spec = {"kind": "tet_mesh", "path": "bar.vtk", "density": 1000.0, "young": young, "poisson": poisson}
    scene = particle_scene({**spec, "fixed": fixed, **body}, gravity=gravity, tools=tools, pbd=pbd)
    return ParticleRun(scene, {"bar.vtk": vtk(*bar(counts, size))})
