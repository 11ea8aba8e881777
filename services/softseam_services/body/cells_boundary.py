"""Solid cells of any kinds -> the triangles of their boundary, outward.

A face that two cells have is inside. Cells may be numbered in either sense: each is taken with a positive volume, by
V = sum over its faces of a . (b x c)/6 about its first corner, quads halved along both diagonals and averaged.    (1)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import SAME, Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import CORNERS, Block, Cells

FACES: dict[str, list[list[int]]] = {
    "tetra": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    "pyramid": [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 3, 2, 1]],
    "wedge": [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "hexahedron": [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]],
}
"""corners of the faces of each kind of solid, outward where it is in VTK's order"""
PLURAL = {"tetra": "tetrahedra", "pyramid": "pyramids", "wedge": "prisms", "hexahedron": "hexahedra"}


@dataclass(frozen=True)
class Boundary:
    """Faces that one cell has alone."""

    triangles: Cells
    """outward (T, 3)"""
    part: Cells
    """of each (T,), its cell's"""
    volume: float
    """of all cells, up to outer quads as their halves have it"""
    notes: tuple[str, ...]


def cell_volumes(points: Floats, kind: str, cells: Cells) -> Floats:
    """Signed volumes (m,) by eq. (1), negative where a cell is numbered in the other sense."""
    volume = np.zeros(len(cells))
    x = points[cells[:, : CORNERS[kind]]]
    x = x - x[:, :1]
    for face in FACES[kind]:
        corners = x[:, face]
        splits = [[0, 1, 2]] if len(face) == 3 else [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]
        share = 1.0 if len(face) == 3 else 0.5
        for a, b, c in splits:
            volume += share / 6.0 * np.einsum("mi,mi->m", corners[:, a], np.cross(corners[:, b], corners[:, c]))
    return volume


def flat_cells(points: Floats, kind: str, cells: Cells, volume: Floats) -> NDArray[np.bool_]:
    """Which cells have next to no volume (m,)."""
    size = np.ptp(points[cells[:, : CORNERS[kind]]], axis=1).max(axis=1)
    flat: NDArray[np.bool_] = np.abs(volume) < SAME * np.maximum(size, 1e-300) ** 3
    return flat


def boundary(path: str, points: Floats, blocks: Sequence[Block]) -> Boundary:
    """The surface of solid cells; raises MeshError where they overlap, or are no solid."""
    notes: list[str] = []
    total = 0.0
    faces: dict[int, list[Cells]] = {3: [], 4: []}
    parts: dict[int, list[Cells]] = {3: [], 4: []}
    sound: dict[int, list[NDArray[np.bool_]]] = {3: [], 4: []}
    for block in _without_doubles(blocks, notes):
        kind, cells = block.kind, block.cells[:, : CORNERS[block.kind]]
        volume = cell_volumes(points, kind, cells)
        flat = flat_cells(points, kind, cells, volume)
        total += float(np.abs(volume).sum())
        if flat.any():
            notes.append(f"{int(flat.sum())} of {len(cells)} {PLURAL[kind]} are flat, and count for nothing")
        turned = volume < 0.0
        if 0 < int((turned & ~flat).sum()) < int((~flat).sum()):
            notes.append(
                f"{int((turned & ~flat).sum())} of {len(cells)} {PLURAL[kind]} were numbered in the other sense, and "
                "were turned"
            )
        for corners in (3, 4):
            mine = [face for face in FACES[kind] if len(face) == corners]
            found = cells[:, np.array(mine, dtype=np.int64).reshape(-1, corners)]
            found = np.where(turned[:, None, None], found[:, :, ::-1], found)
            faces[corners].append(found.reshape(-1, corners))
            parts[corners].append(np.repeat(block.part, len(mine)))
            sound[corners].append(np.repeat(~flat, len(mine)))
    outer: dict[int, Cells] = {}
    part: dict[int, Cells] = {}
    for corners in (3, 4):
        all_faces = np.concatenate([np.zeros((0, corners), dtype=np.int64), *faces[corners]])
        kept = _outer(path, all_faces, np.concatenate([np.zeros(0, dtype=np.bool_), *sound[corners]]))
        outer[corners], part[corners] = (
            all_faces[kept],
            np.concatenate([np.zeros(0, dtype=np.int64), *parts[corners]])[kept],
        )
    quads = outer[4]
    # Tetrahedra may meet a hexahedron without a pyramid between: its face is halved as theirs are.
    second = _among(quads[:, [0, 1, 3]], outer[3]) | _among(quads[:, [1, 2, 3]], outer[3])
    quads = np.where(second[:, None], np.roll(quads, -1, axis=1), quads)
    halves = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    total -= float(np.einsum("fi,fi->", d - a, np.cross(b - a, c - a))) / 12.0  # halves along one diagonal
    return Boundary(
        triangles=np.concatenate([outer[3], halves]),
        part=np.concatenate([part[3], part[4], part[4]]),
        volume=total,
        notes=tuple(notes),
    )


def _among(rows: Cells, of: Cells) -> NDArray[np.bool_]:
    """Which rows (n, 3) have the same numbers as one of others (m, 3), in any order (n,)."""
    _, number = np.unique(np.sort(np.concatenate([of, rows]), axis=1), axis=0, return_inverse=True)
    return np.isin(number.ravel()[len(of) :], number.ravel()[: len(of)])


def _without_doubles(blocks: Sequence[Block], notes: list[str]) -> list[Block]:
    """Blocks without cells that have the same corners as an earlier one of their block."""
    kept = []
    for block in blocks:
        corners = np.sort(block.cells[:, : CORNERS[block.kind]], axis=1)
        _, first = np.unique(corners, axis=0, return_index=True)
        if len(first) < len(corners):
            notes.append(f"{len(corners) - len(first)} {PLURAL[block.kind]} that were there twice were left out")
            first = np.sort(first)
            block = Block(block.kind, block.cells[first], block.part[first])
        kept.append(block)
    return kept


def _outer(path: str, faces: Cells, sound: NDArray[np.bool_]) -> Cells:
    """Numbers of the faces (F, 3 or 4) that are there once, in order; sound (F,) whether their cell is not flat.
    Raises MeshError where two cells lie on the same side of a face, or three meet at one."""
    _, first, number, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    if (count > 2).any():
        raise MeshError(
            f"{path}: {int((count > 2).sum())} faces belong to three or more cells, "
            f"the worst is {faces[first[int(np.argmax(count))]].tolist()}; remove cells that overlap, or remesh"
        )
    pairs = np.argsort(number.ravel(), kind="stable")[np.repeat(count, count) == 2].reshape(-1, 2)
    one, two = faces[pairs[:, 0]], faces[pairs[:, 1]]
    same = _sense(one) == _sense(two)
    folded = same & sound[pairs].all(axis=1)
    if folded.any():
        raise MeshError(
            f"{path}: {int(folded.sum())} pairs of cells lie on the same side of the face that they share, the first "
            f"at points {one[int(np.argmax(folded))].tolist()}: cells are inverted or overlap; remesh"
        )
    return np.sort(first[count == 1])


def _sense(faces: Cells) -> NDArray[np.bool_]:
    """Whether, from the least corner on, the lesser of its neighbours comes first (F,)."""
    n = faces.shape[1]
    rows, at = np.arange(len(faces)), np.argmin(faces, axis=1)
    sense: NDArray[np.bool_] = faces[rows, (at + 1) % n] < faces[rows, (at - 1) % n]
    return sense
