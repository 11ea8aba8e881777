"""A closed mesh, by its signed distance on a grid, made once for the same mesh in a process."""

from __future__ import annotations

import hashlib

import numpy as np

from softseam_protocol.messages.recording import ToolSurface
from softseam_protocol.scene.tools import MeshTool
from softseam_services.body.body import ALIKE, Floats, Ints
from softseam_services.body.embed import base_of, read_in_place
from softseam_services.body.errors import MeshError
from softseam_services.body.surface_check import enclosed_volume, orient, triangle_areas
from softseam_services.body.surface_points import refine
from softseam_services.shapes.branches import MESH
from softseam_services.shapes.geometry import Geometry
from softseam_services.shapes.mesh_grid import COUNTS, ORIGIN, SPACING, VALUES
from softseam_services.shapes.shape import Files, Shape
from softseam_services.shapes.turns import quaternion_turning

FINENESS = 64
"""spacings along the longest edge of the mesh's bounding box, at least"""
ACROSS = 4
"""spacings across walls, where that takes no more than `MOST` points: every cubic at a wall's face then knows values of
that face alone, and is exact"""
OUTLINE = 16
"""points along the longest edge that show whether the mesh pokes into a body"""
RIM = 6
"""spacings between the bounding box and the end of the grid; the outermost one is for the interpolation's sake"""
MOST = (FINENESS + 2 * RIM + 1) ** 3
"""points of a grid: those of a cube"""
_SEEN = 1.5
"""spacings across a wall, wherever the grid lies: its faces are felt within .08 of a spacing; below .9 it is missed"""
_FEW = 0.05
"""share of the surface that may lie over thinner walls, as beside sharp edges [1]"""
_KEPT = 8
PLANE, SAME_PLANE = 1.0 / 12.0, 2e-3
"""of a surface, what counts as flat; of a normal and of the longest edge, within which triangles lie in one plane"""
CHAMFER = 0.7
"""spacings: by such a radius a grid's own cells round edges already, a right angle's"""
THINNED = 0.8
"""of a radius by which edges are rounded: so much is taken off walls that are thinner"""
Surface = tuple[Floats, Ints]
"""vertices and triangles"""
_made: dict[tuple[str, bytes, float | None, str | None, str | int | None], ToolMesh] = {}


class ToolMesh:
    """A closed surface about the centre of its bounding box, and the numbers that stand for it.

    Cavities behind walls that the grid does not see are filled: no body that is outside them can come in.
    """

    def __init__(
        self, vertices: Floats, triangles: Ints, notes: tuple[str, ...] = (), origin: Floats | None = None
    ) -> None:
        triangles, thin = _without_thin_walls(vertices, triangles)
        middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        self.origin: Floats = (np.zeros(3) if origin is None else origin) - middle
        """of the file (3,) [m]"""
        self.vertices: Floats = np.ascontiguousarray(vertices - middle)
        """(n, 3) [m]"""
        self.triangles = triangles
        """counter-clockwise from outside (T, 3)"""
        size = float(np.ptp(vertices, axis=0).max())
        self.outline: Floats = refine(self.vertices, triangles, size / OUTLINE)[0]
        """points of the surface no farther apart than size/OUTLINE (m, 3) [m]"""
        self.notes = notes + thin
        self.row = _distance_row(self.vertices, triangles)
        self.wall = wall_of(self.vertices, self.triangles)
        """how thick its walls are in the mean [m]"""
        self.bends = _curved_share(self.vertices, triangles)
        """share of the surface that is no large plane [1]"""
        self._rounded: dict[float, Floats] = {}

    def rounded(self, radius: float) -> Floats:
        """`row`, with edges of a radius [m]."""
        if radius not in self._rounded:
            row = self.row
            if radius > CHAMFER * float(row[SPACING]):
                row = _rounded_row(row, radius, _shrunk(self.vertices, self.triangles, radius))
            self._rounded = {radius: row}
        return self._rounded[radius]


