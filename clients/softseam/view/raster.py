"""A small renderer with a depth buffer: shaded triangles and lines into an array of pixels, without a display.

Made for a handful of pictures of some thousand triangles; a triangle at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LIGHT = np.array([0.34, -0.58, 0.74])
"""direction to the lamp: right, front, above"""
_AMBIENT, _DIFFUSE = 0.56, 0.50


@dataclass(frozen=True)
class Camera:
    """A perspective view from `eye` to `target`, z up; `fov` is the vertical angle of view [degrees]."""

    eye: Floats
    target: Floats
    fov: float = 26.0

    def axes(self) -> Floats:
        """Unit vectors right, up and forward (3, 3)."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        length = np.linalg.norm(right)
        right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])  # straight down or up: x to the right
        return np.stack([right, np.cross(right, forward), forward])

    def project(self, points: Floats, width: int, height: int) -> Floats:
        """Pixel x, pixel y and depth [m] of points in front of the eye (n, 3)."""
        seen = (points - self.eye) @ self.axes().T
        depth = np.maximum(seen[:, 2], 1e-9)
        scale = 0.5 * height / np.tan(np.radians(0.5 * self.fov)) / depth
        return np.stack([0.5 * width + seen[:, 0] * scale, 0.5 * height - seen[:, 1] * scale, depth], axis=1)

    def fitted(self, points: Floats, width: int, height: int, fill: float = 0.92) -> Camera:
        """The same direction, moved so that the points take `fill` of the picture."""
        camera = self
        for _ in range(6):
            at = camera.project(points, width, height)[:, :2]
            low, high = at.min(axis=0), at.max(axis=0)
            right, up, forward = camera.axes()
            depth = float(np.linalg.norm(camera.target - camera.eye))
            pixel = 2.0 * np.tan(np.radians(0.5 * camera.fov)) * depth / height
            shift = 0.5 * (low + high) - 0.5 * np.array([width, height])
            target = camera.target + pixel * (shift[0] * right - shift[1] * up)
            size = float(((high - low) / np.array([width, height])).max())
            camera = Camera(target - forward * depth * size / fill, target, camera.fov)
        return camera


