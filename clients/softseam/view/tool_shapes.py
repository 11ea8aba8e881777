"""Rigid tools as triangle meshes in their own frames, and poses applied to them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.recording import ToolSurface
from softseam_protocol.scene.scene import Scene
from softseam_protocol.table import Table

Floats = NDArray[np.float64]
Mesh = tuple[Floats, Floats, NDArray[np.int64]]
"""vertices, normals, triangles"""

PLANE_EXTENTS = 5.0
"""edge of the square that stands for a plane, in body extents"""
_SIDES = 48
_CREASE = np.cos(np.radians(30.0))
"""edges of a mesh between triangles that turn by more are drawn"""
_NOTHING: tuple[Mesh, Floats] = (
    (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)),
    np.zeros((0, 2, 3)),
)


@dataclass(frozen=True)
class ToolShape:
    """One tool; vertices are in its own frame, faces are flat-shaded with outward normals."""

    name: str
    kind: str
    vertices: Floats
    """(n, 3) [m]"""
    normals: Floats
    triangles: NDArray[np.int64]
    lines: Floats
    """edges, or a grid on a plane, as pairs of ends (l, 2, 3) [m]"""


def tool_shapes(scene: Scene, extent: float, meshes: Mapping[str, ToolSurface]) -> list[ToolShape]:
    """Meshes of all tools in the scene's order, beside a body of this extent [m].

    meshes: of the tools whose surfaces a recording has, by name. Raises MissingRow for others whose kind has no drawing
    """
    plane_size = PLANE_EXTENTS * extent
    shapes = []
    for name, tool in scene.tools.items():
        mesh, lines = _facets(meshes[name]) if name in meshes else DRAWINGS[tool.kind](tool, plane_size)
        shapes.append(ToolShape(name, tool.kind, *mesh, lines))
    return shapes


def rotate(quaternion: Floats, vectors: Floats) -> Floats:
    """Rotate (n, 3) by a unit quaternion w, x, y, z: v + 2 q x (q x v + w v)."""
    w, q = quaternion[0], quaternion[1:]
    return np.asarray(vectors + 2.0 * np.cross(q, np.cross(q, vectors) + w * vectors))


def _box(half: Floats) -> Mesh:
    vertices: list[Floats] = []
    normals: list[Floats] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1.0, 1.0):
            base = len(vertices)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[axis], corner[u], corner[v] = side, a, b
                vertices.append(corner * half)
                normals.append(side * np.eye(3)[axis])
            order = (0, 1, 2, 3) if side > 0 else (0, 3, 2, 1)
            triangles += [[base + order[i] for i in t] for t in ((0, 1, 2), (0, 2, 3))]
    return np.array(vertices), np.array(normals), np.array(triangles, dtype=np.int64)


def _box_edges(half: Floats) -> Floats:
    corners = np.array([[(c >> axis & 1) * 2.0 - 1.0 for axis in range(3)] for c in range(8)]) * half
    return np.array([[corners[c], corners[c | 1 << axis]] for axis in range(3) for c in range(8) if not c >> axis & 1])


def _square(normal: Floats, edge: float) -> tuple[Mesh, Floats]:
    """A square, and a grid of lines just above it."""
    n = normal / np.linalg.norm(normal)
    u = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    corners = 0.5 * edge * np.array([-u - v, u - v, u + v, -u + v])
    spacing = grid_spacing(edge / PLANE_EXTENTS)
    count = int(0.5 * edge / spacing)
    at = spacing * np.arange(-count, count + 1)[:, None]
    above, reach = 2e-4 * edge * n, 0.5 * edge
    along = np.stack([at * u - reach * v + above, at * u + reach * v + above], axis=1)
    across = np.stack([at * v - reach * u + above, at * v + reach * u + above], axis=1)
    mesh = corners, np.tile(n, (4, 1)), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int64)
    return mesh, np.concatenate([along, across])


def grid_spacing(extent: float) -> float:
    """Grid lines at a round distance: 1 cm for bodies of some centimetres [m]."""
    return float(10.0 ** np.floor(np.log10(max(extent, 1e-6) / 3.0)))


def _circles(radius: float) -> Floats:
    turn = np.linspace(0.0, 2.0 * np.pi, 65)
    ring = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    rings = [np.roll(ring, shift, axis=1) for shift in range(3)]
    return np.concatenate([np.stack([r[:-1], r[1:]], axis=1) for r in rings])


def _sphere(radius: float, n_rings: int = 24) -> Mesh:
    polar = np.linspace(0.0, np.pi, n_rings + 1)
    turn = np.linspace(0.0, 2.0 * np.pi, 2 * n_rings + 1)
    p, t = np.meshgrid(polar, turn, indexing="ij")
    normals = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=-1).reshape(-1, 3)
    row = 2 * n_rings + 1
    corner = (np.arange(n_rings)[:, None] * row + np.arange(2 * n_rings)).ravel()
    quads = np.stack([corner, corner + row, corner + row + 1, corner + 1], axis=1)
    return radius * normals, normals, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _ring(radius: float, height: float) -> Floats:
    """A circle about z, its first point also its last (n, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full_like(turn, height)], axis=1)


