"""Files of closed surfaces and solid meshes -> triangles, or cells that are taken as they are."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softseam_services.body.body import SAME, Floats, Ints
from softseam_services.body.cells_boundary import FACES, PLURAL, boundary, cell_volumes, flat_cells
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import CORNERS, Block, Cells, MeshFile
from softseam_services.body.formats.reading import read_mesh_file

_FACES = ("triangle", "quad")
_IGNORED = ("vertex", "line")
_CURVED = 0.01
"""of a cell's extent: a middle node farther than that from a middle of corners makes it curved"""


@dataclass(frozen=True)
class RawSurface:
    """Triangles as a file gives them, welded; orientation not yet checked."""

    vertices: Floats
    """(n, 3) in the file's units"""
    triangles: Ints
    """(T, 3)"""
    part: Cells
    """number of the name that each triangle belongs to (T,)"""
    names: tuple[str, ...]
    """of the file's parts, "" of what has none"""
    volume: float | None
    """sum of the cells' volumes where the file has solid ones, in the file's units cubed"""
    notes: tuple[str, ...]
    unit: float
    """metres in one of the file's units, as it states; 1 where it does not"""
    up: str
    """the axis that it says points up; z where it does not"""


@dataclass(frozen=True)
class RawHexahedra:
    """Hexahedra as a file gives them."""

    points: Floats
    """(n, 3) in the file's units"""
    cells: tuple[Cells, ...]
    """of 8, 20 or 27 nodes in VTK's order, block by block"""


@dataclass(frozen=True)
class RawTetrahedra:
    """Tetrahedra as a file gives them, none inside out or flat."""

    points: Floats
    """those that are used (n, 3), in the file's units"""
    cells: Ints
    """corners, the last above the first three (m, 4)"""
    middles: Ints
    """nodes on the edges, in the file's order, -1 of tetrahedra that have none (m, 6)"""
    triangles: Ints
    """their boundary, counter-clockwise from outside (T, 3)"""
    mirrored: bool
    """whether all had to be turned"""


def read_hexahedra(path: str, data: bytes, part: str | int | None = None) -> RawHexahedra:
    """Read hexahedra that are to be cells; raises MeshError where the file has other solids, or none."""
    file = _read(path, data, part)
    solids = [block for block in file.blocks if block.kind not in (*_FACES, *_IGNORED)]
    others = [block for block in solids if block.kind != "hexahedron" or block.cells.shape[1] not in (8, 20, 27)]
    if others or not solids:
        raise MeshError(
            f"{path}: has {_counted(others) or 'no solids'}, but `cells: own` takes hexahedra of 8, 20 or 27 nodes: "
            "say `cells: tetrahedra` for those of the file, mesh with hexahedra alone, or leave `cells` out, which "
            "embeds the surface in cells"
        )
    points, flat = _weld(file.points, np.concatenate([block.cells.ravel() for block in solids]))
    parts = np.split(flat, np.cumsum([block.cells.size for block in solids])[:-1])
    return RawHexahedra(
        points, tuple(each.reshape(block.cells.shape) for each, block in zip(parts, solids, strict=True))
    )


