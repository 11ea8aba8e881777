"""Mesh files that meshio does not read: OBJ as modellers write it, Gmsh 1, VTK's POLYDATA, STL in capital letters.

OBJ (Wavefront, appendix B1): a corner of `f` is v, v/vt, v//vn or v/vt/vn, counts from 1, or back from the last vertex
where it is negative; polygons have any number of corners; a line goes on after a backslash.
Gmsh 1: $NOD and $ELM. POLYDATA: polygons and strips of VTK's legacy files, as text or big-endian binary, with cells as
lists (until version 4) or as OFFSETS and CONNECTIVITY (from 5 on).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

import meshio
import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError

Cells = NDArray[np.int64]

_FREE_FORM = frozenset({"curv", "curv2", "surf", "cstype"})
_GMSH = {1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6),
         7: ("pyramid", 5), 15: ("vertex", 1)}  # fmt: skip
"""types of elements, and their nodes, whose order is meshio's"""
_VTK_NUMBERS = {"float": ">f4", "double": ">f8", "int": ">i4", "unsigned_int": ">u4", "long": ">i8",
                "vtktypeint32": ">i4", "vtktypeint64": ">i8"}  # fmt: skip


def read_known(path: str, suffix: str, data: bytes) -> meshio.Mesh | None:
    """The mesh of a file of one of these formats; None of others. Raises MeshError with the line where one is wrong."""
    if suffix == ".obj":
        return read_obj(path, data)
    if suffix == ".stl" and data.lstrip()[:5].lower() == b"solid" and len(data) != _binary_size(data):
        return read_stl_text(path, data)
    if suffix == ".msh" and data.lstrip().startswith(b"$NOD"):
        return read_gmsh1(path, data)
    if suffix == ".vtk" and re.search(rb"^DATASET\s+POLYDATA", data[:2000], re.MULTILINE | re.IGNORECASE):
        return read_polydata(path, data)
    return None


def triangulate(points: Floats, polygon: list[int]) -> list[tuple[int, int, int]]:
    """Triangles of a simple polygon, about plane, that keep its orientation: ears are cut off until three corners are
    left; corners are numbers of points (n, 3)."""
    corners, found = list(polygon), []
    x = points[corners]
    normal = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)  # Newell's
    while len(corners) > 3:
        n = len(corners)
        ear = next((k % n for k in range(1, n + 1) if _is_ear(points, corners, k % n, normal)), 1)
        found.append((corners[ear - 1], corners[ear], corners[(ear + 1) % n]))
        del corners[ear]
    return [*found, (corners[0], corners[1], corners[2])]


