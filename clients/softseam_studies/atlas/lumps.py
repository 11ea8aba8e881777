"""Meshes of lumps: closed surfaces by two angles, and the file of one."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]


def _round(u: Floats, v: Floats, across: Floats | float, height: float) -> tuple[Floats, Floats, Floats]:
    """A lump: half its width, `across`, by the angle v around, and half its height; u goes from pole to pole."""
    return across * np.sin(u) * np.cos(v), across * np.sin(u) * np.sin(v), height * np.cos(u)


def _ring(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """A tube of 12 mm around a circle of 32 mm; u runs twice as fast around the tube, so that it closes."""
    away = 16.0 + 6.0 * np.cos(2.0 * u)
    return away * np.cos(v), away * np.sin(v), 6.0 * np.sin(2.0 * u)


SURFACES: dict[str, Surface] = {
    "ball": lambda u, v: _round(u, v, 12.0, 12.0),
    "bun": lambda u, v: _round(u, v, 18.0, 9.0),
    "star": lambda u, v: _round(u, v, 15.0 + 4.0 * np.cos(5.0 * v), 8.0),
    "ring": _ring,
}
"""points (...) [mm] by u from 0 to pi and v from 0 to 2 pi"""


def surface(shape: str, around: int = 48) -> tuple[Floats, NDArray[np.int64]]:
    """Points (n, 3) [mm] and triangles (m, 3), outward, of a closed surface: a grid over u and v, its seams closed."""
    u, v = np.meshgrid(
        np.linspace(0.0, np.pi, around // 2 + 1), np.linspace(0.0, 2.0 * np.pi, around + 1), indexing="ij"
    )
    grid = np.stack(SURFACES[shape](u, v), axis=-1).reshape(-1, 3)
    points, which = np.unique(np.round(grid, 9) + 0.0, axis=0, return_inverse=True)
    at = which.reshape(u.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    flat = (np.diff(np.sort(triangles, axis=1), axis=1) == 0).any(axis=1)
    return points, triangles[~flat]


def obj(points: Floats, triangles: NDArray[np.int64]) -> str:
    """The file."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist()]
    return "\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()])