def tool_mesh(path: str, data: bytes, scale: float | None, up: str | None, part: str | int | None = None) -> ToolMesh:
    """The mesh of a file, or the one made before from the same content; raises MeshError."""
    key = (path, hashlib.sha256(data).digest(), scale, up, part)
    found = _made.pop(key, None)
    if found is None:
        vertices, triangles, notes = read_in_place(path, data, scale, up, part)
        base = base_of(vertices)
        found = ToolMesh(vertices - base, triangles, notes, -base)
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
    spacing = _spacing(half, wall_of(vertices, triangles))
    counts = _counts(half, spacing)
    origin = -0.5 * spacing * (counts - 1)
    steps = [origin[axis] + spacing * np.arange(counts[axis]) for axis in range(3)]
    at = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    by_normals = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    distance = igl.signed_distance(at, vertices, triangles.astype(np.int64), by_normals)[0]
    return np.concatenate([half, origin, [spacing], counts, distance])


def _rounded_row(row: Floats, radius: float, core: Surface | None) -> Floats:
    """A grid of distances with the solid's convex edges rounded as a ball of this radius that rolls inside rounds them:
    the distance to where the solid is so deep, its core, less the radius. Walls that are too thin for it lose THINNED
    of it. Where the core is not known, it is found on the grid, whose cells cut off its edges, as they do the solid's.
    """
    import igl

    counts, spacing = row[COUNTS:VALUES].astype(np.int64), row[SPACING]
    steps = [row[ORIGIN + axis] + spacing * np.arange(counts[axis]) for axis in range(3)]
    at = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    distance = row[VALUES : VALUES + int(counts.prod())]
    if core is None:
        radius -= CHAMFER * float(spacing)
        if distance.min() > -1.5 * spacing - radius:
            return row
        fastest = np.ascontiguousarray(distance.reshape(counts).transpose(2, 1, 0).ravel())
        places = np.ascontiguousarray(at.reshape(*counts, 3).transpose(2, 1, 0, 3).reshape(-1, 3))
        core = igl.marching_cubes(fastest, places, *(int(n) for n in counts), -radius)[:2]
    by_normals = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    inner = igl.signed_distance(at, core[0], core[1].astype(np.int64), by_normals)[0]
    rounded = np.minimum(inner - radius, distance + THINNED * radius)
    return np.concatenate([row[:VALUES], np.maximum(rounded, distance)])


def _shrunk(vertices: Floats, triangles: Ints, radius: float) -> Surface | None:
    """Where a convex solid is so deep: its planes, moved inwards. None of others, and where it is nowhere so deep."""
    from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

    size = float(np.ptp(vertices, axis=0).max())
    area = triangle_areas(vertices, triangles)
    normal = area / np.linalg.norm(area, axis=1, keepdims=True)
    offset = np.einsum("ti,ti->t", normal, vertices[triangles[:, 0]])
    if (normal @ vertices.T - offset[:, None]).max() > ALIKE * size:
        return None
    planes = np.unique(np.round(np.column_stack([normal, (radius - offset) / size]), 9), axis=0)
    planes[:, 3] *= size
    middle = vertices.mean(axis=0)
    if (planes[:, :3] @ middle + planes[:, 3]).max() > -ALIKE * size:
        return None
    try:
        corners = HalfspaceIntersection(planes, middle).intersections
        hull = ConvexHull(corners)
    except QhullError:
        return None
    faces = hull.simplices.astype(np.int64)
    across = np.einsum(
        "ti,ti->t", np.cross(*(corners[faces[:, i]] - corners[faces[:, 0]] for i in (1, 2))), hull.equations[:, :3]
    )
    faces[across < 0.0] = faces[across < 0.0][:, ::-1]
    return corners, faces


