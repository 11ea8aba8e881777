"""Closed surfaces as OBJ files: five from tests/meshes, two that come with softseam, and lumps that code makes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
FILES = {
    **{name: ROOT / "tests" / "meshes" / f"{name}.obj" for name in ("bent", "ring", "star", "knee", "cup")},
    **{name: ROOT / "scenes" / f"{name}.obj" for name in ("sausage", "dumpling")},
}
LUMPS: dict[str, Callable[[Floats, Floats], Floats]] = {
    "egg": lambda polar, around: _box(polar, around, (24.0, 18.0, 16.0), 2.0) * (1.0 + 0.12 * np.cos(polar)),
    "pillow": lambda polar, around: _box(polar, around, (30.0, 24.0, 12.0), 4.0),
    "pear": lambda polar, around: 20.0 * (1.0 - 0.25 * np.cos(polar) + 0.1 * np.cos(2.0 * polar)),
    "clover": lambda polar, around: (
        _box(polar, around, (22.0, 22.0, 12.0), 2.5) * (1.0 + 0.2 * np.sin(polar) ** 2 * np.cos(3.0 * around))
    ),
    "log": lambda polar, around: _box(polar, around, (45.0, 14.0, 14.0), 4.0),
    "bun": lambda polar, around: _box(polar, around, (26.0, 26.0, 17.0), 3.0) * (1.0 + 0.05 * np.cos(2.0 * around)),
}
"""distance of the surface from the middle [mm] by the angle from z and that around it"""


def obj(name: str) -> bytes:
    """The file of a shape, in millimetres; a name that no row has is of a lump drawn for it."""
    if name in FILES:
        return FILES[name].read_bytes()
    return _lump(LUMPS[name] if name in LUMPS else _drawn(Random(name)))


def extent(name: str) -> tuple[Floats, Floats]:
    """Least and largest x, y, z (3,) of a shape as a scene puts it, with the base's centre at the origin [m]."""
    lines = (line.split() for line in obj(name).decode().splitlines())
    points = 1e-3 * np.array([line[1:4] for line in lines if line[:1] == ["v"]], dtype=np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    base = np.array([*0.5 * (low + high)[:2], low[2]])
    return low - base, high - base


def _box(polar: Floats, around: Floats, half: tuple[float, float, float], power: float) -> Floats:
    """The superellipsoid with these half axes [mm]: a ball for power 2, nearly a box for more."""
    way = (np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar))
    return np.asarray(sum(np.abs(part / edge) ** power for part, edge in zip(way, half, strict=True)) ** (-1.0 / power))


def _drawn(draw: Random) -> Callable[[Floats, Floats], Floats]:
    """Between ball and box, with a blunter end, and with two to four edges or hollows around it."""
    half = (draw.uniform(13.0, 30.0), draw.uniform(13.0, 30.0), draw.uniform(13.0, 30.0))
    power, blunt, deep, lobes = (
        draw.uniform(2.0, 5.0),
        draw.uniform(-0.15, 0.15),
        draw.uniform(-0.12, 0.12),
        draw.choice((2, 3, 4)),
    )
    return lambda polar, around: (
        _box(polar, around, half, power)
        * (1.0 + blunt * np.cos(polar))
        * (1.0 + deep * np.sin(polar) ** 2 * np.cos(lobes * around))
    )


def _lump(radius: Callable[[Floats, Floats], Floats], rings: int = 20, sides: int = 32) -> bytes:
    """A surface around the middle, triangles between rings of points and two poles."""
    polar, around = np.meshgrid(
        np.pi * np.arange(1, rings) / rings, 2.0 * np.pi * np.arange(sides) / sides, indexing="ij"
    )
    polar, around = (
        np.concatenate([[end], each.ravel(), [end_]]) for end, each, end_ in ((0.0, polar, np.pi), (0.0, around, 0.0))
    )
    away = radius(polar, around)
    points = np.stack(
        [away * np.sin(polar) * np.cos(around), away * np.sin(polar) * np.sin(around), away * np.cos(polar)], axis=1
    )
    number = 1 + np.arange((rings - 1) * sides).reshape(rings - 1, sides)
    following = np.roll(number, -1, axis=1)
    last = len(points) - 1
    triangles = [
        np.stack([np.zeros(sides, dtype=int), number[0], following[0]], axis=1),
        np.stack([number[:-1].ravel(), number[1:].ravel(), following[1:].ravel()], axis=1),
        np.stack([number[:-1].ravel(), following[1:].ravel(), following[:-1].ravel()], axis=1),
        np.stack([np.full(sides, last), following[-1], number[-1]], axis=1),
    ]
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in np.concatenate(triangles).tolist()]
    return "\n".join(lines).encode()