class Canvas:
    """Pixels of one picture; everything is drawn at `oversample` times its size and averaged in the end."""

    def __init__(self, width: int, height: int, camera: Camera, *, layers: int = 1, oversample: int = 2) -> None:
        """layers: pictures of the same things in different colours, drawn at once on white."""
        self._factor, self._camera, self._layers = oversample, camera, layers
        self.width, self.height = width * oversample, height * oversample
        self._color = np.ones((self.height, self.width, 3 * layers))
        self._depth = np.full((self.height, self.width), np.inf)

    def image(self, layer: int = 0) -> NDArray[np.uint8]:
        """A finished picture (height, width, 3)."""
        k = self._factor
        mine = self._color[:, :, 3 * layer : 3 * layer + 3]
        small = sum(mine[i::k, j::k] for i in range(k) for j in range(k)) / k**2
        return np.asarray(np.rint(np.clip(small, 0.0, 1.0) * 255.0), dtype=np.uint8)

    def floor(
        self, point: Floats, normal: Floats, centre: Floats, radius: float, spacing: float, color: Floats
    ) -> None:
        """An endless plane with a grid, fading into the background with the distance from `centre`. Draw it first."""
        right, up, forward = self._camera.axes()
        half = np.tan(np.radians(0.5 * self._camera.fov))
        across = ((np.arange(self.width) - 0.5 * self.width) / (0.5 * self.height) * half)[None, :]
        down = ((0.5 * self.height - np.arange(self.height)) / (0.5 * self.height) * half)[:, None]

        def rays(vector: Floats) -> Floats:
            """Rays forward + across right + down up times a vector (height, width)."""
            return np.asarray(forward @ vector + across * (right @ vector) + down * (up @ vector))

        slope = rays(normal)
        height = float((point - self._camera.eye) @ normal)
        reach = np.divide(height, slope, out=np.full(slope.shape, -1.0), where=np.abs(slope) > 1e-9)
        # the ray meets the plane at eye + reach ray: (eye - centre)^2 + 2 reach ray (eye - centre) + reach^2 ray^2
        seen = self._camera.eye - centre
        squared = seen @ seen + reach * (2.0 * rays(seen) + reach * (1.0 + across**2 + down**2))
        strength = np.clip(1.3 - np.sqrt(np.maximum(squared, 0.0)) / radius, 0.0, 1.0)
        strength[reach <= 0.0] = 0.0
        u = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
        u /= np.linalg.norm(u)
        shown = strength > 0.0
        strength, near = strength[shown], reach[shown]
        pixel = 2.0 * half * near / self.height
        line = np.zeros_like(strength)
        for axis in (u, np.cross(normal, u)):
            along = float((self._camera.eye - point) @ axis) + near * rays(axis)[shown]
            away = np.abs(along - spacing * np.rint(along / spacing))
            line = np.maximum(line, np.clip(1.4 - away / (self._factor * pixel), 0.0, 1.0))
        shade = np.tile(color, self._layers) * (1.0 - 0.07 * line[:, None])
        self._color[shown] += strength[:, None] * (shade - self._color[shown])
        self._depth = np.where(reach > 0.0, reach, np.inf)

    def mesh(
        self, vertices: Floats, normals: Floats, triangles: NDArray[np.int64], paint: Floats, alpha: float = 1.0
    ) -> None:
        """Shaded triangles, from their front side if they are opaque; draw translucent ones last.

        paint (T, 3, 3 layers)  colours of each triangle's corners, in 0..1
        """
        at = self._camera.project(vertices, self.width, self.height)
        shade = _AMBIENT + _DIFFUSE * np.clip(normals @ _LIGHT, 0.0, 1.0)
        a, b, c = (at[triangles[:, i], :2] for i in range(3))
        turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        # rows count downwards, so a triangle that is counter-clockwise from the front turns to the negative side
        order = np.flatnonzero(turn < 0.0) if alpha == 1.0 else np.argsort(-at[triangles, 2].mean(axis=1))
        for t in order:
            corners = triangles[t]
            found = self._cover(at[corners])
            if found is None:
                continue
            rows, columns, bary, depth = found
            color = (bary @ paint[t]) * (bary @ shade[corners])[:, None]
            if alpha < 1.0:
                self._color[rows, columns] += alpha * (color - self._color[rows, columns])
            else:
                self._color[rows, columns] = color
                self._depth[rows, columns] = depth

    def lines(
        self,
        segments: Floats,
        color: Floats,
        *,
        width: float = 1.0,
        alpha: float = 1.0,
        lift: float = 2e-3,
        layer: int | None = None,
    ) -> None:
        """Straight lines (l, 2, 3), `width` pixels wide; `lift` brings them that part nearer, out of their surface."""
        ends = self._camera.project(segments.reshape(-1, 3), self.width, self.height).reshape(-1, 2, 3)
        covered = np.zeros((self.height, self.width), dtype=np.bool_)
        reach = max(0, round(0.5 * (width * self._factor - 1)))
        for start, stop in ends:
            n = int(np.hypot(*(stop - start)[:2])) + 2
            along = start + np.linspace(0.0, 1.0, n)[:, None] * (stop - start)
            for dx in range(-reach, reach + 1):
                for dy in range(-reach, reach + 1):
                    x, y = np.rint(along[:, 0]).astype(np.int64) + dx, np.rint(along[:, 1]).astype(np.int64) + dy
                    inside = (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
                    x, y, z = x[inside], y[inside], along[inside, 2] * (1.0 - lift)
                    seen = z <= self._depth[y, x]
                    covered[y[seen], x[seen]] = True
        for each in range(self._layers) if layer is None else (layer,):
            mine = self._color[:, :, 3 * each : 3 * each + 3]
            mine[covered] += alpha * (color - mine[covered])

    def shadow(self, vertices: Floats, triangles: NDArray[np.int64], strength: float, blur: int) -> None:
        """Darken what a flat mesh covers, softly; the mesh lies on a surface that is drawn already."""
        at = self._camera.project(vertices, self.width, self.height)
        mask = np.zeros((self.height, self.width))
        for corners in triangles:
            found = self._cover(at[corners], tested=False)
            if found is not None:
                mask[found[0], found[1]] = 1.0
        for _ in range(3):
            mask = _box_blur(_box_blur(mask, blur * self._factor).T, blur * self._factor).T
        drawn = np.isfinite(self._depth)[..., None]
        self._color *= 1.0 - strength * mask[..., None] * drawn

    def _cover(
        self, corners: Floats, *, tested: bool = True
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, Floats] | None:
        """Rows, columns, barycentric weights and depths of the pixels where a projected triangle is seen."""
        low = np.maximum(np.floor(corners[:, :2].min(axis=0)).astype(np.int64), 0)
        high = np.minimum(np.ceil(corners[:, :2].max(axis=0)).astype(np.int64), (self.width - 1, self.height - 1))
        (ax, ay, _), (bx, by, _), (cx, cy, _) = corners
        twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if (low > high).any() or abs(twice) < 1e-12:
            return None
        x = np.arange(low[0], high[0] + 1)[None, :]
        y = np.arange(low[1], high[1] + 1)[:, None]
        b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / twice
        c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / twice
        a = 1.0 - b - c
        depth = 1.0 / (a / corners[0, 2] + b / corners[1, 2] + c / corners[2, 2])
        hit = (a >= -1e-9) & (b >= -1e-9) & (c >= -1e-9)
        if tested:
            hit &= depth < self._depth[low[1] : high[1] + 1, low[0] : high[0] + 1]
        rows, columns = np.nonzero(hit)
        if not len(rows):
            return None
        bary = np.stack([a[hit], b[hit], c[hit]], axis=1)
        return rows + low[1], columns + low[0], bary, depth[hit]


def _box_blur(values: Floats, reach: int) -> Floats:
    """Mean over 2 reach + 1 rows."""
    padded = np.pad(values, ((reach + 1, reach), (0, 0)), mode="edge")
    total = padded.cumsum(axis=0)
    return np.asarray((total[2 * reach + 1 :] - total[: -2 * reach - 1]) / (2 * reach + 1))
