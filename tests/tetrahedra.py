"""Meshes of tetrahedra as files and scenes whose cells they are, for tests of FEM on a file's own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tet_bar import bar, vtk

from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Vector = tuple[float, float, float]

EDGES = {
    "vtk": [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)],
    "gmsh": [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)],
}
"""corners at the ends of the edges with middle nodes, in the order of either"""


def shaken(counts: tuple[int, int, int], size: Vector, amount: float = 0.15, seed: int = 1) -> tuple[Floats, Longs]:
    """A bar's points, those inside moved by up to `amount` of a cube's edge, and its tetrahedra."""
    points, cells = bar(counts, size)
    inside: NDArray[np.bool_] = np.all(np.abs(points) < 0.5 * np.array(size) - 1e-9, axis=1)
    shift = np.random.default_rng(seed).uniform(-amount, amount, points.shape) * np.array(size) / counts
    return points + np.where(inside[:, None], shift, 0.0), cells


def with_middles(
    points: Floats, cells: Longs, bend: Callable[[Floats], Floats] | None = None, order: str = "vtk"
) -> tuple[Floats, Longs]:
    """Points and tetrahedra of ten nodes, bent with their middle nodes."""
    ends = np.sort(cells[:, EDGES[order]].reshape(-1, 2), axis=1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    every = np.concatenate([points, points[edges].mean(axis=1)])
    return (every if bend is None else bend(every)), np.concatenate(
        [cells, len(points) + number.reshape(-1, 6)], axis=1
    )


def ten_nodes(points: Floats, cells: Longs) -> bytes:
    """VTK's legacy format of quadratic tetrahedra."""
    text = vtk(points, cells).decode()
    head, rows = text.split("CELLS ")[0], ["10 " + " ".join(map(str, cell)) for cell in cells.tolist()]
    lines = [f"CELLS {len(cells)} {11 * len(cells)}", *rows, f"CELL_TYPES {len(cells)}", *["24"] * len(cells)]
    return (head + "\n".join(lines) + "\n").encode()


def tetrahedral(
    element: str = "hex27", young: float = 100e3, poisson: float = 0.4, kind: str = "neo_hookean", **keys: Any
) -> Scene:
    """A scene whose cells are the tetrahedra of m.vtk; keys of the body, of fem, and of the scene."""
    body = {key: keys.pop(key) for key in ("fixed", "position", "cell", "inclusions", "velocity") if key in keys}
    fem = {key: keys.pop(key) for key in ("integrator",) if key in keys}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "tetrahedra",
            "duration": 1.0,
            "body": {
                "shape": {"kind": "mesh", "path": "m.vtk", "cells": "tetrahedra"},
                "material": {"kind": kind, "young": young, "poisson": poisson, "density": 1000.0},
                **body,
            },
            "models": {"fem": {"element": element, "tolerance": 1e-8, **fem}},
            **keys,
        }
    )
