"""Tetrahedra of TetGen (.node and .ele, one after the other) and of .tet files, as robots' benchmarks and Quartet write
them."""

import re

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Block, Cells, MeshFile, block
from softseam_services.body.formats.text import decoded, numbers
from softseam_services.body.tetrahedron import ENDS


def read_tetgen(path: str, data: bytes) -> MeshFile:
    """Nodes, then elements with their regions as parts; raises MeshError where they are not whole."""
    try:
        values = numbers(re.sub(r"#[^\n]*", "", decoded(data)))
        n_points, dimension, n_attributes, n_markers = values[:4].astype(int).tolist()
        if dimension != 3:
            raise ValueError(f"its nodes have {dimension} dimensions")
        nodes, rest = _rows(values[4:], n_points, 4 + n_attributes + n_markers)
        if not len(rest):
            raise MeshError(f"{path}: has nodes alone: its .ele lies beside its .node, under the same name")
        n_cells, n_corners, n_regions = rest[:3].astype(int).tolist()
        rows, _ = _rows(rest[3:], n_cells, 1 + n_corners + n_regions)
        if n_corners not in (4, 10):
            raise ValueError(f"its elements have {n_corners} corners")
        cells = rows[:, 1 : 1 + n_corners].astype(np.int64) - int(nodes[0, 0])
        cells = _checked(cells, n_points)
        regions = rows[:, -1].astype(np.int64) if n_regions else np.zeros(n_cells, dtype=np.int64)
        called, part = np.unique(regions, return_inverse=True)
        names = tuple(f"region {each}" if n_regions else "" for each in called.tolist())
        points = nodes[:, 1:4]
        return MeshFile(points, (Block("tetra", _in_order(points, cells), part.ravel()),), names)
    except MeshError:
        raise
    except (ValueError, IndexError) as error:
        raise MeshError(f"{path}: is no whole TetGen file ({error}): save it anew, or as VTK or Gmsh") from None


def read_tet(path: str, data: bytes) -> MeshFile:
    """Lines of `v x y z` and `t a b c d`, or `tet`, two counts, and so many rows of each; corners count from 0. Raises
    MeshError where it is not whole."""
    lines = [words for line in decoded(data).splitlines() if (words := line.partition("#")[0].split())]
    try:
        if lines and lines[0][0] == "tet":
            n_points, n_cells = int(lines[0][1]), int(lines[0][2])
            values = numbers(" ".join(word for words in lines[1:] for word in words))
            points, rest = _rows(values, n_points, 3)
            cells, _ = _rows(rest, n_cells, 4)
        else:
            points, cells = (
                numbers(" ".join(word for words in lines if words[0] == key for word in words[1 : 1 + width])).reshape(
                    -1, width
                )
                for key, width in (("v", 3), ("t", 4))
            )
        if not len(cells):
            raise ValueError("it has no tetrahedra")
        return MeshFile(points, (block("tetra", _checked(cells.astype(np.int64), len(points))),))
    except (ValueError, IndexError) as error:
        raise MeshError(f"{path}: is no whole .tet file ({error}): save it anew, or as VTK or Gmsh") from None


def _rows(values: Floats, count: int, width: int) -> tuple[Floats, Floats]:
    """So many rows (count, width), and the numbers after them. Raises ValueError where there are fewer."""
    if len(values) < count * width:
        raise ValueError(f"{len(values):,} numbers in place of {count * width:,}")
    return values[: count * width].reshape(count, width), values[count * width :]


def _checked(cells: Cells, n_points: int) -> Cells:
    """The cells. Raises ValueError where one has a point that is not there."""
    if len(cells) and not 0 <= cells.min() <= cells.max() < n_points:
        raise ValueError(f"a tetrahedron has point {cells.max()}, or one below the first, of {n_points:,}")
    return cells


def _in_order(points: Floats, cells: Cells) -> Cells:
    """Tetrahedra of ten nodes with their middle ones in VTK's order: each stands with its nearest edge."""
    if cells.shape[1] == 4 or not len(cells):
        return cells
    middles = points[cells[:, ENDS]].mean(axis=2)
    away = np.linalg.norm(points[cells[:, 4:]][:, :, None] - middles[:, None], axis=3).mean(axis=0)
    order = np.argmin(away, axis=0)
    if len(np.unique(order)) != len(order):
        raise ValueError("its middle nodes are not on the edges")
    return np.concatenate([cells[:, :4], cells[:, 4:][:, order]], axis=1)
