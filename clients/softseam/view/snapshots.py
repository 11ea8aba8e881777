"""The body at a few moments of a run: which model computes what, how it is stressed, and how far off it may be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from softseam.recording import Recording
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.paper import INK, PAPER, SOFT, heading, write
from softseam.view.raster import Camera, Canvas
from softseam.view.surface import DisplaySurface, error_energy
from softseam.view.tool_shapes import ToolShape, grid_spacing, rotate, tool_shapes
from softseam_protocol.messages.session import Frame

Floats = NDArray[np.float64]

_MOMENTS = 5
_CANDIDATES = 60
_WIDTH = 460
_GROUND = np.array([0.905, 0.90, 0.885])
_GLASS = np.array([0.62, 0.66, 0.72])
_TOOL_LINE = np.array([0.36, 0.39, 0.45])
_CELL_LINE = np.array([0.12, 0.13, 0.18])


def draw_snapshots(recording: Recording, builder: ReportBuilder, path: Path) -> Path:
    """Rows of pictures, one column a moment, the same scales in all of them; a third row where errors are known."""
    assert recording.surface is not None
    surface = DisplaySurface(recording.surface)
    frames = _pick(recording)
    stresses = [surface.load(frame) for frame in frames]
    top = colors.round_up(max(float(np.quantile(stress, 0.995)) for stress in stresses))
    tones = {"near": colors.NEAR, "far": colors.FAR}
    tones |= {name: tone for name, (_, tone) in colors.regions(builder.columns.models).items()}
    tools = tool_shapes(recording.scene, surface.extent, recording.surface.tools)
    camera, height = _camera(frames, tools, surface.extent)
    errors = _errors(frames, surface)
    wrong = colors.round_up(max(float(np.quantile(error, 0.995)) for error in errors)) if errors else 0.0
    rows = 3 if errors else 2
    tall = rows * 3.05 * height / _WIDTH + 2.0
    figure = Figure(figsize=(3.05 * len(frames), tall), dpi=160, facecolor=PAPER)
    heading(figure, recording.scene.name.replace("_", " "), builder.verdict.text)
    axes = figure.subplots(rows, len(frames), squeeze=False)
    figure.subplots_adjust(left=0.012, right=0.988, top=1.0 - 1.15 / tall, bottom=0.8 / tall, wspace=0.025, hspace=0.03)
    for column, (frame, stress) in enumerate(zip(frames, stresses, strict=True)):
        near = surface.near(frame.cell_near)
        tint = np.where(near[:, None], tones["near"], tones["far"]) / 255.0
        layers = [np.broadcast_to(tint[:, None, :], (len(tint), 3, 3)), _corners(surface, stress, top)]
        if errors:
            layers.append(_corners(surface, errors[column], wrong))
        paint = np.concatenate(layers, axis=2)
        images = _draw(frame, surface, tools, camera, height, paint)
        for row, image in enumerate(images):
            axes[row, column].imshow(image, interpolation="lanczos")
            axes[row, column].set_axis_off()
        time = frame.header.time + recording.scene.step
        axes[0, column].set_title(f"{time:.2f} s", fontsize=11, color=INK, pad=5)
    _legend(figure, builder, tall, outlined=len(surface.border_lines) > 0)
    _scale(figure, 0.60, 0.37 if not errors else 0.17, tall, top * surface.load_factor, surface.load_label)
    if errors:
        _scale(figure, 0.80, 0.17, tall, wrong, "energy of the error [J/m³]")
    return write(figure, path)


def _errors(frames: list[Frame], surface: DisplaySurface) -> list[Floats]:
    """Energy of the error at the surface points in each frame [J/m^3]; none where a frame does not have it."""
    if any(frame.indicators is None for frame in frames):
        return []
    return [surface.energy_density(error_energy(frame)) for frame in frames]


def _corners(surface: DisplaySurface, values: Floats, top: float) -> Floats:
    """Colours at the triangles' corners of values at the surface points (T, 3, 3)."""
    shades = colors.stress_colors(values, top)[surface.vertex_point] / 255.0
    return np.asarray(shades[surface.triangles])


def _pick(recording: Recording) -> list[Frame]:
    """Moments that look different: the first, the last, then again and again the one farthest from those chosen."""
    total = recording.counts["Frame"]
    kept = set(np.unique(np.linspace(0, total - 1, min(total, _CANDIDATES)).astype(int)).tolist())
    frames = [frame for i, frame in enumerate(recording.frames()) if i in kept]
    looks = np.stack([_look(frame) for frame in frames])
    chosen = list(dict.fromkeys((0, len(frames) - 1)))
    away = np.min([np.linalg.norm(looks - looks[c], axis=1) for c in chosen], axis=0)
    while len(chosen) < min(_MOMENTS, len(frames)):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(looks - looks[chosen[-1]], axis=1))
    return [frames[c] for c in sorted(dict.fromkeys(chosen))]


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
    frame: Frame, surface: DisplaySurface, tools: list[ToolShape], camera: Camera, height: int, paint: Floats
) -> list[NDArray[np.uint8]]:
    """Pictures of one moment; paint (T, 3, 3 k) colours each triangle's corners in each of the k."""
    layers = paint.shape[2] // 3
    canvas = Canvas(_WIDTH, height, camera, layers=layers)
    vertices = surface.vertices(frame.point_x)
    posed = [
        (tool, rotate(turn, tool.vertices) + at, rotate(turn, tool.normals), at, turn)
        for tool, at, turn in zip(tools, frame.tool_position, frame.tool_orientation, strict=True)
    ]
    for tool, _, normals, at, _ in posed:
        if tool.kind == "plane":
            centre = vertices.mean(axis=0)
            canvas.floor(at, normals[0], centre, 2.6 * surface.extent, grid_spacing(surface.extent), _GROUND)
            flat = vertices - np.outer((vertices - at) @ normals[0], normals[0])
            canvas.shadow(flat, surface.triangles, 0.30, 5)
    canvas.mesh(vertices, surface.normals(vertices), surface.triangles, paint)
    if len(surface.cell_lines):
        canvas.lines(frame.point_x[surface.cell_lines], _CELL_LINE, alpha=0.45, layer=0)
    if len(surface.border_lines):  # seen through the body
        canvas.lines(frame.x[surface.border_lines], np.array(colors.BORDER) / 255.0, width=1.6, alpha=0.85, lift=1.0)
    for tool, corners, normals, at, turn in posed:
        if tool.kind != "plane":
            canvas.mesh(corners, normals, tool.triangles, np.tile(_GLASS, (len(tool.triangles), 3, layers)), alpha=0.16)
            edges = rotate(turn, tool.lines.reshape(-1, 3)).reshape(-1, 2, 3) + at
            canvas.lines(edges, _TOOL_LINE, width=1.5, alpha=0.85)
    return [canvas.image(layer) for layer in range(layers)]


def _legend(figure: Figure, builder: ReportBuilder, tall: float, *, outlined: bool) -> None:
    """What the colours mean, below the rows."""
    patches = [
        Patch(color=(tone[0] / 255.0, tone[1] / 255.0, tone[2] / 255.0), label=label)
        for label, tone in colors.regions(builder.columns.models).values()
    ]
    patches.append(Patch(color=(0.78, 0.80, 0.83), label="tools"))
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
