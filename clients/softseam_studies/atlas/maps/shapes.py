"""Shape of a body against the cells that it is embedded in, and whether claims of the error hold there."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_studies.atlas.maps.by_cells import BOUND, CLAIM_HOLDS, MATERIAL, ByCells
from softseam_studies.atlas.maps.grid import Map
from softseam_studies.atlas.scenes import Model
from softseam_studies.atlas.trace import Trace, follow

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]

FINEST = 3.0
SQUEEZE, TIME = 0.1, 0.1
"""of the body's width [1], [s]"""


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


def build(shapes: tuple[str, ...] = tuple(SURFACES), edges: tuple[float, ...] = (12.0, 8.0, 6.0, 4.0)) -> Map:
    """The map; a smaller one for tests."""
    text = (
        "Meshes of lumps (E 20 kPa; ball 24 mm, bun 36 x 18, star 38 x 16, ring 44 x 12) lie between rough plates, "
        f"which close by {100 * SQUEEZE:g} % of the width. Accurate: the force is within {100 * BOUND:g} % of FEM's on "
        f"cells of {FINEST:g} mm. {CLAIM_HOLDS}"
    )
    return ByCells(squeezed, "grip_force", edges, FINEST).map(
        "shapes", "Shapes against cells", text, shapes, ("shape", "cell [mm]"), 1.0
    )


@cache
def squeezed(model: Model, shape: str, edge: float) -> Trace:
    """Squeeze, and hold until it rests."""
    points, triangles = surface(shape)
    with TemporaryDirectory() as folder:
        (Path(folder) / "shape.obj").write_text(obj(points, triangles))
        path = Path(folder) / "shapes.yaml"
        path.write_text(json.dumps(scene(model, points, edge)))
        return follow(path, lambda seen: seen.grip_force)


def scene(model: Model, points: Floats, edge: float) -> dict[str, Any]:
    """Points (n, 3) and edge in mm."""
    half, gap, thick = 0.5e-3 * np.ptp(points[:, 0]), 0.1e-3, 0.01
    plate = {"kind": "box", "size": [thick, 0.1, 0.1], "friction": 0.5}
    away = half + gap + 0.5 * thick
    way = gap + SQUEEZE * half
    return {
        "softseam": 1,
        "name": "shapes",
        "step": 0.01,
        "gravity": [0, 0, 0],
        "body": {
            "shape": {"kind": "mesh", "path": "shape.obj", "scale": 1e-3},
            "position": [0, 0, 0],
            "cell": 1e-3 * edge,
            "material": MATERIAL,
        },
        "tools": {
            "left": plate | {"position": [-away, 0, 0.01]},
            "right": plate | {"position": [away, 0, 0.01]},
        },
        "motion": [{"tools": ["left", "right"], "close": way / TIME, "until": {"time": TIME}}, {"hold": 0.1}],
        "regions": {"default": model},
        "quantities": ["grip_force"],
    }


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
