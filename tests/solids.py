"""Closed surfaces with known volumes and moments, and their OBJ files, for tests of the importer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Triangles = NDArray[np.int64]

ALONG_THE_SCENE = ({"min": (1.0, 1.0, 1.0), "max": (2.0, 2.0, 2.0)},)
"""`body.fixed` that holds no node, but has cells lie along the scene's axes however the solid is turned"""

BOX_TRIANGLES = np.array(
    [
        *([0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6]),
        *([0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7]),
        *([0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]),
    ]
)


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[Floats, Triangles]:
    """A box of 12 triangles with its least corner at `at`."""
    corners = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)], dtype=np.float64)
    return corners * size + at, BOX_TRIANGLES


def sphere(radius: float, refinements: int) -> tuple[Floats, Triangles]:
    """An octahedron refined onto the sphere; the error of its volume falls by 4 a refinement."""
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)
    triangles = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(refinements):
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, number = np.unique(sides, axis=0, return_inverse=True)
        middle = vertices[edges].sum(axis=1)
        a, b, c = triangles.T
        ab, bc, ca = len(vertices) + number.reshape(-1, 3).T
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return radius * vertices, triangles


def cylinder(radius: float, height: float, sides: int, axis: Floats) -> tuple[Floats, Triangles]:
    """A prism of `sides` sides, its centre at the origin, turned so that its axis is `axis`."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(sides)], axis=1)
    up = np.array([0, 0, 0.5 * height])
    vertices = np.concatenate([ring - up, ring + up, [-up], [up]])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    triangles = [(i, j, sides + j), (i, sides + j, sides + i), (bottom, j, i), (top, sides + i, sides + j)]
    w = axis / np.linalg.norm(axis)
    u = np.cross([0.3, 1.0, 0.2], w)
    u /= np.linalg.norm(u)
    frame = np.stack([u, np.cross(w, u), w])
    return vertices @ frame, np.concatenate([np.stack(t, axis=1) for t in triangles])


def join(*solids: tuple[Floats, Triangles]) -> tuple[Floats, Triangles]:
    """Several surfaces in one."""
    offsets = np.cumsum([0, *(len(v) for v, _ in solids)])
    return (
        np.concatenate([v for v, _ in solids]),
        np.concatenate([t + o for (_, t), o in zip(solids, offsets, strict=False)]),
    )


def obj(vertices: Floats, triangles: Triangles) -> bytes:
    """Wavefront OBJ."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(triangles) + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()
