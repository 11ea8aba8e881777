"""A closed mesh, by its signed distance on a grid, made once for the same mesh in a process."""

from __future__ import annotations

import hashlib

import numpy as np

from softseam_protocol.messages.recording import ToolSurface
from softseam_protocol.scene.tools import MeshTool
from softseam_services.body.body import Floats, Ints
from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.surface_points import refine
from softseam_services.shapes.branches import MESH
from softseam_services.shapes.geometry import Geometry
from softseam_services.shapes.mesh_grid import SPACING
from softseam_services.shapes.shape import Files, Shape
from softseam_services.shapes.turns import quaternion_turning

FINENESS = 64
"""spacings along the longest edge of the mesh's bounding box"""
OUTLINE = 16
"""points along the longest edge that tell whether the mesh pokes into a body"""
RIM = 6
"""spacings between the bounding box and the end of the grid; the outermost one is for the interpolation's sake"""
_KEPT = 8
_made: dict[tuple[str, bytes, float, str, str | int | None], ToolMesh] = {}


class ToolMesh:
    """A closed surface about the centre of its bounding box, and the numbers that stand for it."""

    def __init__(self, vertices: Floats, triangles: Ints, notes: tuple[str, ...] = ()) -> None:
        middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        self.vertices: Floats = np.ascontiguousarray(vertices - middle)
        """(n, 3) [m]"""
        self.triangles = triangles
        """counter-clockwise from outside (T, 3)"""
        size = float(np.ptp(vertices, axis=0).max())
        self.outline: Floats = refine(self.vertices, triangles, size / OUTLINE)[0]
        """points of the surface no farther apart than size/OUTLINE (m, 3) [m]"""
        self.notes = notes
        self.row = _distance_row(self.vertices, triangles)


def tool_mesh(path: str, data: bytes, scale: float, up: str, part: str | int | None = None) -> ToolMesh:
    """The mesh of a file, or the one made before from the same content; raises MeshError."""
    key = (path, hashlib.sha256(data).digest(), scale, up, part)
    found = _made.pop(key, None)
    if found is None:
        vertices, triangles, notes = read_solid(path, data, scale, up, part)
        found = ToolMesh(vertices, triangles, notes)
        while len(_made) >= _KEPT:
            _made.pop(next(iter(_made)))
    _made[key] = found
    return found


def _distance_row(vertices: Floats, triangles: Ints) -> Floats:
    """Half edges of the bounding box, origin, spacing, counts and values, see `mesh_grid`.

    The sign is that of (p - nearest) . n, n the normal of the face, edge or vertex on which the nearest point lies.
    Source: Baerentzen and Aanaes 2005, IEEE Trans. Vis. Comput. Graph. 11, 243.
    """
    import igl  # a third of a second, for meshes alone

    half = vertices.max(axis=0)
    spacing = 2.0 * float(half.max()) / FINENESS
    # The grid is centred, so that a symmetric mesh has a symmetric distance.
    counts = 2 * (np.ceil(half / spacing - 1e-9).astype(np.int64) + RIM) + 1
    origin = -0.5 * spacing * (counts - 1)
    steps = [origin[axis] + spacing * np.arange(counts[axis]) for axis in range(3)]
    at = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    by_normals = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    distance = igl.signed_distance(at, vertices, triangles.astype(np.int64), by_normals)[0]
    return np.concatenate([half, origin, [spacing], counts, distance])


def geometry(spec: MeshTool, files: Files) -> Geometry:
    """Numbers are the grid of distances, see `mesh_grid`, which may be wrong beside an edge by a tenth of a spacing.

    Raises MeshError where the file is missing, or no solid.
    """
    if spec.path not in files:
        raise MeshError(f"{spec.path}: the file is missing; give its path relative to the scene file")
    mesh = tool_mesh(spec.path, files[spec.path], spec.scale, spec.up, spec.part)
    half = mesh.row[:3]
    return Geometry(
        numbers=mesh.row,
        outline=mesh.outline,
        reach=float(np.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)),
        orientation=quaternion_turning(np.array(spec.rotation)),
        surface=ToolSurface(mesh.vertices, mesh.triangles),
        slack=0.1 * float(mesh.row[SPACING]),
        notes=mesh.notes,
    )


SHAPE = Shape(geometry, inline=MESH)
