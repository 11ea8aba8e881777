"""What a mesh file holds, whatever its format: points, cells by kind, and the names that it gives parts."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.body.formats.polygons import triangles_of

if TYPE_CHECKING:
    import meshio

Cells = NDArray[np.int64]

CORNERS = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
"""of each kind that is read; nodes at the middles of edges, faces and cells follow them"""


@dataclass(frozen=True)
class Block:
    """Cells of one kind and of one number of nodes."""

    kind: str
    """a key of CORNERS, or what else the file calls it"""
    cells: Cells
    """nodes, corners first, in VTK's order (m, k)"""
    part: Cells
    """number of the name that each belongs to (m,)"""


@dataclass(frozen=True)
class MeshFile:
    """Points and cells as the file gives them."""

    points: Floats
    """(n, 3) in the file's units"""
    blocks: tuple[Block, ...]
    names: tuple[str, ...] = ("",)
    """of parts: objects and groups of OBJ, solids of STL, physical groups of Gmsh, nodes of scenes; "" where none is"""
    unit: float = 1.0
    """metres in one of the file's units, as it states; 1 where it does not"""
    up: str = "z"
    """the axis that it says points up; z where it does not"""


def block(kind: str, cells: Cells, part: Cells | None = None) -> Block:
    """Cells that belong to the first name, unless another is named."""
    return Block(kind, cells, np.zeros(len(cells), dtype=np.int64) if part is None else part)


def polygon_file(
    points: Floats, corners: Cells, sizes: Cells, part: Cells | None = None, names: Sequence[str] = ("",)
) -> MeshFile:
    """All polygons as triangles: sizes (m,) how many of the corners (k,) each has, part (m,) its name's number."""
    triangles, whose = triangles_of(points, corners, sizes)
    numbers = np.zeros(len(sizes), dtype=np.int64) if part is None else part
    blocks = (Block("triangle", triangles, numbers[whose]),) if len(triangles) else ()
    return MeshFile(points, blocks, tuple(names))


def from_meshio(mesh: meshio.Mesh) -> MeshFile:
    """What meshio read; physical groups are parts."""
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.pad(points, [(0, 0), (0, 1)])
    groups = mesh.cell_data.get("gmsh:physical")
    called = {int(tag): name for name, (tag, _) in mesh.field_data.items()} if groups else {}
    tags = np.unique(np.concatenate(groups)) if groups else np.zeros(1, dtype=np.int64)
    blocks = []
    for at, each in enumerate(mesh.cells):
        kind = re.sub(r"\d+$", "", each.type.lower().replace("vtk_lagrange_", ""))
        cells = np.asarray(each.data, dtype=np.int64).reshape(len(each.data), -1)
        part = np.searchsorted(tags, groups[at]) if groups else np.zeros(len(cells), dtype=np.int64)
        blocks.append(Block(kind, cells, part))
    return MeshFile(points, tuple(blocks), tuple(called.get(int(tag), f"{tag}" if tag else "") for tag in tags))
