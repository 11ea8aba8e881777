"""The body at a few moments of a run: which model computes what, how it is stressed, and how far off it may be."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from softseam.recording import Recording, time_of
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.pair_forces import largest_totals, pair_forces
from softseam.view.paper import INK, PAPER, SOFT, heading, write
from softseam.view.raster import Camera, Canvas
from softseam.view.surface import DisplaySurface, error_energy
from softseam.view.tool_shapes import ToolShape, grid_spacing, rotate, tool_shapes
from softseam_protocol.messages.session import Frame

Floats = NDArray[np.float64]
Moment = dict[str, Frame]
"""the frames of a step, by body"""

_MOMENTS = 5
_CANDIDATES = 60
_WIDTH = 460
_GROUND = np.array([0.905, 0.90, 0.885])
_GLASS = np.array([0.62, 0.66, 0.72])
_TOOL_LINE = np.array([0.36, 0.39, 0.45])
_CELL_LINE = np.array([0.12, 0.13, 0.18])


def draw_snapshots(recording: Recording, builder: ReportBuilder, path: Path) -> Path:
    """Rows of pictures, one column a moment, the same scales in all of them; a third row where errors are known."""
    bodies = {
        name: _Shown(DisplaySurface(mesh), colors.tones(name, builder.columns.models))
        for name, mesh in recording.surfaces.items()
    }
    moments = _pick(recording)
    extent = max(body.surface.extent for body in bodies.values())
    tops: dict[str, float] = {}
    for name, body in bodies.items():
        stress = [float(np.quantile(body.surface.load(frames[name]), 0.995)) for frames in moments]
        label = body.surface.load_label
        tops[label] = max(tops.get(label, 0.0), *stress)
    tops = {label: colors.round_up(top) for label, top in tops.items()}
    tools = tool_shapes(recording.scene, extent, next(iter(recording.surfaces.values())).tools)
    camera, height = _camera([frame for frames in moments for frame in frames.values()], tools, extent)
    wrong = _largest_error(moments, bodies)
    rows = 3 if wrong else 2
    tall = rows * 3.05 * height / _WIDTH + 2.0
    figure = Figure(figsize=(3.05 * len(moments), tall), dpi=160, facecolor=PAPER)
    heading(figure, recording.scene.name.replace("_", " "), builder.verdict.text)
    axes = figure.subplots(rows, len(moments), squeeze=False)
    figure.subplots_adjust(left=0.012, right=0.988, top=1.0 - 1.15 / tall, bottom=0.8 / tall, wspace=0.025, hspace=0.03)
    reports = {report.header.step: report for report in recording.reports()} if recording.scene.interfaces else {}
    steps = {next(iter(frames.values())).header.step for frames in moments}
    most = float(largest_totals(recording, steps).max(initial=0.0))
    for column, frames in enumerate(moments):
        first = next(iter(frames.values()))
        report = None if first.start else reports.get(first.header.step)
        pressed = pair_forces(recording.scene.interfaces, report, frames, most) if report is not None and most else None
        paints = {name: _paint(frame, bodies[name], tops, wrong) for name, frame in frames.items()}
        arrows = np.zeros((0, 2, 3)) if pressed is None else _arrows(*pressed, 0.5 * extent / most)
        images = _draw(frames, bodies, tools, camera, height, paints, extent, arrows)
        for row, image in enumerate(images):
            axes[row, column].imshow(image, interpolation="lanczos")
            axes[row, column].set_axis_off()
        time = time_of(next(iter(frames.values())), recording.scene.step)
        axes[0, column].set_title(f"{time:.2f} s", fontsize=11, color=INK, pad=5)
    outlined = any(len(body.surface.border_lines) > 0 for body in bodies.values())
    _legend(figure, builder, tall, outlined=outlined, pressed=most)
    factors = {body.surface.load_label: body.surface.load_factor for body in bodies.values()}
    scales = [(label, top * factors[label]) for label, top in tops.items()]
    scales += [("energy of the error [J/m³]", wrong)] if wrong else []
    wide = 0.37 if len(scales) == 1 else 0.17
    for i, (label, top) in enumerate(scales[:2]):
        _scale(figure, 0.60 + 0.20 * i, wide, tall, top, label)
    return write(figure, path)


@dataclass(frozen=True)
class _Shown:
    """A body as it is drawn: its surface, and the colours of what is near and far."""

    surface: DisplaySurface
    tones: tuple[colors.Tone, colors.Tone]


def _largest_error(moments: list[Moment], bodies: Mapping[str, _Shown]) -> float:
    """End of the scale of the error's energy [J/m^3]; 0 where a frame does not have it."""
    if any(frame.indicators is None for frames in moments for frame in frames.values()):
        return 0.0
    errors = [
        float(np.quantile(bodies[name].surface.energy_density(error_energy(frame)), 0.995))
        for frames in moments
        for name, frame in frames.items()
    ]
    return colors.round_up(max(errors))


