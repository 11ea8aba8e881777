"""The closed surface that viewers draw: two layers around a sheet, a tube around a rope, a solid's own boundary."""

from dataclasses import dataclass, field

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.kernels.tube import tube_points

RING = 6
"""points around a rope"""


@dataclass(frozen=True)
class Skin:
    """P points that follow N particles, T triangles between them."""

    owner: Ints
    """particle that each point follows (P,)"""
    share: Floats
    """of what acts on its particle (P,)"""
    triangles: Ints
    """counter-clockwise from outside (T, 3)"""
    counts: tuple[int, int]
    """particles along the two sides of a sheet, (particles, 1) of a rope, (0, 0) where the points are particles"""
    radius: float
    """distance of the points from their particles [m]"""
    offset: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """of the points from their particles, whatever happens (P, 3) [m]; none where the two above say where they are"""

    def points(self, x: Floats) -> Floats:
        """Points around particles x (N, 3) [m]; of a sheet the upper layer first (P, 3)."""
        if len(self.offset):
            return np.asarray(x[self.owner] + self.offset)
        if self.counts[0] == 0:
            return np.asarray(x[self.owner])
        if self.counts[1] > 1:
            normal = _normals(x.reshape(self.counts[1], self.counts[0], 3)).reshape(-1, 3)
            return np.concatenate([x + self.radius * normal, x - self.radius * normal])
        found = np.empty((RING * len(x), 3))
        tube_points(np.ascontiguousarray(x), self.radius, RING, found)
        return found


def sheet_skin(nx: int, ny: int, radius: float) -> Skin:
    """Skin of a lattice of nx x ny spacings, particle i + (nx + 1) j."""
    n = (nx + 1) * (ny + 1)
    number = np.arange(n).reshape(ny + 1, nx + 1)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, d = number[1:, 1:].ravel(), number[1:, :-1].ravel()
    upper = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    then = np.roll(rim, -1)
    sides = [np.stack([rim + n, then + n, then], axis=1), np.stack([rim + n, then, rim], axis=1)]
    triangles = np.concatenate([upper, upper[:, ::-1] + n, *sides])
    owner = np.tile(np.arange(n), 2)
    return Skin(owner.astype(np.int32), np.full(2 * n, 0.5), triangles.astype(np.int32), (nx + 1, ny + 1), radius)


def rope_skin(n: int, radius: float) -> Skin:
    """Skin of n particles in a row: rings of `RING` points, closed at both ends."""
    ring = np.arange(n * RING).reshape(n, RING)
    then = np.roll(ring, -1, axis=1)
    a, b, c, d = ring[:-1].ravel(), then[:-1].ravel(), then[1:].ravel(), ring[1:].ravel()
    fan = np.stack([np.zeros(RING - 2, dtype=np.int64), np.arange(1, RING - 1), np.arange(2, RING)], axis=1)
    triangles = [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), ring[0][fan[:, ::-1]], ring[-1][fan]]
    owner = np.repeat(np.arange(n), RING)
    share = np.full(n * RING, 1.0 / RING)
    return Skin(owner.astype(np.int32), share, np.concatenate(triangles).astype(np.int32), (n, 1), radius)


def solid_skin(triangles: Ints) -> Skin:
    """Skin of a solid whose boundary (T, 3) is between particles."""
    owner, corners = np.unique(triangles, return_inverse=True)
    found = corners.reshape(-1, 3).astype(np.int32)
    return Skin(owner.astype(np.int32), np.ones(len(owner)), found, (0, 0), 0.0)


def _normals(x: Floats) -> Floats:
    """Unit normals of a lattice of points (ny, nx, 3), from differences of neighbours; zero where they are in line."""
    along = np.empty_like(x)
    along[:, 1:-1] = x[:, 2:] - x[:, :-2]
    along[:, 0], along[:, -1] = x[:, 1] - x[:, 0], x[:, -1] - x[:, -2]
    across = np.empty_like(x)
    across[1:-1] = x[2:] - x[:-2]
    across[0], across[-1] = x[1] - x[0], x[-1] - x[-2]
    normal = np.cross(along, across)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300))