def read_tetrahedra(path: str, data: bytes, part: str | int | None = None, middles: bool = False) -> RawTetrahedra:
    """Read tetrahedra; raises MeshError where the file has other solids, or none.

    middles: with their middle nodes, of tetrahedra of ten; else corners alone, which are particles
    """
    file = _read(path, data, part)
    solids = [block for block in file.blocks if block.kind not in (*_FACES, *_IGNORED)]
    others = [block for block in solids if block.kind != "tetra"]
    if others or not solids:
        found = _counted(others) or "no solids"
        whose = "cells: tetrahedra takes" if middles else "a tet_mesh is made of"
        raise MeshError(f"{path}: has {found}, but {whose} tetrahedra; mesh the solid with them alone")
    if middles and any(block.cells.shape[1] not in (4, 10) for block in solids):
        raise MeshError(f"{path}: has tetrahedra of a higher order than two; export those of 4 or 10 nodes")
    cells = np.concatenate([_ten_nodes(block.cells, middles) for block in solids])
    points, flat = _weld(file.points, cells[cells >= 0])
    cells[cells >= 0] = flat
    used = np.unique(flat)
    cells = np.where(cells >= 0, np.searchsorted(used, cells), -1)
    points, tets = points[used], cells[:, :4]
    volume = cell_volumes(points, "tetra", tets)
    flat_ones = flat_cells(points, "tetra", tets, volume)
    if flat_ones.any():
        worst = int(np.argmin(np.abs(volume) / np.maximum(np.ptp(points[tets], axis=1).max(axis=1), 1e-300) ** 3))
        raise MeshError(
            f"{path}: {int(flat_ones.sum())} of {len(tets)} tetrahedra are degenerate, the worst is number {worst} "
            f"with volume {volume[worst]:.3g} in units of the file; remesh, or remove slivers"
        )
    mirrored = bool((volume < 0.0).all())
    if mirrored:
        tets, volume = tets[:, [0, 2, 1, 3]], -volume
    if (volume < 0.0).any():
        worst = int(np.argmin(volume))
        raise MeshError(
            f"{path}: {int((volume < 0.0).sum())} of {len(tets)} tetrahedra are inverted, the worst is number {worst} "
            f"with volume {volume[worst]:.3g} in units of the file; fix the order of their corners, or remesh"
        )
    outside = boundary(path, points, [Block("tetra", tets, np.zeros(len(tets), dtype=np.int64))])
    return RawTetrahedra(
        points, tets.astype(np.int32), cells[:, 4:].astype(np.int32), outside.triangles.astype(np.int32), mirrored
    )


def _ten_nodes(cells: Cells, middles: bool) -> Cells:
    """Corners and middle nodes, -1 for those that are not there or not asked for (m, 10)."""
    found = np.full((len(cells), 10), -1, dtype=np.int64)
    n_nodes = cells.shape[1] if middles else 4
    found[:, :n_nodes] = cells[:, :n_nodes]
    return found


def read_surface(path: str, data: bytes, part: str | int | None = None) -> RawSurface:
    """Read a surface, or the boundary of solid cells of any kinds, of the part of a name alone where one is given;
    raises MeshError."""
    file = _read(path, data, part)
    unknown = [block for block in file.blocks if block.kind not in CORNERS]
    if unknown:
        raise MeshError(
            f"{path}: cells of a kind that is not read ({_counted(unknown)}); export triangles, quads, tetrahedra, "
            "prisms, pyramids or hexahedra"
        )
    blocks = [block for block in file.blocks if block.kind not in _IGNORED]
    notes = _curved(file.points, blocks)
    blocks = [replace(block, cells=block.cells[:, : CORNERS[block.kind]]) for block in blocks]
    if not blocks:
        what = f"is a cloud of {len(file.points):,} points without faces" if len(file.points) else "holds no triangles"
        if len(file.blocks):
            what = f"has {_counted(file.blocks)}, but no faces"
        raise MeshError(f"{path}: {what}; make a closed surface or a solid mesh of it, and export that")
    vertices, blocks = _welded(file.points, blocks)
    solids = [block for block in blocks if block.kind in FACES]
    volume = None
    if solids:
        outside = boundary(path, vertices, solids)
        triangles, whose, volume = outside.triangles, outside.part, outside.volume
        notes += outside.notes
        if len(solids) < len(blocks):
            kinds = " and ".join(dict.fromkeys(PLURAL[block.kind] for block in solids))
            notes.append(f"the file has {kinds} and faces; the boundary of the {kinds} is the surface")
    else:
        halves = [each for block in blocks for each in _as_triangles(block)]
        triangles = np.concatenate([each.cells for each in halves])
        whose = np.concatenate([each.part for each in halves])
    used, triangles = np.unique(triangles, return_inverse=True)
    return RawSurface(
        vertices=vertices[used],
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        part=whose,
        names=file.names,
        volume=volume,
        notes=tuple(notes),
        unit=file.unit,
        up=file.up,
    )


def _read(path: str, data: bytes, part: str | int | None) -> MeshFile:
    """A file, or its part of a name; raises MeshError where it has none, or points that are no places."""
    with np.errstate(invalid="ignore", over="ignore"):  # polygons are split before it is known that they are places
        file = read_mesh_file(path, data)
    used = [block.cells.ravel() for block in file.blocks if block.kind not in _IGNORED]
    corners = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=np.int64)
    wrong = ~np.isfinite(file.points[corners])
    if wrong.any():
        first = 1 + corners[wrong.any(axis=1)][0]
        raise MeshError(
            f"{path}: {wrong.sum()} coordinates are not finite, the first of point {first}; export it again"
        )
    if part is None:
        return file
    if isinstance(part, int):
        return _piece(path, file, part)
    if part not in file.names:
        raise MeshError(f"{path}: has no part called {part!r}; {named_parts(file.names)}")
    number = file.names.index(part)
    return _kept(file, [each.part == number for each in file.blocks])