def _paint(frame: Frame, body: _Shown, tops: Mapping[str, float], wrong: float) -> Floats:
    """Colours of the triangles' corners in each row of pictures (T, 3, 3 k)."""
    surface = body.surface
    near = surface.near(frame.cell_near)
    tint = np.where(near[:, None], *body.tones) / 255.0
    layers = [
        np.broadcast_to(tint[:, None, :], (len(tint), 3, 3)),
        _corners(surface, surface.load(frame), tops[surface.load_label]),
    ]
    if wrong:
        layers.append(_corners(surface, surface.energy_density(error_energy(frame)), wrong))
    return np.concatenate(layers, axis=2)


def _corners(surface: DisplaySurface, values: Floats, top: float) -> Floats:
    """Colours at the triangles' corners of values at the surface points (T, 3, 3)."""
    shades = colors.stress_colors(values, top)[surface.vertex_point] / 255.0
    return np.asarray(shades[surface.triangles])


def _pick(recording: Recording) -> list[Moment]:
    """Moments that look different: the first, the last, then again and again the one farthest from those chosen."""
    total = recording.counts["Frame"] // len(recording.surfaces)
    kept = set(np.unique(np.linspace(0, total - 1, min(total, _CANDIDATES)).astype(int)).tolist())
    moments = [frames for i, frames in enumerate(_moments(recording)) if i in kept]
    looks = np.stack([np.concatenate([_look(frame) for frame in frames.values()]) for frames in moments])
    chosen = list(dict.fromkeys((0, len(moments) - 1)))
    away = np.min([np.linalg.norm(looks - looks[c], axis=1) for c in chosen], axis=0)
    while len(chosen) < min(_MOMENTS, len(moments)):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(looks - looks[chosen[-1]], axis=1))
    return [moments[c] for c in sorted(dict.fromkeys(chosen))]


def _moments(recording: Recording) -> Iterator[Moment]:
    """The frames of all bodies, step by step; a step that lost one is left out."""
    frames: Moment = {}
    for frame in recording.frames():
        if frames and _when(frame) != _when(next(iter(frames.values()))):
            frames = {}
        if frame.body in recording.surfaces:
            frames[frame.body] = frame
        if len(frames) == len(recording.surfaces):
            yield frames
            frames = {}


def _when(frame: Frame) -> tuple[int, bool]:
    return frame.header.step, not frame.start


def _look(frame: Frame) -> Floats:
    """Numbers whose distance says how different two frames look: shape counts more than place."""
    centre = frame.point_x.mean(axis=0)
    shape = 6.0 * (frame.point_x - centre) / np.sqrt(len(frame.point_x))
    tools = 2.0 * (frame.tool_position - centre) / np.sqrt(max(len(frame.tool_position), 1))
    return np.concatenate([shape.ravel(), tools.ravel(), centre])


def _camera(frames: list[Frame], tools: list[ToolShape], extent: float) -> tuple[Camera, int]:
    """See the body and the tools that come near it in every frame, from the front right; and the pictures' height."""
    seen = [frame.point_x for frame in frames]
    for frame in frames:
        for tool, at, turn in zip(tools, frame.tool_position, frame.tool_orientation, strict=True):
            corners = rotate(turn, tool.vertices) + at
            if tool.kind != "plane" and np.ptp(corners, axis=0).max() < 3.0 * extent:
                seen.append(corners)
    everything = np.concatenate(seen)
    middle = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
    eye = middle + 10.0 * extent * np.array([0.50, -0.87, 0.36])
    camera = Camera(eye, middle).fitted(everything, _WIDTH, _WIDTH)
    spread = np.ptp(camera.project(everything, _WIDTH, _WIDTH)[:, :2], axis=0)
    height = int(np.clip(_WIDTH * 1.05 * spread[1] / spread[0], 0.5 * _WIDTH, 1.15 * _WIDTH))
    return camera.fitted(everything, _WIDTH, height), height


