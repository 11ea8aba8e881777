"""How far a tool may go along a line until it touches a surface, and where it does.

The tool goes on by its distance to the surface, which it can without touching (conservative advancement: Mirtich, PhD
thesis, Berkeley 1996, section 2.3). The distance is the least over the triangles, by branch and bound: where a tool is
convex its signed distance g is, too, and on a triangle with corners c_i
  g(x) >= g(p) + grad g(p) . (x - p) >= min_i [g(p) + grad g(p) . (c_i - p)]                                     (1)
for any p, here its corners and its centroid. Triangles whose bound is above the least value found are left, the others
are divided. So it is the same whatever triangles a surface is made of. Where faces meet, that place
counts which is nearest to the line of the tool's position.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_services.shapes.branches import BOX, CAPSULE, CYLINDER, PLANE, SPHERE
from softseam_services.shapes.distance import shape_gaps
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

_CONVEX = (PLANE, SPHERE, BOX, CAPSULE, CYLINDER)
_TOUCH = 1e-6
"""of the surface's size: as near as touching [1]"""
_CLOSE = 1e-5
"""of the surface's size: bounds so near below the least value are not looked into [1]"""
_LINE, _RESOLVED = 1e-3, 1e-10
"""of the square of the way from the line over the size, which is added to gaps where places are looked for, and of the
size, how near below the least sum bounds are looked into then [1]"""
_DIFFERENCE = 1e-7
"""of the surface's size, for gradients [1]"""
_SMALL = 1.0 / 24.0
"""of a tool that may be concave: eq. (1) is believed of triangles so much smaller [1]"""
_MOST_TRIANGLES, _MOST_STEPS = 60_000, 200


def way_to_touch(
    tools: ToolSet, tool: int, position: Floats, orientation: Floats, way: Floats, corners: Floats
) -> tuple[float, Floats] | None:
    """How far a tool may go along a unit vector until it touches triangles [m], negative for back where it is in them,
    and the point (3,) where it does; None where it passes them.

    position, orientation  of the tool (3,) [m], (4,)
    corners                of the triangles (m, 3, 3) [m]; points that are no triangles have three corners alike
    """
    along = corners @ way
    size = max(float(np.ptp(corners.reshape(-1, 3), axis=0).max()), 1e-9)
    reach = float(tools.reach[tool])
    far = float(along.max() - position @ way) + (reach if np.isfinite(reach) else 2.0 * size)
    surface = _Surface(tools, tool, orientation, corners, size)
    gone, back, clear = 0.0, 0.0, np.nan
    for _ in range(_MOST_STEPS):
        gap = surface.nearest(position + gone * way)[0]
        if gap < -_TOUCH * size and np.isnan(clear):  # it begins in them: back, until it is out
            back = 2.0 * back + max(-gap, _TOUCH * size)
            gone -= back
        elif gap < -_TOUCH * size:  # a distance on a grid was too long
            if gone - clear <= _TOUCH * size:
                break
            gone = 0.5 * (clear + gone)
        elif gap <= _TOUCH * size:
            break
        else:
            clear, gone = gone, gone + gap
        if gone > far:
            return None
    return gone, surface.nearest(position + gone * way, way)[1]


class _Surface:
    """Triangles before one tool, with what is known of how near they are."""

    def __init__(self, tools: ToolSet, tool: int, orientation: Floats, corners: Floats, size: float) -> None:
        self._kind, self._shape, self._orientation = int(tools.kind[tool]), tools.shape[tool], orientation
        self._corners, self._size = corners, size
        self._radius = _radii(corners)
        self._least = np.full(len(corners), -np.inf)  # below which their gaps cannot be, where the tool is now
        self._at: Floats | None = None
        self._way: Floats | None = None
        self._close = _CLOSE * size
        self._small = np.inf if self._kind in _CONVEX else _SMALL * float(tools.reach[tool])

    def nearest(self, position: Floats, way: Floats | None = None) -> tuple[float, Floats]:
        """Least gap of the triangles to the tool there [m], and where it is (3,); with a way, of several places that
        which is nearest to the line along it through the position."""
        self._way, self._close = way, (_CLOSE if way is None else _RESOLVED) * self._size
        if self._at is not None:
            self._least -= float(np.linalg.norm(position - self._at))
        self._at = position
        first = np.argsort(self._least)
        best, point = np.inf, self._corners[0, 0]
        # those that were nearest before tell how near the others may be to be left
        for some in np.split(first, [min(64, len(first))]):
            some = some[self._least[some] < best]
            if len(some):
                middle = self._gaps(self._corners[some].mean(axis=1), position)
                self._least[some] = middle - self._radius[some]
                best, point = self._divided(self._corners[some], position, best, point)
        return best, point

    def _divided(self, corners: Floats, position: Floats, best: float, point: Floats) -> tuple[float, Floats]:
        """The least gap and its place, of these triangles and of what is known."""
        while len(corners):
            probes = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
            flat = probes.reshape(-1, 3)
            gaps = self._gaps(flat, position)
            least = int(np.argmin(gaps))
            if gaps[least] < best:
                best, point = float(gaps[least]), flat[least]
            slopes = self._gradients(flat, position).reshape(-1, 4, 1, 3)
            gaps = gaps.reshape(-1, 4)
            tangents = gaps[:, :, None] + ((corners[:, None] - probes[:, :, None]) * slopes).sum(axis=3)  # eq. (1)
            bound = tangents.min(axis=2).max(axis=1)
            radius = _radii(corners)
            bound = np.where(radius > self._small, gaps[:, 3] - radius, bound)
            kept = corners[bound < best - self._close]
            if 4 * len(kept) > _MOST_TRIANGLES:
                break
            corners = _quartered(kept)
        return best, point

    def _gaps(self, points: Floats, position: Floats) -> Floats:
        gap = np.empty(len(points))
        shape_gaps(np.ascontiguousarray(points), self._kind, self._shape, position, self._orientation, gap)
        if self._way is None:
            return gap
        aside = points - position
        square = (aside**2).sum(axis=1) - (aside @ self._way) ** 2
        return np.asarray(gap + _LINE * square / self._size)

    def _gradients(self, points: Floats, position: Floats) -> Floats:
        """By central differences (n, 3)."""
        step = _DIFFERENCE * self._size
        moved = points[:, None, None] + step * np.stack([np.eye(3), -np.eye(3)], axis=1)
        gaps = self._gaps(moved.reshape(-1, 3), position).reshape(-1, 3, 2)
        return np.asarray((gaps[..., 0] - gaps[..., 1]) / (2.0 * step))


def _radii(corners: Floats) -> Floats:
    """Of balls about the centroids that hold the triangles (m,) [m]."""
    return np.asarray(np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1))


def _quartered(corners: Floats) -> Floats:
    """Each triangle in four alike (4m, 3, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])
