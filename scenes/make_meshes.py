"""Make the surfaces of the food scenes: `python scenes/make_meshes.py` writes sausage.obj and dumpling.obj beside it.

Both are tubes of rings between two poles, in millimetres, closed and counter-clockwise from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def tube(n_rings: int, n_around: int, section: Callable[[float, Floats], Floats]) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices (n, 3) and triangles (T, 3) of a closed tube.

    section(u, angle) gives points (n_around, 3) of the ring at u in [-1, 1]; at u = -1 and 1 they fall together. Angles
    turn counter-clockwise about +x, from +y to +z.
    """
    u = -np.cos(np.pi * np.arange(n_rings + 2) / (n_rings + 1))  # denser at the ends, where the tube closes
    angle = 2.0 * np.pi * np.arange(n_around) / n_around
    rings = [section(float(value), angle) for value in u[1:-1]]
    poles = [section(end, angle).mean(axis=0, keepdims=True) for end in (-1.0, 1.0)]
    vertices = np.concatenate([*rings, *poles])
    here = np.arange(n_around)
    following = (here + 1) % n_around
    triangles = []
    for ring in range(n_rings - 1):
        a, b = ring * n_around + here, ring * n_around + following
        c, d = b + n_around, a + n_around
        triangles += [np.stack([a, c, d], axis=1), np.stack([a, b, c], axis=1)]
    first, last = n_rings * n_around, n_rings * n_around + 1
    end = (n_rings - 1) * n_around
    triangles.append(np.stack([np.full(n_around, first), following, here], axis=1))
    triangles.append(np.stack([np.full(n_around, last), end + here, end + following], axis=1))
    return vertices, np.concatenate(triangles)


def sausage() -> tuple[Floats, NDArray[np.int64]]:
    """A sausage 120 mm long and 22 mm thick, bent by 6 mm in the plane of the table."""
    length, radius, bend = 120.0, 11.0, 6.0

    def section(u: float, angle: Floats) -> Floats:
        r = radius * np.sqrt(max(0.0, 1.0 - abs(u) ** 6)) * (1.0 + 0.03 * np.sin(5.0 * u))
        middle = bend * (1.0 - u * u)
        return np.stack([np.full_like(angle, 0.5 * length * u), middle + r * np.cos(angle), r * np.sin(angle)], axis=1)

    return tube(38, 20, section)


def dumpling() -> tuple[Floats, NDArray[np.int64]]:
    """A half-moon 80 mm long: a full belly on a flat base, closed at the top by a pleated seam; no two sides alike."""
    length, width, height, bend, pleats = 80.0, 34.0, 36.0, 9.0, 5.0

    def section(u: float, angle: Floats) -> Floats:
        open_ = np.sqrt(max(0.0, 1.0 - u * u))
        tall = height * open_**0.8 * (1.0 + 0.05 * u)
        wide = width * open_ * (1.0 - 0.06 * np.sin(3.0 * u))
        rise = 0.5 * (1.0 + np.sin(angle))  # 0 at the base, 1 at the seam
        side = 0.5 * wide * np.cos(angle) * (1.0 - 0.72 * rise**1.5)
        # Both sides of the seam swing together, so pleats never fold the wall into itself.
        pleat = 2.6 * open_ * rise**4 * np.sin(2.0 * np.pi * pleats * 0.5 * (u + 0.1 * u * u))
        y = side + pleat + bend * u * u
        z = tall * np.maximum(rise, 0.08) + (height - tall) * 0.12
        return np.stack([np.full_like(angle, 0.5 * length * u), y, z], axis=1)

    return tube(46, 24, section)


MESHES = {"sausage.obj": sausage, "dumpling.obj": dumpling}


def obj_text(name: str) -> str:
    """One mesh as Wavefront OBJ, coordinates to 0.1 um."""
    vertices, triangles = MESHES[name]()
    lines = [f"# {name}: made by make_meshes.py, millimetres"]
    # + 0.0 turns a negative zero, which a rounding may leave, into zero.
    lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in np.round(vertices, 4) + 0.0]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for mesh_name in MESHES:
        (Path(__file__).parent / mesh_name).write_text(obj_text(mesh_name), encoding="ascii")