def _is_ear(points: Floats, corners: list[int], k: int, normal: Floats) -> bool:
    """Whether the triangle at corner k is convex, and holds no other corner."""
    n = len(corners)
    a, b, c = (points[corners[place % n]] for place in (k - 1, k, k + 1))
    if np.cross(b - a, c - b) @ normal <= 0.0:
        return False
    others = points[[corner for place, corner in enumerate(corners) if (place - k + 1) % n > 2]]
    inside = np.ones(len(others), dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.cross(end - start, others - start) @ normal > 0.0
    return not inside.any()


def _mesh(points: Floats, polygons: list[list[int]]) -> meshio.Mesh:
    """All polygons as triangles."""
    triples = np.array([polygon for polygon in polygons if len(polygon) == 3], dtype=np.int64).reshape(-1, 3)
    quads = np.array([polygon for polygon in polygons if len(polygon) == 4], dtype=np.int64).reshape(-1, 4)
    more = [triple for polygon in polygons if len(polygon) > 4 for triple in triangulate(points, polygon)]
    found = np.concatenate([triples, _halves(points, quads), np.array(more, dtype=np.int64).reshape(-1, 3)])
    return meshio.Mesh(points, [("triangle", found)] if len(found) else [])


def _halves(points: Floats, quads: Cells) -> Cells:
    """Quads cut along their first diagonal, those with a dent at its other side along the second."""
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    normal = np.cross(c - a, d - b)
    folds = (
        np.minimum((np.cross(b - a, c - b) * normal).sum(axis=1), (np.cross(d - c, a - d) * normal).sum(axis=1)) < 0.0
    )
    turned = np.where(folds[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])


def read_obj(path: str, data: bytes) -> meshio.Mesh:
    """Vertices and polygons of an OBJ file; texture, normals, colours, groups, lines and points are left out."""
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    lines: list[int] = []
    for number, words in _obj_lines(data):
        kind, values = words[0], words[1:]
        if kind in _FREE_FORM:
            raise MeshError(f"{path}:{number}: {kind}: free-form curves and surfaces are not read: export polygons")
        try:
            if kind == "v":
                x, y, z = values[:3]
                points.append([float(x), float(y), float(z)])
            elif kind == "f":
                corners = [int(value.partition("/")[0]) for value in values]
                polygons.append([corner - 1 if corner > 0 else len(points) + corner for corner in corners])
                lines.append(number)
                if 0 in corners or len(corners) < 3:
                    raise ValueError
        except ValueError:
            what = "three numbers, e.g. v 0.1 0 0" if kind == "v" else "three corners or more, counted from 1"
            raise MeshError(f"{path}:{number}: {kind!r} is followed by {' '.join(values)!r}: give {what}") from None
    for number, polygon in zip(lines, polygons, strict=True):
        wrong = [corner for corner in polygon if not 0 <= corner < len(points)]
        if wrong:
            raise MeshError(
                f"{path}:{number}: a face has vertex {wrong[0] + 1}, but the file has {len(points)}: export it again"
            )
    return _mesh(np.array(points, dtype=np.float64).reshape(-1, 3), polygons)


def _obj_lines(data: bytes) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line that says something, those that go on as one."""
    begun, kept = 0, ""
    for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
        begun = begun or number
        text = line.partition("#")[0].rstrip()
        if text.endswith("\\"):
            kept += text[:-1] + " "
            continue
        words = (kept + text).split()
        if words:
            yield begun, words
        begun, kept = 0, ""


def _binary_size(data: bytes) -> int:
    """Bytes of a binary STL file with this header, which may begin like a text."""
    return 84 + 50 * int.from_bytes(data[80:84], "little")


def read_stl_text(path: str, data: bytes) -> meshio.Mesh:
    """Triangles of an STL file in text, in letters of either case."""
    words = data.decode("utf-8", "replace").lower().split()
    places = [at for at, word in enumerate(words) if word == "vertex"]
    try:
        points = np.array([[float(word) for word in words[at + 1 : at + 4]] for at in places], dtype=np.float64)
        triangles = np.arange(len(points)).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{path}: is no whole STL file ({error}): save it anew, or in binary") from None
    return meshio.Mesh(points.reshape(-1, 3), [("triangle", triangles)])


def read_gmsh1(path: str, data: bytes) -> meshio.Mesh:
    """Nodes and elements of first order of a Gmsh 1 file."""
    lines = data.decode("utf-8", "replace").split("\n")
    try:
        nodes = [line.split() for line in _section(lines, "$NOD", "$ENDNOD")]
        elements = [[int(word) for word in line.split()] for line in _section(lines, "$ELM", "$ENDELM")]
        points = np.array([[float(word) for word in node[1:4]] for node in nodes], dtype=np.float64).reshape(-1, 3)
        place = {int(node[0]): at for at, node in enumerate(nodes)}
        blocks: dict[str, list[list[int]]] = {}
        for _, kind, _, _, count, *corners in elements:
            if kind not in _GMSH or _GMSH[kind][1] != count:
                raise MeshError(
                    f"{path}: Gmsh 1 with elements of type {kind}, of {count} nodes: open it in gmsh and save it anew"
                )
            blocks.setdefault(_GMSH[kind][0], []).append([place[corner] for corner in corners[:count]])
    except (ValueError, KeyError, IndexError) as error:
        raise MeshError(f"{path}: is no whole Gmsh 1 file ({error}): open it in gmsh and save it anew") from None
    return meshio.Mesh(points, [(kind, np.array(cells, dtype=np.int64)) for kind, cells in blocks.items()])


def _section(lines: list[str], begin: str, end: str) -> list[str]:
    """Lines of a section after its count, as many as that says. Raises ValueError where there are fewer."""
    stripped = [line.strip() for line in lines]
    if begin not in stripped or end not in stripped:
        raise ValueError(f"no {begin} to {end}")
    first, last = stripped.index(begin) + 1, stripped.index(end)
    content = [line for line in stripped[first + 1 : last] if line]
    if len(content) != int(stripped[first]):
        raise ValueError(f"{begin} has {len(content)} lines in place of {stripped[first]}")
    return content


def read_polydata(path: str, data: bytes) -> meshio.Mesh:
    """Polygons and strips of VTK's POLYDATA; its vertices, lines and fields are left out."""
    reader = _Legacy(data)
    points = np.zeros((0, 3))
    polygons: list[list[int]] = []
    try:
        while (words := reader.line()) is not None:
            word = words[0].upper()
            if word == "POINTS":
                points = reader.numbers(3 * int(words[1]), words[2].lower()).reshape(-1, 3).astype(np.float64)
            elif word in ("POLYGONS", "TRIANGLE_STRIPS", "LINES", "VERTICES"):
                cells = reader.cells(int(words[1]), int(words[2]))
                if word == "POLYGONS":
                    polygons += cells
                elif word == "TRIANGLE_STRIPS":
                    polygons += [_turned(strip, k) for strip in cells for k in range(len(strip) - 2)]
            elif word in ("CELL_DATA", "POINT_DATA"):
                break  # fields
        if polygons and not all(0 <= corner < len(points) for polygon in polygons for corner in polygon):
            raise ValueError("a polygon has points that the file has not")
    except (ValueError, KeyError, IndexError) as error:
        raise MeshError(f"{path}: is no whole VTK file of POLYDATA ({error}): save it anew, or as STL") from None
    return _mesh(points, [polygon for polygon in polygons if len(polygon) > 2])


def _turned(strip: list[int], k: int) -> list[int]:
    """Triangle k of a strip; each other one is the other way round."""
    a, b, c = strip[k : k + 3]
    return [a, b, c] if k % 2 == 0 else [b, a, c]


class _Legacy:
    """Reads a legacy VTK file from its fourth line on: lines of words, and blocks of numbers."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0
        for _ in range(2):
            self._raw()
        self._binary = self._raw().strip().upper() == b"BINARY"

    def _raw(self) -> bytes:
        end = self._data.find(b"\n", self._at)
        end = len(self._data) if end < 0 else end
        line, self._at = self._data[self._at : end], end + 1
        return line

    def line(self) -> list[str] | None:
        """Words of the next line that has any; None at the end."""
        while self._at < len(self._data):
            words = self._raw().decode("latin-1").split()
            if words:
                return words
        return None

    def numbers(self, count: int, kind: str) -> NDArray[np.generic]:
        """So many numbers of a type of VTK. Raises ValueError where there are fewer."""
        dtype = np.dtype(_VTK_NUMBERS[kind])
        if self._binary:
            found = np.frombuffer(self._data, dtype, count, self._at)
            self._at += found.nbytes
            return found.astype(dtype.newbyteorder("="))
        words: list[str] = []
        while len(words) < count and (more := self.line()) is not None:
            words += more
        if len(words) != count:
            raise ValueError(f"{len(words)} numbers in place of {count}")
        return np.array(words, dtype=dtype.newbyteorder("="))

    def cells(self, n: int, size: int) -> list[list[int]]:
        """Cells of a section: n lists with their lengths, `size` numbers in all; or n offsets and `size` numbers."""
        here = self._at
        words = self.line()
        if words is not None and words[0].upper() == "OFFSETS":
            offsets = self.numbers(n, words[1].lower()).tolist()
            kind = self.line()
            if kind is None or kind[0].upper() != "CONNECTIVITY":
                raise ValueError("no CONNECTIVITY after OFFSETS")
            flat = self.numbers(size, kind[1].lower()).tolist()
            return [flat[first:last] for first, last in pairwise(offsets)]
        self._at = here
        flat, found = self.numbers(size, "int").tolist(), []
        at = 0
        for _ in range(n):
            found.append(flat[at + 1 : at + 1 + flat[at]])
            at += 1 + flat[at]
        return found
