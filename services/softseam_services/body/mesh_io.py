"""Files of closed surfaces and solid meshes -> triangles, or hexahedra that are cells themselves.

meshio reads them, but for those of `mesh_formats`.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import meshio
import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.body.errors import MeshError
from softseam_services.body.mesh_formats import read_known

Cells = NDArray[np.int64]

_VOLUME_CELLS = {"tetra": 4, "tetra10": 4}
_FACE_CELLS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
_HEXAHEDRA = {"hexahedron": 8, "hexahedron20": 20, "hexahedron27": 27}
_HEX_FACES = np.array([[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]])
_IGNORED_CELLS = {"vertex", "line", "line3"}
_TET_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
_WELD = 1e-9
_FLAT_TET = 1e-9


@dataclass(frozen=True)
class RawSurface:
    """Triangles as a file gives them, welded; orientation not yet checked."""

    vertices: Floats
    """(n, 3) in the file's units"""
    triangles: Ints
    """(T, 3)"""
    tet_volume: float | None
    """sum of the tetrahedra's volumes where the file has them, in the file's units cubed"""
    notes: tuple[str, ...]


@dataclass(frozen=True)
class RawHexahedra:
    """Hexahedra as a file gives them."""

    points: Floats
    """(n, 3) in the file's units"""
    cells: tuple[Cells, ...]
    """of 8, 20 or 27 nodes in VTK's order, block by block"""


def read_hexahedra(path: str, data: bytes) -> RawHexahedra:
    """Read hexahedra that are to be cells; raises MeshError where the file has other solids, or none."""
    mesh = _read(path, data)
    points = _points(path, mesh)
    blocks: list[Cells] = []
    others: dict[str, int] = {}
    for block in mesh.cells:
        cells = np.asarray(block.data, dtype=np.int64)
        if block.type in _HEXAHEDRA:
            blocks.append(cells)
        elif block.type not in _FACE_CELLS and block.type not in _IGNORED_CELLS:
            others[block.type] = others.get(block.type, 0) + len(cells)
    if others or not blocks:
        found = ", ".join(f"{count} {kind}" for kind, count in sorted(others.items())) or "no solids"
        raise MeshError(
            f"{path}: has {found}, but cells are hexahedra of 8, 20 or 27 nodes: every element here lives on the 27 "
            "nodes of one; mesh with hexahedra alone, or leave out `cells: own`, which embeds the surface in cells"
        )
    points, flat = _weld(points, np.concatenate([cells.ravel() for cells in blocks]))
    parts = np.split(flat, np.cumsum([cells.size for cells in blocks])[:-1])
    return RawHexahedra(points, tuple(part.reshape(cells.shape) for part, cells in zip(parts, blocks, strict=True)))


@dataclass(frozen=True)
class RawTetrahedra:
    """Tetrahedra as a file gives them, none inside out or flat."""

    points: Floats
    """those that are corners (n, 3), in the file's units"""
    cells: Ints
    """corners, the last above the first three (m, 4)"""
    triangles: Ints
    """their boundary, counter-clockwise from outside (T, 3)"""


def read_tetrahedra(path: str, data: bytes) -> RawTetrahedra:
    """Read tetrahedra whose corners are to be particles; raises MeshError where the file has other solids, or none."""
    mesh = _read(path, data)
    points = _points(path, mesh)
    solids = {block.type for block in mesh.cells} - _FACE_CELLS.keys() - _IGNORED_CELLS
    if not solids or solids - _VOLUME_CELLS.keys():
        found = ", ".join(sorted(solids - _VOLUME_CELLS.keys())) or "no solids"
        raise MeshError(f"{path}: has {found}, but a tet_mesh is made of tetrahedra; mesh the solid with them alone")
    tets = [np.asarray(block.data, dtype=np.int64)[:, :4] for block in mesh.cells if block.type in _VOLUME_CELLS]
    points, solid = _weld(points, np.concatenate(tets))
    used, solid = np.unique(solid, return_inverse=True)
    points, solid = points[used], solid.reshape(-1, 4)
    triangles, _ = _tet_boundary(path, points, solid)
    spans = points[solid[:, 1:]] - points[solid[:, :1]]
    if np.linalg.det(spans[:1])[0] < 0.0:  # all are, or `_tet_boundary` would have refused them
        solid = solid[:, [0, 2, 1, 3]]
    return RawTetrahedra(points, solid.astype(np.int32), triangles.astype(np.int32))


def _points(path: str, mesh: meshio.Mesh) -> Floats:
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise MeshError(f"{path}: points are not three-dimensional; export a solid, not a drawing")
    if not np.isfinite(points).all():
        raise MeshError(f"{path}: {int((~np.isfinite(points)).sum())} coordinates are not finite; export it again")
    return points


