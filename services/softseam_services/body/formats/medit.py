"""MEDIT's .mesh in text, as TetGen, Mmg and FreeFEM write it: each section's name, a count, rows that end in a
reference. References that differ are parts.
"""

import re

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Block, Cells, MeshFile
from softseam_services.body.formats.text import decoded, numbers

_KINDS = {"edges": ("line", 2), "triangles": ("triangle", 3), "quadrilaterals": ("quad", 4), "tetrahedra": ("tetra", 4),
          "pyramids": ("pyramid", 5), "prisms": ("wedge", 6), "hexahedra": ("hexahedron", 8),
          "hexaedra": ("hexahedron", 8)}  # fmt: skip
_SECTION = re.compile(r"\b([A-Za-z]{3,})\b([^A-Za-z]*(?:[eE][-+]?\d[^A-Za-z]*)*)")


def read_medit(path: str, data: bytes) -> MeshFile:
    """Vertices and cells; raises MeshError where the file is not whole."""
    text = re.sub(r"#[^\n]*", "", decoded(data))
    points: Floats = np.zeros((0, 3))
    dimension = 3
    found: list[tuple[str, Cells]] = []
    try:
        for match in _SECTION.finditer(text):
            name = match[1].lower()
            if name == "dimension":
                dimension = int(match[2].split()[0])
            elif name == "vertices":
                points = np.pad(_rows(match, dimension + 1)[:, :-1], [(0, 0), (0, 3 - dimension)])
            elif name in _KINDS:
                kind, corners = _KINDS[name]
                found.append((kind, _rows(match, corners + 1).astype(np.int64)))
        references = np.unique(np.concatenate([np.zeros(1, dtype=np.int64), *(rows[:, -1] for _, rows in found)]))
        for kind, rows in found:
            if len(rows) and not 1 <= rows[:, :-1].min() <= rows[:, :-1].max() <= len(points):
                raise ValueError(f"a {kind} has vertex {rows[:, :-1].max()}, or one below 1, of {len(points):,}")
    except (ValueError, IndexError) as error:
        raise MeshError(f"{path}: is no whole MEDIT file ({error}): save it anew, or as VTK or Gmsh") from None
    blocks = [Block(kind, rows[:, :-1] - 1, np.searchsorted(references, rows[:, -1])) for kind, rows in found]
    return MeshFile(points, tuple(blocks), tuple(f"reference {each}" if each else "" for each in references))


def _rows(match: re.Match[str], width: int) -> Floats:
    """Rows of a section after their count (m, width). Raises ValueError where there are fewer."""
    values = numbers(match[2])
    count = int(values[0])
    if len(values) < 1 + count * width:
        raise ValueError(f"{match[1]} has {len(values) - 1:,} numbers in place of {count * width:,}")
    return values[1 : 1 + count * width].reshape(count, width)
