"""A scene before it is simulated: bodies and tools from four sides, ways of tools, and the faces that will touch."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from softseam.view import colors
from softseam.view.paper import INK, PAPER, SOFT, heading, write
from softseam.view.raster import Camera, Canvas
from softseam.view.surface import DisplaySurface
from softseam.view.tool_shapes import ToolShape, grid_spacing, rotate, tool_shapes
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WIDTH, _HEIGHT = 620, 460
_VIEWS = {
    "": ((0.50, -0.87, 0.42), 26.0),
    "from the front, x to the right": ((0.0, -1.0, 0.0), 0.5),
    "from the right, y to the right": ((1.0, 0.0, 0.0), 0.5),
    "from above, x to the right": ((0.0, -1e-9, 1.0), 0.5),
}
"""towards the eye, and the angle of view [degrees]; narrow ones are as good as parallel, so that a scale holds"""
_GROUND = np.array([0.905, 0.90, 0.885])
_GLASS = np.array([0.62, 0.66, 0.72])
_TOOL_LINE = np.array([0.36, 0.39, 0.45])
_CELL_LINE = np.array([0.12, 0.13, 0.18])
_BODY = np.array([0.93, 0.84, 0.68])
_TOUCH = np.array([0.87, 0.16, 0.20])
_WAYS = [np.array(tone) / 255.0 for tone in (colors.FAR, colors.MULTIPLIER, (190, 132, 214), colors.NEAR)]
_PARTS = 24
"""of a tool's extent: triangles are no larger where it is asked which of them touch"""
_NEAR = 0.04
"""of the bodies' extent: what is so near beside, and a third of it before a surface, counts as touching it"""
_AXES = {"x": (0.80, 0.25, 0.22), "y": (0.24, 0.58, 0.28), "z": (0.22, 0.38, 0.78)}
_LARGE = 6.0
"""of the bodies' extent: tools of that size are in the picture only as far as they are near"""
_MOST_WAYS = 200
"""points of a way that are drawn"""


@dataclass(frozen=True)
class _Tool:
    """A tool where it starts."""

    shape: ToolShape
    vertices: Floats
    normals: Floats
    lines: Floats
    middle: Floats
    """where its name stands: of a tool that is not in the picture as a whole, where it touches (3,) [m]"""
    way: Floats
    """its position over time, of such a tool from there (k, 3) [m]"""
    touching: Floats
    """corners of the parts of its surface that touch first, where these start (c, 3, 3) [m]"""
    tone: Floats


def draw_scene(
    scene: Scene, surfaces: Mapping[str, SurfaceMesh], position: Floats, orientation: Floats, touch: Ints, path: Path
) -> Path:
    """Write a PNG; position (k, t, 3) [m] and orientation (k, t, 4) of tools over time, touch (t,): when each first
    meets a body, -1 for never."""
    bodies = {name: DisplaySurface(mesh) for name, mesh in surfaces.items()}
    points = {name: mesh.point_rest for name, mesh in surfaces.items()}
    everything = np.concatenate(list(points.values()))
    extent = float(np.ptp(everything, axis=0).max())
    faces = [_divided(mesh.point_rest[mesh.triangles], extent / _PARTS) for mesh in surfaces.values()]
    dense = np.concatenate([np.zeros((0, 3, 3)), *faces])
    shapes = tool_shapes(scene, extent, next(iter(surfaces.values())).tools)
    tools = [
        _tool(shape, position[:, number], orientation[:, number], int(touch[number]), dense, number)
        for number, shape in enumerate(shapes)
    ]
    figure = Figure(figsize=(11.0, 9.2), dpi=120, facecolor=PAPER)
    moved = sum(np.ptp(tool.way, axis=0).max() > 0.0 for tool in tools)
    counted = f"{len(bodies)} {'body' if len(bodies) == 1 else 'bodies'}, {len(tools)} tools, {moved} of them moved"
    heading(figure, scene.name.replace("_", " "), f"{counted}; as it starts, nothing is simulated")
    axes = figure.subplots(2, 2).ravel()
    figure.subplots_adjust(left=0.012, right=0.988, top=0.885, bottom=0.07, wspace=0.03, hspace=0.09)
    seen = _seen(everything, tools, extent)
    for each, (title, (towards, fov)) in zip(axes, _VIEWS.items(), strict=True):
        middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
        away = 10.0 * extent * 26.0 / fov * np.array(towards)
        camera = Camera(middle + away, middle, fov).fitted(seen, _WIDTH, _HEIGHT, 0.80)
        each.imshow(_image(camera, bodies, points, tools, extent), interpolation="lanczos")
        each.set_axis_off()
        each.autoscale(False)
        each.set_title(title or "as seen from the front right", fontsize=10, color=SOFT, pad=4, loc="left")
        _names(each, camera, bodies, points, tools)
        _scale(each, camera, seen, parallel=bool(title))
    _legend(figure, tools)
    return write(figure, path)


