"""Cells of VTK, by the numbers of their types -> blocks of the kinds that are read."""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.formats.mesh_file import CORNERS, Block, Cells, MeshFile, block, polygon_file
from softseam_services.body.formats.polygons import strip_triangles

_KINDS = {1: "vertex", 2: "vertex", 3: "line", 4: "line", 5: "triangle", 6: "strip", 7: "polygon", 8: "pixel",
          9: "quad", 10: "tetra", 11: "voxel", 12: "hexahedron", 13: "wedge", 14: "pyramid", 21: "line", 22: "triangle",
          23: "quad", 24: "tetra", 25: "hexahedron", 26: "wedge", 27: "pyramid", 28: "quad", 29: "hexahedron",
          30: "quad", 31: "wedge", 32: "wedge", 33: "hexahedron", 34: "triangle", 35: "line", 42: "polyhedron",
          68: "line", 69: "triangle", 70: "quad", 71: "tetra", 72: "hexahedron", 73: "wedge", 74: "pyramid",
          75: "line",
          76: "triangle", 77: "quad", 78: "tetra", 79: "hexahedron", 80: "wedge", 81: "pyramid"}  # fmt: skip
_IN_ORDER = {"pixel": ("quad", [0, 1, 3, 2]), "voxel": ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6])}


def vtk_cells(points: Floats, types: Cells, nodes: Cells, sizes: Cells) -> MeshFile:
    """The mesh of cells of types (m,), sizes (m,) how many of the nodes (k,) each has. Raises ValueError."""
    if len(nodes) and not (0 <= nodes.min() and nodes.max() < len(points)):
        raise ValueError(f"a cell has point {nodes.max()}, or one below 0, of {len(points)}")
    if len(types) != len(sizes) or sizes.sum() != len(nodes):
        raise ValueError(f"{len(types)} types and {len(nodes)} nodes for {len(sizes)} cells")
    start = np.cumsum(sizes) - sizes
    blocks: list[Block] = []
    polygons, strips = np.zeros(len(sizes), dtype=np.bool_), np.zeros(len(sizes), dtype=np.bool_)
    for number in np.unique(types).tolist():
        kind = _KINDS.get(number, f"VTK type {number}")
        mine = types == number
        if kind == "polygon":
            polygons |= mine
            continue
        if kind == "strip":
            strips |= mine
            continue
        for size in np.unique(sizes[mine]).tolist():
            if kind in CORNERS and size < CORNERS[kind]:
                raise ValueError(f"a {kind} has {size} nodes")
            whose = np.flatnonzero(mine & (sizes == size))
            cells = nodes[start[whose][:, None] + np.arange(size)]
            name, order = _IN_ORDER.get(kind, (kind, list(range(size))))
            blocks.append(block(name, cells[:, order]))
    if strips.any():
        flat = np.concatenate([nodes[at : at + size] for at, size in zip(start[strips], sizes[strips], strict=True)])
        blocks.append(block("triangle", strip_triangles(flat, np.cumsum(sizes[strips])[:-1])))
    if polygons.any():
        flat = nodes[np.repeat(polygons, sizes)]
        blocks += polygon_file(points, flat, sizes[polygons]).blocks
    return MeshFile(points, tuple(blocks))