def _piece(path: str, file: MeshFile, number: int) -> MeshFile:
    """Of solid cells those that hang together, by size the piece of a number from 1; a file without any as it is."""
    solids = [block for block in file.blocks if block.kind in FACES and len(block.cells)]
    if not solids:
        return file
    points, solids = _welded(file.points, solids)
    first = np.concatenate([np.repeat(block.cells[:, 0], block.cells.shape[1]) for block in solids])
    nodes = np.concatenate([block.cells.ravel() for block in solids])
    links = coo_array((np.ones(len(nodes)), (first, nodes)), shape=(len(points), len(points)))
    piece = connected_components(links, directed=False)[1]
    volumes = np.zeros(piece.max() + 1)
    for block in solids:
        np.add.at(volumes, piece[block.cells[:, 0]], np.abs(cell_volumes(points, block.kind, block.cells)))
    order = np.argsort(-volumes, kind="stable")[: np.count_nonzero(volumes)]
    if number > len(order):
        raise MeshError(f"{path}: has no body {number}: there are {len(order)}, counted by size")
    solid = replace(file, points=points, blocks=tuple(solids))
    return _kept(solid, [piece[block.cells[:, 0]] == order[number - 1] for block in solids])


def _kept(file: MeshFile, masks: Sequence[NDArray[np.bool_]]) -> MeshFile:
    """The cells of a file that masks select, block by block."""
    found = [
        Block(block.kind, block.cells[mask], block.part[mask]) for block, mask in zip(file.blocks, masks, strict=True)
    ]
    return replace(file, blocks=tuple(block for block in found if len(block.cells)))


def named_parts(names: Sequence[str], most: int = 8) -> str:
    """What parts a file has, in words."""
    called = [name for name in names if name]
    if not called:
        return "it names none"
    return f"it has {', '.join(called[:most])}" + (f" and {len(called) - most} more" if len(called) > most else "")


def _counted(blocks: Sequence[Block]) -> str:
    counts: dict[str, int] = {}
    for block in blocks:
        counts[block.kind] = counts.get(block.kind, 0) + len(block.cells)
    return ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))


def _curved(points: Floats, blocks: Sequence[Block]) -> list[str]:
    """That cells have middle nodes beside the middles of their corners, which are not seen."""
    n_curved = 0
    for block in blocks:
        corners = CORNERS[block.kind]
        if block.cells.shape[1] > corners and len(block.cells):
            x = points[block.cells]
            ends = np.array(list(combinations(range(corners), 2)))
            middles = x[:, ends].mean(axis=2)
            away = np.linalg.norm(x[:, corners:, None] - middles[:, None], axis=3).min(axis=2).max(axis=1)
            n_curved += int((away > _CURVED * np.ptp(x, axis=1).max(axis=1)).sum())
    return (
        [f"{n_curved} cells are curved by middle nodes, and count as straight between their corners"]
        if n_curved
        else []
    )


def _as_triangles(block: Block) -> list[Block]:
    if block.kind == "triangle":
        return [block]
    return [Block("triangle", block.cells[:, half], block.part) for half in ([0, 1, 2], [0, 2, 3])]


def _welded(points: Floats, blocks: Sequence[Block]) -> tuple[Floats, list[Block]]:
    """Points that coincide merged, and blocks of what is left."""
    points, flat = _weld(points, np.concatenate([block.cells.ravel() for block in blocks]))
    cells = np.split(flat, np.cumsum([block.cells.size for block in blocks])[:-1])
    return points, [
        replace(block, cells=each.reshape(block.cells.shape)) for each, block in zip(cells, blocks, strict=True)
    ]


def _weld(vertices: Floats, cells: Cells) -> tuple[Floats, Cells]:
    """Merge points that coincide to 1e-9 of the extent (STL repeats each corner); cells follow."""
    extent = float(np.ptp(vertices, axis=0).max()) or 1.0
    keys = np.rint((vertices - vertices.min(axis=0)) / (SAME * extent)).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[number.ravel()[cells]]
