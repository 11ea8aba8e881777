"""Files of closed surfaces and tetrahedral meshes, through meshio -> triangles in metres."""

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

Cells = NDArray[np.int64]

_VOLUME_CELLS = {"tetra": 4, "tetra10": 4}
_FACE_CELLS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
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


def read_surface(path: str, data: bytes) -> RawSurface:
    """Read a surface, or the boundary of a tetrahedral mesh; raises MeshError."""
    mesh = _read(path, data)
    vertices = np.asarray(mesh.points, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
        raise MeshError(f"{path}: points are not three-dimensional; export a solid, not a drawing")
    if not np.isfinite(vertices).all():
        raise MeshError(f"{path}: {int((~np.isfinite(vertices)).sum())} coordinates are not finite; export it again")
    tets: list[Cells] = []
    faces: list[Cells] = []
    unknown: dict[str, int] = {}
    for block in mesh.cells:
        cells = np.asarray(block.data, dtype=np.int64)
        if block.type in _VOLUME_CELLS:
            tets.append(cells[:, :4])
        elif block.type in _FACE_CELLS:
            corners = _FACE_CELLS[block.type]
            faces.append(cells[:, :3])
            if corners == 4:
                faces.append(cells[:, [0, 2, 3]])
        elif block.type not in _IGNORED_CELLS:
            unknown[block.type] = unknown.get(block.type, 0) + len(cells)
    if unknown:
        found = ", ".join(f"{count} {kind}" for kind, count in sorted(unknown.items()))
        raise MeshError(f"{path}: cells of a kind that is not read ({found}); export triangles, quads or tetrahedra")
    notes: list[str] = []
    volume = None
    if tets:
        vertices, solid = _weld(vertices, np.concatenate(tets))
        triangles, volume = _tet_boundary(path, vertices, solid)
        if faces:
            notes.append("the file has tetrahedra and faces; the boundary of the tetrahedra is the surface")
    elif faces:
        vertices, triangles = _weld(vertices, np.concatenate(faces))
    else:
        raise MeshError(f"{path}: holds no triangles, quads or tetrahedra; export a closed surface or a solid mesh")
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