def _draw(
    frames: Moment,
    bodies: Mapping[str, _Shown],
    tools: list[ToolShape],
    camera: Camera,
    height: int,
    paints: Mapping[str, Floats],
    extent: float,
    arrows: Floats,
) -> list[NDArray[np.uint8]]:
    """Pictures of one moment; paints (T, 3, 3 k) colour each triangle's corners in each of the k; arrows (a, 2, 3) [m]
    are drawn over the bodies, in the first."""
    layers = next(iter(paints.values())).shape[2] // 3
    canvas = Canvas(_WIDTH, height, camera, layers=layers)
    frame = next(iter(frames.values()))
    posed = [
        (tool, rotate(turn, tool.vertices) + at, rotate(turn, tool.normals), at, turn)
        for tool, at, turn in zip(tools, frame.tool_position, frame.tool_orientation, strict=True)
    ]
    vertices = {name: bodies[name].surface.vertices(each.point_x) for name, each in frames.items()}
    centre = np.concatenate(list(vertices.values())).mean(axis=0)
    for tool, _, normals, at, _ in posed:
        if tool.kind == "plane":
            canvas.floor(at, normals[0], centre, 2.6 * extent, grid_spacing(extent), _GROUND)
            for name, above in vertices.items():
                flat = above - np.outer((above - at) @ normals[0], normals[0])
                canvas.shadow(flat, bodies[name].surface.triangles, 0.30, 5)
    for name, each in frames.items():
        surface = bodies[name].surface
        canvas.mesh(vertices[name], surface.normals(vertices[name]), surface.triangles, paints[name])
        if len(surface.cell_lines):
            canvas.lines(each.point_x[surface.cell_lines], _CELL_LINE, alpha=0.45, layer=0)
        if len(surface.border_lines):  # seen through the body
            border = np.array(colors.BORDER) / 255.0
            canvas.lines(each.x[surface.border_lines], border, width=1.6, alpha=0.85, lift=1.0)
    for tool, corners, normals, at, turn in posed:
        if tool.kind != "plane":
            canvas.mesh(corners, normals, tool.triangles, np.tile(_GLASS, (len(tool.triangles), 3, layers)), alpha=0.16)
            edges = rotate(turn, tool.lines.reshape(-1, 3)).reshape(-1, 2, 3) + at
            canvas.lines(edges, _TOOL_LINE, width=1.5, alpha=0.85)
    if len(arrows):
        canvas.lines(arrows, np.array(colors.BETWEEN) / 255.0, width=2.4, lift=1.0, layer=0)
    return [canvas.image(layer) for layer in range(layers)]


def _arrows(at: Floats, force: Floats, length: float) -> Floats:
    """Lines from where bodies press, to both sides: half of a force [N] along each, in metres a newton."""
    half = 0.5 * length * force
    return np.stack([at - half, at + half], axis=1)


def _legend(figure: Figure, builder: ReportBuilder, tall: float, *, outlined: bool, pressed: float) -> None:
    """What the colours mean, below the rows."""
    patches = [
        Patch(color=(tone[0] / 255.0, tone[1] / 255.0, tone[2] / 255.0), label=label)
        for label, (tone, _) in colors.grouped(builder.columns.models).items()
    ]
    patches.append(Patch(color=(0.78, 0.80, 0.83), label="tools"))
    if pressed > 0.0:
        tone = (colors.BETWEEN[0] / 255.0, colors.BETWEEN[1] / 255.0, colors.BETWEEN[2] / 255.0)
        label = f"between bodies, the longest {colors.engineering(pressed, 'N')}"
        patches.append(Patch(color=tone, label=label))
    if outlined:
        white = (colors.BORDER[0] / 255.0, colors.BORDER[1] / 255.0, colors.BORDER[2] / 255.0)
        patches.append(Patch(facecolor=white, edgecolor=INK, linewidth=0.6, label="outline of inclusions"))
    figure.legend(
        handles=patches,
        loc="lower left",
        bbox_to_anchor=(0.012, 0.14 / tall),
        ncols=len(patches),
        frameon=False,
        fontsize=10,
        labelcolor=INK,
    )


def _scale(figure: Figure, left: float, wide: float, tall: float, top: float, label: str) -> None:
    """A ramp of colours from 0 to `top`."""
    scale = figure.add_axes((left, 0.50 / tall, wide, 0.17 / tall))
    ramp = colors.stress_colors(np.linspace(0.0, top, 512), top)
    scale.imshow(ramp[None], aspect="auto", extent=(0.0, top, 0.0, 1.0))
    scale.set_yticks([])
    scale.tick_params(labelsize=9, colors=SOFT, length=2)
    scale.set_xlabel(label, fontsize=9.5, color=INK, labelpad=1)
    for spine in scale.spines.values():
        spine.set_visible(False)