def read_surface(path: str, data: bytes) -> RawSurface:
    """Read a surface, or the boundary of a tetrahedral or hexahedral mesh; raises MeshError."""
    mesh = _read(path, data)
    vertices = _points(path, mesh)
    hexahedra: list[Cells] = []
    tets: list[Cells] = []
    faces: list[Cells] = []
    unknown: dict[str, int] = {}
    for block in mesh.cells:
        cells = np.asarray(block.data, dtype=np.int64)
        if block.type in _VOLUME_CELLS:
            tets.append(cells[:, :4])
        elif block.type in _HEXAHEDRA:
            hexahedra.append(cells[:, :8])
        elif block.type in _FACE_CELLS:
            corners = _FACE_CELLS[block.type]
            faces.append(cells[:, :3])
            if corners == 4:
                faces.append(cells[:, [0, 2, 3]])
        elif block.type not in _IGNORED_CELLS:
            unknown[block.type] = unknown.get(block.type, 0) + len(cells)
    if tets and hexahedra:
        unknown["hexahedron"] = sum(map(len, hexahedra))
    if unknown:
        found = ", ".join(f"{count} {kind}" for kind, count in sorted(unknown.items()))
        raise MeshError(
            f"{path}: cells of a kind that is not read ({found}); export triangles, quads, tetrahedra or hexahedra"
        )
    notes: list[str] = []
    volume = None
    if tets:
        vertices, solid = _weld(vertices, np.concatenate(tets))
        triangles, volume = _tet_boundary(path, vertices, solid)
        if faces:
            notes.append("the file has tetrahedra and faces; the boundary of the tetrahedra is the surface")
    elif hexahedra:
        vertices, solid = _weld(vertices, np.concatenate(hexahedra))
        triangles = _hexahedral_boundary(solid)
    elif faces:
        vertices, triangles = _weld(vertices, np.concatenate(faces))
    else:
        raise MeshError(
            f"{path}: holds no triangles, quads, tetrahedra or hexahedra; export a closed surface or a solid mesh"
        )
    used, triangles = np.unique(triangles, return_inverse=True)
    return RawSurface(
        vertices=vertices[used],
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        tet_volume=volume,
        notes=tuple(notes),
    )


def _read(path: str, data: bytes) -> meshio.Mesh:
    suffix = PurePosixPath(path.replace("\\", "/")).suffix.lower()
    if not data:
        raise MeshError(f"{path}: the file is empty")
    if (mesh := read_known(path, suffix, data)) is not None:
        return mesh
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"mesh{suffix}"
        file.write_bytes(data)
        try:
            # meshio's readers fail on malformed input with whatever their parsing trips over, SystemExit included, and
            # print as they go; all of it means the same to a user.
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                return meshio.read(file)
        except (Exception, SystemExit) as error:
            reason = str(error).replace(str(file), path).splitlines()
            raise MeshError(
                f"{path}: cannot be read as {suffix or 'a mesh'} ({reason[0] if reason else type(error).__name__}); "
                "use VTK, VTU, Gmsh, STL, OBJ or PLY"
            ) from error


def _weld(vertices: Floats, cells: Cells) -> tuple[Floats, Cells]:
    """Merge points that coincide to 1e-9 of the extent (STL repeats each corner); cells follow."""
    extent = float(np.ptp(vertices, axis=0).max()) or 1.0
    keys = np.rint((vertices - vertices.min(axis=0)) / (_WELD * extent)).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[number.ravel()[cells]]


def _hexahedral_boundary(hexahedra: Cells) -> Cells:
    """Halves of the faces that belong to one hexahedron, outward where its corners are in VTK's order."""
    faces = hexahedra[:, _HEX_FACES].reshape(-1, 4)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = faces[np.sort(first[count == 1])]
    return np.concatenate([outer[:, [0, 1, 2]], outer[:, [0, 2, 3]]])


def _tet_boundary(path: str, vertices: Floats, tets: Cells) -> tuple[Cells, float]:
    """Faces that belong to one tetrahedron, outward, and the mesh's volume."""
    corners = vertices[tets]
    spans = corners[:, 1:] - corners[:, :1]
    volume = np.linalg.det(spans) / 6.0
    size = np.ptp(corners, axis=1).max(axis=1)
    flat = np.abs(volume) < _FLAT_TET * np.maximum(size, 1e-300) ** 3
    if flat.any():
        worst = int(np.argmin(np.abs(volume) / np.maximum(size, 1e-300) ** 3))
        raise MeshError(
            f"{path}: {int(flat.sum())} of {len(tets)} tetrahedra are degenerate, the worst is number {worst} with "
            f"volume {volume[worst]:.3g} in units of the file; remesh, or remove slivers"
        )
    if (volume < 0.0).all():
        tets, volume = tets[:, [0, 2, 1, 3]], -volume
    if (volume < 0.0).any():
        worst = int(np.argmin(volume))
        raise MeshError(
            f"{path}: {int((volume < 0.0).sum())} of {len(tets)} tetrahedra are inverted, the worst is number {worst} "
            f"with volume {volume[worst]:.3g} in units of the file; fix the order of their corners, or remesh"
        )
    faces = tets[:, _TET_FACES].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    if (count > 2).any():
        raise MeshError(
            f"{path}: {int((count > 2).sum())} faces belong to three or more tetrahedra, "
            f"the worst is {faces[first[int(np.argmax(count))]].tolist()}; remove duplicate tetrahedra"
        )
    return faces[np.sort(first[count == 1])], float(volume.sum())
