"""Rigid tools as triangle meshes in their own frames, and poses applied to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene import BoxTool, PlaneTool, Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ToolShape:
    """One tool; vertices are in its own frame, faces are flat-shaded with outward normals."""

    name: str
    kind: str
    vertices: Floats
    """(n, 3) [m]"""
    normals: Floats
    triangles: NDArray[np.int64]
    moves: bool
    """whether the scene's motion moves it"""


def tool_shapes(scene: Scene, plane_size: float) -> list[ToolShape]:
    """Meshes of all tools in the scene's order; planes are drawn as squares with this edge [m]."""
    moving = {name for phase in scene.motion for name in getattr(phase, "tools", ())}
    shapes = []
    for name, tool in scene.tools.items():
        if isinstance(tool, BoxTool):
            vertices, normals, triangles = _box(0.5 * np.array(tool.size))
        elif isinstance(tool, PlaneTool):
            vertices, normals, triangles = _square(np.array(tool.normal), plane_size)
        else:
            vertices, normals, triangles = _sphere(tool.radius)
        shapes.append(ToolShape(name, tool.kind, vertices, normals, triangles, name in moving))
    return shapes


def rotate(quaternion: Floats, vectors: Floats) -> Floats:
    """Rotate (n, 3) by a unit quaternion w, x, y, z: v + 2 q x (q x v + w v)."""
    w, q = quaternion[0], quaternion[1:]
    return np.asarray(vectors + 2.0 * np.cross(q, np.cross(q, vectors) + w * vectors))


def _box(half: Floats) -> tuple[Floats, Floats, NDArray[np.int64]]:
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


def _square(normal: Floats, edge: float) -> tuple[Floats, Floats, NDArray[np.int64]]:
    n = normal / np.linalg.norm(normal)
    u = np.cross(np.eye(3)[int(np.argmin(np.abs(n)))], n)
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    corners = 0.5 * edge * np.array([-u - v, u - v, u + v, -u + v])
    return corners, np.tile(n, (4, 1)), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int64)


def _sphere(radius: float, n_rings: int = 24) -> tuple[Floats, Floats, NDArray[np.int64]]:
    polar = np.linspace(0.0, np.pi, n_rings + 1)
    turn = np.linspace(0.0, 2.0 * np.pi, 2 * n_rings + 1)
    p, t = np.meshgrid(polar, turn, indexing="ij")
    normals = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=-1).reshape(-1, 3)
    row = 2 * n_rings + 1
    corner = (np.arange(n_rings)[:, None] * row + np.arange(2 * n_rings)).ravel()
    quads = np.stack([corner, corner + row, corner + row + 1, corner + 1], axis=1)
    return radius * normals, normals, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