def _segments(*strips: Floats) -> Floats:
    return np.concatenate([np.stack([strip[:-1], strip[1:]], axis=1) for strip in strips])


def _capsule(radius: float, half: float) -> tuple[Mesh, Floats]:
    """A sphere pulled apart at its equator, circles where the ends begin, and two outlines along the axis."""
    vertices, normals, triangles = _sphere(radius)
    # the sphere's rings start at the top; the one at the equator belongs to the upper half
    apart = np.where(vertices[:, 2] > -1e-9 * radius, half, -half)
    pulled = vertices + apart[:, None] * np.array([0.0, 0.0, 1.0])
    turn = np.linspace(0.0, np.pi, _SIDES // 2 + 1)
    arc = np.stack([radius * np.cos(turn), np.zeros_like(turn), half + radius * np.sin(turn)], axis=1)
    outline = np.concatenate([arc, -arc, arc[:1]])
    across = outline[:, [1, 0, 2]]
    return (pulled, normals, triangles), _segments(_ring(radius, half), _ring(radius, -half), outline, across)


def _cylinder(radius: float, half: float) -> tuple[Mesh, Floats]:
    """The side, two flat ends, and their rims."""
    low, high = _ring(radius, -half), _ring(radius, half)
    n, count = len(low), _SIDES
    outward = low * [1.0 / radius, 1.0 / radius, 0.0]
    down, up = np.tile([0.0, 0.0, -1.0], (n + 1, 1)), np.tile([0.0, 0.0, 1.0], (n + 1, 1))
    ends = [np.concatenate([ring, [[0.0, 0.0, ring[0, 2]]]]) for ring in (low, high)]
    i = np.arange(count)
    sides = [np.stack([i, i + 1, n + i + 1], axis=1), np.stack([i, n + i + 1, n + i], axis=1)]
    bottom, top = 2 * n, 3 * n + 1
    middle = np.full(count, n)
    caps = [bottom + np.stack([middle, i + 1, i], axis=1), top + np.stack([middle, i, i + 1], axis=1)]
    mesh = (
        np.concatenate([low, high, *ends]),
        np.concatenate([outward, outward, down, up]),
        np.concatenate([*sides, *caps]),
    )
    return mesh, _segments(low, high)


def _facets(surface: ToolSurface) -> tuple[Mesh, Floats]:
    """A mesh's triangles, each with corners of its own, and the edges where it is creased."""
    corners = surface.vertices[surface.triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = area / np.linalg.norm(area, axis=1, keepdims=True)
    sides = np.sort(surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs = np.lexsort((sides[:, 1], sides[:, 0])).reshape(-1, 2)
    creased = np.einsum("ei,ei->e", normal[pairs[:, 0] // 3], normal[pairs[:, 1] // 3]) < _CREASE
    mesh = corners.reshape(-1, 3), np.repeat(normal, 3, axis=0), np.arange(3 * len(corners)).reshape(-1, 3)
    return mesh, surface.vertices[sides[pairs[creased, 0]]]


DRAWINGS: Table[Callable[[Any, float], tuple[Mesh, Floats]]] = Table(
    "drawings of tools",
    {
        "plane": lambda tool, plane_size: _square(np.array(tool.normal), plane_size),
        "box": lambda tool, _: (_box(half := 0.5 * np.array(tool.size)), _box_edges(half)),
        "sphere": lambda tool, _: (_sphere(tool.radius), _circles(tool.radius)),
        "capsule": lambda tool, _: _capsule(tool.radius, 0.5 * tool.length),
        "cylinder": lambda tool, _: _cylinder(tool.radius, 0.5 * tool.length),
        "mesh": lambda tool, _: _NOTHING,
    },
)
"""(tool, edge of a plane's square [m]) -> mesh and lines, of kinds whose surface no recording has; a mesh, whose every
recording has it, is left out of a run that has no recording"""
