"""A small renderer with a depth buffer: shaded triangles and lines into an array of pixels, without a display.

All pixels of some triangles at a time, in numpy: a picture of a thousand triangles takes a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_AT_ONCE = 1 << 18
"""pixels that are looked at in one go"""
_LIGHT = np.array([0.34, -0.58, 0.74])
"""direction to the lamp: right, front, above"""
_AMBIENT, _DIFFUSE = 0.56, 0.50
_NEAREST = 1e-2
"""what is drawn is no nearer to the eye, in distances from eye to target"""


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

    def beyond(self, points: Floats) -> Floats:
        """How far points (..., 3) lie behind the nearest plane that is drawn [m], negative where they are not drawn."""
        away = self.target - self.eye
        length = float(np.linalg.norm(away))
        return np.asarray((points - self.eye) @ (away / length) - _NEAREST * length)

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


class Hits(NamedTuple):
    """Pixels of triangles (n,)."""

    pixel: Ints
    """row times the width, and column"""
    triangle: Ints
    weights: Floats
    """barycentric (n, 3)"""
    depth: Floats
    """[m]"""


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
        """Shaded triangles, from their front side if they are opaque; draw translucent ones last, far sides under near.

        paint (T, 3, 3 layers)  colours of each triangle's corners, in 0..1
        """
        shade = _AMBIENT + _DIFFUSE * np.clip(normals @ _LIGHT, 0.0, 1.0)
        beyond = self._camera.beyond(vertices)
        if beyond.min() < 0.0:
            vertices, shade, triangles, paint = _cut(beyond, vertices, shade, triangles, paint)
        at = self._camera.project(vertices, self.width, self.height)
        a, b, c = (at[triangles[:, i], :2] for i in range(3))
        turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        # rows count downwards, so a triangle that is counter-clockwise from the front turns to the negative side
        sides = [turn < 0.0] if alpha == 1.0 else [turn > 0.0, turn < 0.0]
        color, depth = self._color.reshape(-1, self._color.shape[2]), self._depth.reshape(-1)
        for which in (np.flatnonzero(side) for side in sides):
            for hit in self._hits(at[triangles[which]]):
                seen = hit.depth < depth[hit.pixel]
                if alpha == 1.0:
                    np.minimum.at(depth, hit.pixel[seen], hit.depth[seen])
                    seen &= hit.depth == depth[hit.pixel]
                pixel, weights, found = hit.pixel[seen], hit.weights[seen], which[hit.triangle[seen]]
                light = np.einsum("ni,ni->n", weights, shade[triangles[found]])
                mine = np.einsum("ni,nic->nc", weights, paint[found]) * light[:, None]
                color[pixel] += alpha * (mine - color[pixel])

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
        beyond = self._camera.beyond(segments)
        segments, beyond = segments[beyond.max(axis=1) > 0.0], beyond[beyond.max(axis=1) > 0.0]
        inner = np.clip(beyond / (beyond - beyond[:, ::-1] + (beyond == beyond[:, ::-1])), 0.0, 1.0)
        segments = segments + np.where(beyond < 0.0, inner, 0.0)[..., None] * (segments[:, ::-1] - segments)
        ends = self._camera.project(segments.reshape(-1, 3), self.width, self.height).reshape(-1, 2, 3)
        covered = np.zeros((self.height, self.width), dtype=np.bool_)
        reach = max(0, round(0.5 * (width * self._factor - 1)))
        for start, stop in _within(ends, self.width, self.height):
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
        for hit in self._hits(at[triangles]):
            mask.reshape(-1)[hit.pixel] = 1.0
        for _ in range(3):
            mask = _box_blur(_box_blur(mask, blur * self._factor).T, blur * self._factor).T
        drawn = np.isfinite(self._depth)[..., None]
        self._color *= 1.0 - strength * mask[..., None] * drawn

    def _hits(self, corners: Floats) -> Iterator[Hits]:
        """The pixels of projected triangles (T, 3, 3), row by row, some triangles at a time."""
        (ax, ay), (bx, by), (cx, cy) = (corners[:, i, :2].T for i in range(3))
        twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        low = np.maximum(np.ceil(corners[:, :, 1].min(axis=1)), 0.0).astype(np.int64)
        high = np.minimum(np.floor(corners[:, :, 1].max(axis=1)), self.height - 1).astype(np.int64)
        n_rows = np.where(np.abs(twice) < 1e-12, 0, np.maximum(high - low + 1, 0))
        t = np.repeat(np.arange(len(corners)), n_rows)
        y = low[t] + _counted(n_rows)
        # weights of b and c are at + slope x in a row, and that of a is the rest; x runs while none is negative
        down, inverse = y - ay[t], 1.0 / twice[t]
        slope = np.stack([(cy - ay)[t] * inverse, -(by - ay)[t] * inverse], axis=1)
        at = np.stack([-(cx - ax)[t] * down, (bx - ax)[t] * down], axis=1) * inverse[:, None] - slope * ax[t, None]
        slopes = np.concatenate([-slope.sum(axis=1, keepdims=True), slope], axis=1)
        ats = np.concatenate([1.0 - at.sum(axis=1, keepdims=True), at], axis=1) + 1e-9
        border = -ats / np.where(slopes == 0.0, 1.0, slopes)
        first = np.where(slopes > 0.0, border, np.where((slopes == 0.0) & (ats < 0.0), np.inf, 0.0)).max(axis=1)
        last = np.where(slopes < 0.0, border, self.width - 1.0).min(axis=1)
        start = np.ceil(np.clip(first, 0.0, self.width)).astype(np.int64)
        count = np.maximum(np.floor(np.clip(last, -1.0, self.width - 1.0)).astype(np.int64) - start + 1, 0)
        rows = np.flatnonzero(count)
        for some in np.split(rows, np.flatnonzero(np.diff(np.cumsum(count[rows]) // _AT_ONCE)) + 1):
            row = np.repeat(some, count[some])
            x = start[row] + _counted(count[some])
            weights = np.empty((len(x), 3))
            weights[:, 1:] = at[row] + slope[row] * x[:, None]
            weights[:, 0] = 1.0 - weights[:, 1] - weights[:, 2]
            depth = 1.0 / np.einsum("ni,ni->n", weights, (1.0 / corners[:, :, 2])[t[row]])
            yield Hits(y[row] * self.width + x, t[row], weights, depth)


def _within(lines: Floats, width: int, height: int) -> Floats:
    """What of lines (l, 2, 3) lies in the picture, about (Liang and Barsky)."""
    start, way = lines[:, :1], lines[:, 1:] - lines[:, :1]
    flat = np.where(np.abs(way[..., :2]) < 1e-9, 1e-9, way[..., :2])
    borders = (np.array([[[-9.0, -9.0], [width + 9.0, height + 9.0]]]) - start[..., :2]) / flat
    first = np.maximum(borders.min(axis=1).max(axis=1), 0.0)
    last = np.minimum(borders.max(axis=1).min(axis=1), 1.0)
    parts = np.stack([first, last], axis=1)[first < last]
    found: Floats = start[first < last] + parts[..., None] * way[first < last]
    return found


def _cut(
    beyond: Floats, vertices: Floats, shade: Floats, triangles: NDArray[np.int64], paint: Floats
) -> tuple[Floats, Floats, NDArray[np.int64], Floats]:
    """Vertices, their shade (n,), triangles and paint of what lies beyond a plane, by how far it does (n,)."""
    front = beyond[triangles] > 0.0
    whole, some = front.all(axis=1), front.any(axis=1) & ~front.all(axis=1)
    lone_front = front[some].sum(axis=1) == 1
    lone = np.argmax(front[some] == lone_front[:, None], axis=1)  # the corner that is alone on its side, now first
    order = (lone[:, None] + np.arange(3)) % 3
    mine = np.take_along_axis(triangles[some], order, axis=1)
    painted = np.take_along_axis(paint[some], order[..., None], axis=1)
    v = np.concatenate([vertices[mine], shade[mine][..., None], painted], axis=2)
    ahead = beyond[mine][..., None]
    b, c = (v[:, 0] + ahead[:, 0] / (ahead[:, 0] - ahead[:, k]) * (v[:, k] - v[:, 0]) for k in (1, 2))
    parts = [(v[:, 0], b, c, lone_front), (b, v[:, 1], v[:, 2], ~lone_front), (b, v[:, 2], c, ~lone_front)]
    pieces = np.concatenate([np.stack(corners, axis=1)[which] for *corners, which in parts])
    new = len(vertices) + np.arange(3 * len(pieces)).reshape(-1, 3)
    return (
        np.concatenate([vertices, pieces[..., :3].reshape(-1, 3)]),
        np.concatenate([shade, pieces[..., 3].ravel()]),
        np.concatenate([triangles[whole], new]),
        np.concatenate([paint[whole], pieces[..., 4:]]),
    )


def _counted(n: Ints) -> Ints:
    """0 .. n_0 - 1, 0 .. n_1 - 1, ... in one row."""
    return np.arange(int(n.sum())) - np.repeat(np.cumsum(n) - n, n)


def _box_blur(values: Floats, reach: int) -> Floats:
    """Mean over 2 reach + 1 rows."""
    padded = np.pad(values, ((reach + 1, reach), (0, 0)), mode="edge")
    total = padded.cumsum(axis=0)
    return np.asarray((total[2 * reach + 1 :] - total[: -2 * reach - 1]) / (2 * reach + 1))