def _tool(shape: ToolShape, way: Floats, turns: Floats, touch: int, skin: Floats, number: int) -> _Tool:
    """A tool placed; skin (S, 3, 3) [m]: corners of small triangles of the surfaces of the bodies at rest."""
    at, turn = way[0], turns[0]
    extent = float(np.ptp(skin.reshape(-1, 3), axis=0).max())
    size = float(np.ptp(shape.vertices, axis=0).max())
    lines = rotate(turn, shape.lines.reshape(-1, 3)).reshape(-1, 2, 3) + at
    parts = np.zeros((0, 3, 3))
    if touch >= 0 and shape.kind != "plane" and len(shape.triangles):
        own = _divided(shape.vertices[shape.triangles], min(size, 2.0 * extent) / _PARTS)
        there = rotate(turns[touch], own.reshape(-1, 3)).reshape(-1, 3, 3) + way[touch]
        mine = own[_touching(there, skin)]
        parts = rotate(turn, mine.reshape(-1, 3)).reshape(-1, 3, 3) + at
    thinned = way[np.unique(np.linspace(0, len(way) - 1, min(len(way), _MOST_WAYS)).astype(int))]
    tone = _WAYS[number % len(_WAYS)]
    vertices, normals = rotate(turn, shape.vertices) + at, rotate(turn, shape.normals)
    middle = vertices.mean(axis=0)
    if size >= _LARGE * extent and len(parts):
        middle = parts.mean(axis=(0, 1))
        thinned = thinned - at + middle
    return _Tool(shape, vertices, normals, lines, middle, thinned, parts, tone)


def _divided(corners: Floats, longest: float) -> Floats:
    """Triangles (T, 3, 3) in quarters, until no edge is longer [m], or there are very many."""
    while len(corners) < 20_000:
        long = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1) > longest
        if not long.any():
            break
        a, b, c = corners[long].transpose(1, 0, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        quarters = [np.stack(each, axis=1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        corners = np.concatenate([corners[~long], *quarters])
    return corners


def _normals(corners: Floats) -> Floats:
    """Outward unit normals of triangles (T, 3, 3)."""
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300))


def _touching(corners: Floats, skin: Floats) -> NDArray[np.bool_]:
    """Which triangles (T, 3, 3) lie, or nearly so, on others of a skin (S, 3, 3) that face them (T,)."""
    middle, points, normal, against = corners.mean(axis=1), skin.mean(axis=1), _normals(corners), _normals(skin)
    near = _NEAR * float(np.ptp(skin.reshape(-1, 3), axis=0).max())

    def about(some: Floats, others: Floats) -> NDArray[np.bool_]:
        """Which of some points are near the box around others."""
        found: NDArray[np.bool_] = ((some >= others.min(axis=0) - near) & (some <= others.max(axis=0) + near)).all(
            axis=1
        )
        return found

    close, candidates = about(points, middle), np.flatnonzero(about(middle, points))
    points, against = points[close], against[close]
    found = np.zeros(len(corners), dtype=np.bool_)
    for start in range(0, len(candidates), 256):
        some = candidates[start : start + 256]
        away = points[None] - middle[some, None]
        ahead = np.einsum("tpi,ti->tp", away, normal[some])
        beside = np.sqrt(np.maximum((away**2).sum(axis=2) - ahead**2, 0.0))
        facing = normal[some] @ against.T < -0.5
        found[some] = ((np.abs(ahead) < 0.3 * near) & (beside < near) & facing).any(axis=1)
    return found


def _seen(points: Floats, tools: list[_Tool], extent: float) -> Floats:
    """What the pictures show: bodies, tools that are not much larger, and their ways."""
    small = [
        tool for tool in tools if tool.shape.kind != "plane" and np.ptp(tool.vertices, axis=0).max() < _LARGE * extent
    ]
    ends = [tool.vertices + way - tool.way[0] for tool in small for way in (tool.way.min(axis=0), tool.way.max(axis=0))]
    return np.concatenate([points, *(tool.vertices for tool in small), *ends])


def _image(
    camera: Camera,
    bodies: Mapping[str, DisplaySurface],
    points: Mapping[str, Floats],
    tools: list[_Tool],
    extent: float,
) -> NDArray[np.uint8]:
    canvas = Canvas(_WIDTH, _HEIGHT, camera)
    centre = np.concatenate(list(points.values())).mean(axis=0)
    for tool in tools:
        if tool.shape.kind == "plane":
            canvas.floor(tool.way[0], tool.normals[0], centre, 2.6 * extent, grid_spacing(extent), _GROUND)
    for name, surface in bodies.items():
        vertices = surface.vertices(points[name])
        paint = np.broadcast_to(_BODY, (len(surface.triangles), 3, 3))
        canvas.mesh(vertices, surface.normals(vertices), surface.triangles, paint)
        if len(surface.cell_lines):
            canvas.lines(points[name][surface.cell_lines], _CELL_LINE, alpha=0.35)
    for tool in tools:
        if tool.shape.kind == "plane":
            continue
        count = len(tool.touching)
        if count:
            corners = np.concatenate([tool.touching, tool.touching[:, ::-1]]).reshape(-1, 3)
            flat = np.tile(np.array([[0.0, 0.0, 1.0]]), (len(corners), 1))
            canvas.mesh(corners, flat, np.arange(6 * count).reshape(-1, 3), np.broadcast_to(_TOUCH, (2 * count, 3, 3)))
        glass = np.broadcast_to(_GLASS, (len(tool.shape.triangles), 3, 3))
        canvas.mesh(tool.vertices, tool.normals, tool.shape.triangles, glass, alpha=0.22)
        canvas.lines(tool.lines, _TOOL_LINE, width=1.3, alpha=0.85)
        if np.ptp(tool.way, axis=0).max() > 0.0:
            canvas.lines(np.stack([tool.way[:-1], tool.way[1:]], axis=1), tool.tone, width=2.5, lift=1.0)
    return canvas.image()


def _names(
    axes: Axes, camera: Camera, bodies: Mapping[str, DisplaySurface], points: Mapping[str, Floats], tools: list[_Tool]
) -> None:
    """Names of tools at their middles, of several bodies at theirs, and an arrow where each way ends."""
    boxed = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.65}
    named = [(tool.shape.name, tool.middle) for tool in tools if tool.shape.kind != "plane"]
    groups: dict[str, list[Floats]] = {}
    for name in bodies if len(bodies) > 1 else ():  # copies have one name, on the highest of them
        groups.setdefault(repeated(name) or name, []).append(points[name].mean(axis=0))
    named += [(name, max(at, key=lambda point: float(point[2]))) for name, at in groups.items()]
    for name, at in named:
        x, y, _ = camera.project(at[None], _WIDTH, _HEIGHT)[0]
        if 0.0 <= x <= _WIDTH and 0.0 <= y <= _HEIGHT:
            axes.text(float(x), float(y), name, bbox=boxed, fontsize=8.5, color=INK, ha="center", va="center")
    for tool in tools:
        steps = camera.project(tool.way, _WIDTH, _HEIGHT)[:, :2]
        last = next((k for k in range(len(steps) - 1, -1, -1) if np.hypot(*(steps[-1] - steps[k])) > 6.0), None)
        if last is not None:
            arrow = {"arrowstyle": "-|>", "color": tuple(tool.tone), "linewidth": 1.6}
            axes.annotate("", steps[-1], steps[last], arrowprops=arrow)


