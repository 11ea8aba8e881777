"""Polygons of any number of corners -> triangles that keep their orientation."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats

Cells = NDArray[np.int64]

MOST_CORNERS = 20_000
"""of a polygon with dents, whose triangles take time by the square of its corners: a second for so many"""


class LargePolygon(Exception):
    """A polygon that would take too long to split; the text says how large it is."""


def triangles_of(points: Floats, corners: Cells, sizes: Cells) -> tuple[Cells, Cells]:
    """Triangles (T, 3), and the polygon that each is of (T,): first those of the file, then those of quads, then those
    of larger polygons; of fewer than three corners there are none.

    points (n, 3), sizes (m,) how many of the corners (k,) each polygon has. Raises LargePolygon.
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
        cut = polygons[:, _ears(size)]
        x = points[polygons]
        normal = np.cross(x, np.roll(x, -1, axis=1)).sum(axis=1)  # Newell's
        y = points[cut]
        up = np.cross(y[:, :, 1] - y[:, :, 0], y[:, :, 2] - y[:, :, 0])
        do = (np.einsum("mti,mi->mt", up, normal) > 0.0).all(axis=1)
        found.append(cut[do].reshape(-1, 3))
        whose.append(np.repeat(numbers[do], size - 2))
        for polygon, number in zip(polygons[~do], numbers[~do], strict=True):
            found.append(triangulate(points, polygon))
            whose.append(np.full(size - 2, number))
    return np.concatenate(found), np.concatenate(whose).astype(np.int64)


def _ears(size: int) -> Cells:
    """Corners (size - 2, 3) of the triangles of a convex polygon: every other corner is cut off, and so on. Few of them
    are near one another, where those of a fan all are."""
    ring, found = np.arange(size), [np.zeros((0, 3), dtype=np.int64)]
    while len(ring) > 2:
        closed = np.append(ring, ring[0])
        n_ears = len(ring) // 2
        found.append(np.stack([closed[k : k + 2 * n_ears : 2] for k in range(3)], axis=1))
        ring = ring[::2]
    return np.concatenate(found)


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


def triangulate(points: Floats, polygon: Sequence[int]) -> Cells:
    """Triangles (n - 2, 3) of a simple polygon, about plane, that keep its orientation; corners are numbers of points
    (n, 3). Raises LargePolygon.

    One that crosses itself, or has corners that are no places, is a fan.
    """
    if len(polygon) > MOST_CORNERS:
        raise LargePolygon(
            f"a face with dents has {len(polygon):,} corners, more than {MOST_CORNERS:,}: export triangles"
        )
    import manifold3d

    corners = np.asarray(polygon, dtype=np.int64)
    x = points[corners] - points[corners[0]]
    normal = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)  # Newell's
    length = np.linalg.norm(normal)
    if not (np.isfinite(length) and length > 0.0):
        return np.stack([np.broadcast_to(corners[0], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)
    normal /= length
    across = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    across /= np.linalg.norm(across)
    flat = x @ np.stack([across, np.cross(normal, across)], axis=1)
    return np.asarray(corners[manifold3d.triangulate([flat])])


def _halves(points: Floats, quads: Cells) -> Cells:
    """Quads cut along their first diagonal, those with a dent at its other side along the second."""
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    normal = np.cross(c - a, d - b)
    folds = (
        np.minimum((np.cross(b - a, c - b) * normal).sum(axis=1), (np.cross(d - c, a - d) * normal).sum(axis=1)) < 0.0
    )
    turned = np.where(folds[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])