def _curved_share(vertices: Floats, triangles: Ints) -> float:
    """Share of a surface that belongs to no plane of at least PLANE of it [1]."""
    area = triangle_areas(vertices, triangles)
    size = np.linalg.norm(area, axis=1)
    normal = area / size[:, None]
    offset = np.einsum("ti,ti->t", normal, vertices[triangles[:, 0]])
    length = float(np.ptp(vertices, axis=0).max())
    keys = np.round(np.concatenate([normal / SAME_PLANE, offset[:, None] / (SAME_PLANE * length)], axis=1))
    _, plane = np.unique(keys, axis=0, return_inverse=True)
    of_plane = np.bincount(plane.ravel(), size)
    return float(of_plane[of_plane < PLANE * size.sum()].sum() / of_plane.sum())  # 1 exactly where nothing is flat


def wall_of(vertices: Floats, triangles: Ints) -> float:
    """How thick the walls of a solid are in the mean: twice its volume over its surface [m]."""
    area = float(np.linalg.norm(triangle_areas(vertices, triangles), axis=1).sum())
    return 2.0 * enclosed_volume(vertices, triangles) / area


def _counts(half: Floats, spacing: float) -> Ints:
    """Points along each axis; the grid is centred, so that a symmetric mesh has a symmetric distance."""
    return np.asarray(2 * (np.ceil(half / spacing - 1e-9).astype(np.int64) + RIM) + 1)


def _spacing(half: Floats, wall: float) -> float:
    """Between points, for a bounding box with these half edges (3,) and walls so thick [m]."""
    coarse = 2.0 * float(half.max()) / FINENESS
    spacing = min(coarse, wall / ACROSS)
    while spacing < coarse and _counts(half, spacing).prod() > MOST:
        spacing *= 1.05
    return min(coarse, spacing)


def _thin_share(vertices: Floats, triangles: Ints, thickness: float) -> float:
    """Share of the surface beneath which a solid is thinner than this [m]: so deep one is outside again [1]."""
    import igl

    points, faces = refine(vertices, triangles, float(np.ptp(vertices, axis=0).max()) / OUTLINE)
    area = triangle_areas(points, faces)
    size = np.linalg.norm(area, axis=1)
    beneath = points[faces].mean(axis=1) - thickness * area / size[:, None]
    inside = igl.winding_number(vertices, triangles.astype(np.int64), beneath) > 0.5
    return float(size[~inside].sum() / size.sum())


def _without_thin_walls(vertices: Floats, triangles: Ints) -> tuple[Ints, tuple[str, ...]]:
    """The triangles, without cavities where the grid does not see the walls around them; and what is to be said."""
    half: Floats = 0.5 * np.ptp(vertices, axis=0)
    said = []
    seen = _SEEN * _spacing(half, wall_of(vertices, triangles))
    share = _thin_share(vertices, triangles, seen)
    shell = orient("", vertices, triangles)[2]
    if share > _FEW and shell.max() > 0:
        parts = [triangles[shell == number] for number in range(int(shell.max()) + 1)]
        triangles = max(parts, key=lambda part: abs(enclosed_volume(vertices, part)))
        said.append(f"its walls are thinner than {1e3 * seen:.2g} mm, too thin to be felt: what is hollow was filled")
        seen = _SEEN * _spacing(half, wall_of(vertices, triangles))
        share = _thin_share(vertices, triangles, seen)
    if share > _FEW:
        said.append(
            f"beneath {100.0 * share:.2g} % of its surface it is thinner than {1e3 * seen:.2g} mm, and felt too thick, "
            "or in places not at all: make it thicker, cut off what touches nothing, or take `kind: box`"
        )
    return triangles, tuple(said)


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
        placed_by=mesh.origin if spec.place == "origin" else np.zeros(3),
        surface=ToolSurface(mesh.vertices, mesh.triangles),
        slack=0.1 * float(mesh.row[SPACING]),
        rounded=mesh.rounded,
        wall=mesh.wall,
        bends=mesh.bends,
        notes=mesh.notes,
    )


SHAPE = Shape(geometry, inline=MESH)