def _scale(axes: Axes, camera: Camera, seen: Floats, *, parallel: bool) -> None:
    """The scene's axes from the least corner of what is seen, each of a length that is round and a fifth of what is
    seen from here; and in a parallel view a bar of that length."""
    length = colors.round_up(0.2 * float(np.ptp(seen @ camera.axes()[:2].T, axis=0).max()))
    start = np.zeros(3) if parallel else seen.min(axis=0)
    ends = camera.project(start + np.concatenate([np.zeros((1, 3)), length * np.eye(3)]), _WIDTH, _HEIGHT)[:, :2]
    if parallel:
        ends += np.array([0.06 * _WIDTH, 0.90 * _HEIGHT]) - ends[0]
    for (name, tone), end in zip(_AXES.items(), ends[1:], strict=True):
        if np.hypot(*(end - ends[0])) > 8.0:
            axes.annotate("", end, ends[0], arrowprops={"arrowstyle": "-|>", "color": tone, "linewidth": 1.5})
            x, y = end + 0.14 * (end - ends[0])
            axes.text(float(x), float(y), name, fontsize=9, color=tone, ha="center", va="center")
    if parallel:
        pixels = max(float(np.hypot(*(end - ends[0]))) for end in ends[1:])
        left, y = _WIDTH - 0.04 * _WIDTH - pixels, 0.95 * _HEIGHT
        axes.plot([left, left + pixels], [y, y], color=INK, linewidth=2.0, solid_capstyle="butt")
        axes.text(left + 0.5 * pixels, y - 9, f"{1e3 * length:g} mm", fontsize=8.5, color=INK, ha="center", va="bottom")


def _legend(figure: Figure, tools: list[_Tool]) -> None:
    """What the colours mean."""
    touch = (float(_TOUCH[0]), float(_TOUCH[1]), float(_TOUCH[2]))
    handles: list[Patch | Line2D] = [
        Patch(color=tuple(_BODY), label="body"),
        Patch(color=tuple(_GLASS), label="tools"),
    ]
    if any(len(tool.touching) for tool in tools):
        handles.append(Patch(color=touch, label="what of a tool touches first"))
    handles += [
        Line2D([], [], color=tuple(tool.tone), linewidth=2.5, label=f"way of {tool.shape.name}")
        for tool in tools
        if np.ptp(tool.way, axis=0).max() > 0.0
    ]
    figure.legend(
        handles=handles[:9],
        loc="lower left",
        bbox_to_anchor=(0.012, 0.006),
        ncols=5,
        frameon=False,
        fontsize=9,
        labelcolor=INK,
    )
