"""The 3D part of a replay: bodies, stress, tools, forces, frame by frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from softseam.recording import Recording
from softseam.replay import paths
from softseam.view import colors
from softseam.view.surface import DisplaySurface, error_energy
from softseam.view.tool_shapes import ToolShape
from softseam_protocol.messages.session import Frame

Floats = NDArray[np.float64]

_ARROW = 0.24
"""length of the longest arrow of a run, in body extents"""


@dataclass(frozen=True)
class Scales:
    """Of one body, fixed over the run, so that one picture can be compared with another."""

    stress: float
    """end of the colour scale of what `DisplaySurface.load` gives"""
    energy: float
    """end of the colour scale of the strain energy density [J/m^3]"""
    error: float
    """the same of the energy of the error, 0 where the recording has none [J/m^3]"""
    contact: float
    """contact force of the longest arrow [N]"""
    multiplier: float
    """seam force of the longest arrow [N]"""
    low: Floats
    """bounds of the body over the run [m]"""
    high: Floats


def find_scales(recording: Recording, body: str, surface: DisplaySurface) -> Scales:
    """Look at every frame of a body once. Its stress scale ends above 99.5 % of what is seen in 98 % of the frames."""
    tops, dense, wrong, contact, multiplier = [], [], [0.0], 0.0, 0.0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for frame in recording.frames(body):
        tops.append(float(np.quantile(surface.load(frame), 0.995)))
        dense.append(float(np.quantile(surface.energy_density(frame.cell_energy), 0.995)))
        if frame.indicators is not None:
            wrong.append(float(np.quantile(surface.energy_density(error_energy(frame)), 0.995)))
        contact = max(contact, _longest(frame.contact_force))
        multiplier = max(multiplier, _longest(frame.multiplier))
        low, high = np.minimum(low, frame.point_x.min(axis=0)), np.maximum(high, frame.point_x.max(axis=0))
    usual, dense_usual = (float(np.quantile(values, 0.98)) if values else 0.0 for values in (tops, dense))
    error = colors.round_up(max(wrong)) if max(wrong) > 0.0 else 0.0
    return Scales(colors.round_up(usual), colors.round_up(dense_usual), error, contact, multiplier, low, high)


def shared(scales: Mapping[str, Scales], surfaces: Mapping[str, DisplaySurface]) -> dict[str, Scales]:
    """The scales of bodies that show the same by their colours, as one, so that one can be compared with the others."""
    found = {}
    for name, own in scales.items():
        alike = [scales[each] for each, other in surfaces.items() if other.load_label == surfaces[name].load_label]
        names = ("stress", "energy", "error", "contact", "multiplier")
        found[name] = replace(own, **{field: max(getattr(each, field) for each in alike) for field in names})
    return found


def log_tools(stream: rr.RecordingStream, tools: Sequence[ToolShape]) -> None:
    """What of the tools never changes, and which way is up."""
    stream.log(paths.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for tool in tools:
        stream.log(f"{paths.TOOLS}/{tool.name}", _tool_mesh(tool), static=True)
        stream.log(f"{paths.TOOLS}/{tool.name}/edges", _tool_lines(tool), static=True)


class BodyLog:
    """Logs the frames of one body, and with them the tools' poses.

    tones   colours of what is near and far
    sleeps  whether it may sleep
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        body: str,
        surface: DisplaySurface,
        scales: Scales,
        tools: Sequence[ToolShape],
        tones: tuple[colors.Tone, colors.Tone],
        sleeps: bool = False,
    ) -> None:
        self._stream, self._surface, self._scales, self._tools = stream, surface, scales, tools
        self._at = paths.BodyPaths(body)
        self._near: NDArray[np.bool_] | None = None
        self._error = (self._at.error,) if scales.error > 0.0 else ()
        triangles = surface.triangles
        for path in (self._at.stress, self._at.energy, *self._error):
            stream.log(path, rr.Mesh3D.from_fields(triangle_indices=triangles), static=True)
        ghost = rr.Mesh3D.from_fields(triangle_indices=triangles, albedo_factor=(*colors.TOOL, 38))
        stream.log(self._at.ghost, ghost, static=True)
        self._tones, self._asleep = tones, False
        if sleeps:
            self._paint()
        else:
            for path, color in zip((self._at.near, self._at.far), tones, strict=True):
                stream.log(path, rr.Mesh3D.from_fields(albedo_factor=color), static=True)

    def sleep(self, asleep: bool) -> None:
        """Draw the body paler from the stream's current time on where it is asleep."""
        if asleep != self._asleep:
            self._asleep = asleep
            self._paint()

    def _paint(self) -> None:
        for path, color in zip((self._at.near, self._at.far), self._tones, strict=True):
            tone = colors.paler(color) if self._asleep else color
            self._stream.log(path, rr.Mesh3D.from_fields(albedo_factor=tone))

    def log(self, frame: Frame) -> None:
        """Draw one frame at the stream's current time."""
        vertices = self._surface.vertices(frame.point_x)
        shape = rr.Mesh3D.from_fields(
            vertex_positions=vertices.astype(np.float32),
            vertex_normals=self._surface.normals(vertices).astype(np.float32),
        )
        near = self._surface.near(frame.cell_near)
        sides = [path for path, there in ((self._at.near, near), (self._at.far, ~near)) if there.any()]
        for path in (*sides, self._at.stress, self._at.energy, *self._error, self._at.ghost):
            self._stream.log(path, shape)
        stress = self._surface.load(frame)
        energy = self._surface.energy_density(frame.cell_energy)
        shown = [(self._at.stress, stress, self._scales.stress), (self._at.energy, energy, self._scales.energy)]
        if self._error and frame.indicators is not None:
            shown.append((self._at.error, self._surface.energy_density(error_energy(frame)), self._scales.error))
        for path, values, top in shown:
            shades = colors.stress_colors(values, top)[self._surface.vertex_point]
            self._stream.log(path, rr.Mesh3D.from_fields(vertex_colors=shades))
        self._log_regions(near)
        self._log_grid(frame)
        self._log_tools(frame)
        self._log_forces(frame)

    def _log_regions(self, near: NDArray[np.bool_]) -> None:
        if self._near is not None and np.array_equal(near, self._near):
            return
        self._near = near
        for path, mine in ((self._at.near, near), (self._at.far, ~near)):
            self._stream.log(path, rr.Mesh3D.from_fields(triangle_indices=self._surface.triangles[mine]))

    def _log_grid(self, frame: Frame) -> None:
        if len(self._surface.cell_lines):
            strips = frame.point_x[self._surface.cell_lines].astype(np.float32)
            self._stream.log(
                self._at.cells, rr.LineStrips3D(strips, colors=(20, 24, 34, 150), radii=rr.Radius.ui_points(0.6))
            )

        if len(self._surface.border_lines):
            strips = frame.x[self._surface.border_lines].astype(np.float32)
            self._stream.log(
                self._at.inclusions, rr.LineStrips3D(strips, colors=colors.BORDER, radii=rr.Radius.ui_points(1.2))
            )

    def _log_tools(self, frame: Frame) -> None:
        for tool, at, turn in zip(self._tools, frame.tool_position, frame.tool_orientation, strict=True):
            pose = rr.Transform3D(translation=at, quaternion=rr.Quaternion(xyzw=turn[[1, 2, 3, 0]]))
            self._stream.log(f"{paths.TOOLS}/{tool.name}", pose)

    def _log_forces(self, frame: Frame) -> None:
        reach = _ARROW * self._surface.extent
        thick = 0.006 * self._surface.extent
        contact = _arrows(frame.point_x, frame.contact_force, self._scales.contact, reach)
        self._stream.log(
            self._at.contact,
            rr.Arrows3D(origins=contact[0] - contact[1], vectors=contact[1], colors=colors.CONTACT, radii=thick),
        )
        seam = frame.x[frame.coupling_nodes]
        multiplier = _arrows(seam, frame.multiplier, self._scales.multiplier, reach)
        self._stream.log(
            self._at.multiplier,
            rr.Arrows3D(origins=multiplier[0], vectors=multiplier[1], colors=colors.MULTIPLIER, radii=thick),
        )
        self._stream.log(
            self._at.seam_nodes, rr.Points3D(seam.astype(np.float32), colors=colors.MULTIPLIER, radii=1.6 * thick)
        )


def _tool_mesh(tool: ToolShape) -> rr.Mesh3D:
    color = (*colors.GROUND, 255) if tool.kind == "plane" else (*colors.TOOL, 110)
    return rr.Mesh3D(
        vertex_positions=tool.vertices.astype(np.float32),
        vertex_normals=tool.normals.astype(np.float32),
        triangle_indices=tool.triangles,
        albedo_factor=color,
    )


def _tool_lines(tool: ToolShape) -> rr.LineStrips3D:
    color = (86, 92, 106, 120) if tool.kind == "plane" else (*colors.TOOL, 255)
    return rr.LineStrips3D(tool.lines.astype(np.float32), colors=color, radii=rr.Radius.ui_points(0.7))


def _longest(vectors: Floats) -> float:
    return float(np.linalg.norm(vectors, axis=1).max()) if len(vectors) else 0.0


def _arrows(at: Floats, force: Floats, most: float, reach: float) -> tuple[Floats, Floats]:
    """Origins and vectors of the arrows worth drawing; the longest of the run is `reach` long."""
    if most <= 0.0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    shown = np.linalg.norm(force, axis=1) > 0.02 * most
    return at[shown], force[shown] * (reach / most)
