"""Polygons of any number of corners -> triangles that keep their orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats

Cells = NDArray[np.int64]

_TOUCHES = 1e-12
"""of twice a polygon's area: what is nearer to an edge lies on it"""


def triangles_of(points: Floats, corners: Cells, sizes: Cells) -> tuple[Cells, Cells]:
    """Triangles (T, 3), and the polygon that each is of (T,): first those of the file, then those of quads, then those
    of larger polygons; of fewer than three corners there are none.

    points (n, 3), sizes (m,) how many of the corners (k,) each polygon has
    """
    start = np.cumsum(sizes) - sizes

    def of_size(size: int) -> tuple[Cells, Cells]:
        whose = np.flatnonzero(sizes == size)
        return corners[start[whose][:, None] + np.arange(size)], whose

    three, whose_three = of_size(3)
    quads, whose_quads = of_size(4)
    found, whose = [three, _halves(points, quads)], [whose_three, whose_quads, whose_quads]
    for size in np.unique(sizes[sizes > 4]).tolist():
        polygons, numbers = of_size(size)
        fans = np.stack(
            [np.stack([polygons[:, 0], polygons[:, k], polygons[:, k + 1]], axis=1) for k in range(1, size - 1)], axis=1
        )
        x = points[polygons]
        normal = np.cross(x, np.roll(x, -1, axis=1)).sum(axis=1)  # Newell's
        y = points[fans]
        up = np.cross(y[:, :, 1] - y[:, :, 0], y[:, :, 2] - y[:, :, 0])
        do = (np.einsum("mti,mi->mt", up, normal) > 0.0).all(axis=1)
        found.append(fans[do].reshape(-1, 3))
        whose.append(np.repeat(numbers[do], size - 2))
        for polygon, number in zip(polygons[~do], numbers[~do], strict=True):
            found.append(np.array(triangulate(points, polygon.tolist()), dtype=np.int64))
            whose.append(np.full(size - 2, number))
    return np.concatenate(found), np.concatenate(whose).astype(np.int64)


def strip_triangles(flat: Cells, ends: Cells) -> Cells:
    """Triangles (T, 3) of strips, each other one turned round: strips end before the places `ends`, and at -1."""
    strips = [strip[strip >= 0] for one in np.split(flat, ends) for strip in np.split(one, np.flatnonzero(one < 0))]
    found = [np.zeros((0, 3), dtype=np.int64)]
    for strip in strips:
        if len(strip) > 2:
            triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
            triangles[1::2] = triangles[1::2][:, [1, 0, 2]]
            found.append(triangles)
    return np.concatenate(found)


def triangulate(points: Floats, polygon: list[int]) -> list[tuple[int, int, int]]:
    """Triangles of a simple polygon, about plane, that keep its orientation: ears are cut off until three corners are
    left; corners are numbers of points (n, 3)."""
    corners = list(polygon)
    found: list[tuple[int, int, int]] = []
    x = points[corners]
    normal = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)  # Newell's
    while len(corners) > 3:
        n = len(corners)
        ear = next((k % n for k in range(1, n + 1) if _is_ear(points, corners, k % n, normal)), None)
        if ear is None:  # it crosses itself
            return found + [(corners[0], corners[k], corners[k + 1]) for k in range(1, n - 1)]
        found.append((corners[ear - 1], corners[ear], corners[(ear + 1) % n]))
        del corners[ear]
    return [*found, (corners[0], corners[1], corners[2])]


def _is_ear(points: Floats, corners: list[int], k: int, normal: Floats) -> bool:
    """Whether the triangle at corner k is convex, and holds no other corner, nor has one on the side that is cut."""
    n = len(corners)
    a, b, c = (points[corners[place % n]] for place in (k - 1, k, k + 1))
    if np.cross(b - a, c - b) @ normal <= 0.0:
        return False
    others = points[[corner for place, corner in enumerate(corners) if (place - k + 1) % n > 2]]
    inside = np.cross(a - c, others - c) @ normal > -_TOUCHES * (normal @ normal)
    for start, end in ((a, b), (b, c)):
        inside &= np.cross(end - start, others - start) @ normal > 0.0
    return not inside.any()


def _halves(points: Floats, quads: Cells) -> Cells:
    """Quads cut along their first diagonal, those with a dent at its other side along the second."""
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    normal = np.cross(c - a, d - b)
    folds = (
        np.minimum((np.cross(b - a, c - b) * normal).sum(axis=1), (np.cross(d - c, a - d) * normal).sum(axis=1)) < 0.0
    )
    turned = np.where(folds[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])
