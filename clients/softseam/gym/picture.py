"""An environment as people see it: its bodies and tools, drawn from the same place throughout an episode."""

import copy
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam.observation import Observation
from softseam.view.raster import Camera, Canvas
from softseam.view.surface import DisplaySurface
from softseam.view.tool_shapes import ToolShape, grid_spacing, rotate, tool_shapes
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

WIDTH, HEIGHT = 480, 360
"""of a picture in pixels"""
FPS = 25
"""pictures of an environment in a second of its time: one an action of 0.04 s"""
_FROM = np.array([0.50, -0.87, 0.36])
"""direction from the body to the camera: right, front, above"""
FILL = 0.5
"""part of the picture that body and tools take as it is first drawn: room to move"""
_BODY, _GROUND = np.array([0.93, 0.76, 0.55]), np.array([0.905, 0.90, 0.885])
_GLASS, _LINE, _MARK = np.array([0.62, 0.66, 0.72]), np.array([0.30, 0.32, 0.38]), np.array([0.10, 0.45, 0.30])
NO_MARKS: Floats = np.zeros((0, 2, 3))


class Pose(NamedTuple):
    """Where a tool is."""

    position: Floats
    """[m]"""
    turn: Floats
    """rotation from its own frame (3, 3)"""

    def place(self, own: Floats) -> Floats:
        """Where points of the tool are (n, 3) [m]."""
        return np.asarray(own @ self.turn.T + self.position)


class Picture:
    """Draws the moments of an episode.

    scene     whose tools are drawn
    surfaces  of its bodies, by name
    camera    where it was before; None: where it suits the first moment that is drawn or placed
    """

    def __init__(self, scene: Scene, surfaces: Mapping[str, SurfaceMesh], camera: Camera | None = None) -> None:
        self.camera = camera
        self._bodies = {name: DisplaySurface(mesh) for name, mesh in surfaces.items()}
        self._extent = max(surface.extent for surface in self._bodies.values())
        meshes = {name: tool for mesh in surfaces.values() for name, tool in mesh.tools.items()}
        self._tools = tool_shapes(scene, self._extent, meshes)
        self._empty: Canvas | None = None

    def place(self, observation: Observation, marks: Floats) -> Camera:
        """The camera that suits a moment and lines (l, 2, 3) [m], from now on."""
        points, poses = self._of(observation)
        self.camera = self._fitted(np.concatenate([*points.values(), marks.reshape(-1, 3)]), poses)
        return self.camera

    def of(self, observation: Observation, marks: Floats) -> Image:
        """The moment of an observation (HEIGHT, WIDTH, 3), and lines (l, 2, 3) [m]."""
        return self.draw(*self._of(observation), marks)

    def _of(self, observation: Observation) -> tuple[dict[str, Floats], list[Pose]]:
        points = {name: observation.frames[name].point_x for name in self._bodies}
        poses = [
            Pose(tool.position, rotate(tool.orientation, np.eye(3)).T)
            for tool in (observation.tools[shape.name] for shape in self._tools)
        ]
        return points, poses

    def draw(self, points: Mapping[str, Floats], poses: Sequence[Pose], marks: Floats = NO_MARKS) -> Image:
        """A moment (HEIGHT, WIDTH, 3).

        points  of each body's surface (P, 3) [m]
        poses   of the tools, in the scene's order
        marks   lines (l, 2, 3) [m]
        """
        posed = list(zip(self._tools, poses, strict=True))
        if self._empty is None:
            self.camera = self.camera or self._fitted(np.concatenate(list(points.values())), poses)
            self._empty = self._planes(self.camera, posed)
        canvas = copy.deepcopy(self._empty)
        vertices = {name: surface.vertices(points[name]) for name, surface in self._bodies.items()}
        for tool, pose in posed:
            if tool.kind == "plane":
                normal = pose.turn @ tool.normals[0]
                for name, above in vertices.items():
                    flat = above - np.outer((above - pose.position) @ normal, normal)
                    canvas.shadow(flat, self._bodies[name].triangles, 0.30, 4)
        for name, surface in self._bodies.items():
            paint = np.broadcast_to(_BODY, (len(surface.triangles), 3, 3))
            canvas.mesh(vertices[name], surface.normals(vertices[name]), surface.triangles, paint)
            canvas.lines(points[name][surface.cell_lines], _LINE, alpha=0.45)
        canvas.lines(marks, _MARK, width=2.0)
        for tool, pose in posed:
            if tool.kind != "plane":
                paint = np.broadcast_to(_GLASS, (len(tool.triangles), 3, 3))
                canvas.mesh(pose.place(tool.vertices), tool.normals @ pose.turn.T, tool.triangles, paint, alpha=0.16)
                edges = pose.place(tool.lines.reshape(-1, 3)).reshape(-1, 2, 3)
                canvas.lines(edges, _LINE, width=1.5, alpha=0.85)
        return canvas.image()

    def _fitted(self, points: Floats, poses: Sequence[Pose]) -> Camera:
        """A camera to which bodies and the tools beside them are in the middle."""
        seen = [points]
        for tool, pose in zip(self._tools, poses, strict=True):
            corners = pose.place(tool.vertices)
            if tool.kind != "plane" and np.ptp(corners, axis=0).max() < 3.0 * self._extent:
                seen.append(corners)
        everything = np.concatenate(seen)
        middle = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
        return Camera(middle + 10.0 * self._extent * _FROM, middle).fitted(everything, WIDTH, HEIGHT, FILL)

    def _planes(self, camera: Camera, posed: Sequence[tuple[ToolShape, Pose]]) -> Canvas:
        """What does not move."""
        canvas = Canvas(WIDTH, HEIGHT, camera)
        for tool, pose in posed:
            if tool.kind == "plane":
                normal, spacing = pose.turn @ tool.normals[0], grid_spacing(self._extent)
                canvas.floor(pose.position, normal, camera.target, 4.0 * self._extent, spacing, _GROUND)
        return canvas
