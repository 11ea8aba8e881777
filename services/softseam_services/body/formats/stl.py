"""STL, in text of letters of either case or binary; every solid of a text is a part."""

import re

import numpy as np

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Block, MeshFile

_SOLID = re.compile(rb"^[ \t]*solid\b[ \t]*([^\r\n]*?)[ \t]*(?=\bfacet\s+normal\b|\bendsolid\b|\r?$)", re.I | re.M)
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.I)
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84


def read_stl(path: str, data: bytes) -> MeshFile:
    """Triangles, each with three points of its own; raises MeshError where the file is not whole."""
    if len(data) >= _HEADER and len(data) == _HEADER + _FACET.itemsize * _count(data):
        return _binary(data)
    head = data[:4096].lower()
    if data.lstrip()[:5].lower() == b"solid" and (b"facet" in head or b"endsolid" in head):
        return _text(path, data)
    if len(data) < _HEADER or len(data) < _HEADER + _FACET.itemsize * _count(data):
        whole = max(0, len(data) - _HEADER) // _FACET.itemsize
        raise MeshError(
            f"{path}: is no whole STL file: it says {_count(data):,} triangles and has {whole:,}; "
            "copy or export it again"
        )
    return _binary(data)


def _count(data: bytes) -> int:
    """Triangles of a binary file, as its header says."""
    return int.from_bytes(data[80:_HEADER], "little")


def _binary(data: bytes) -> MeshFile:
    facets = np.frombuffer(data, _FACET, _count(data), _HEADER)
    return _soup(facets["corners"].astype(np.float64).reshape(-1, 3), np.zeros(len(facets), dtype=np.int64), [""])


def _text(path: str, data: bytes) -> MeshFile:
    solids = list(_SOLID.finditer(data))
    ends = [*(solid.start() for solid in solids[1:]), len(data)]
    points, part, names = [], [], []
    for number, (solid, end) in enumerate(zip(solids, ends, strict=True)):
        found = _corners(path, data, solid.end(), end)
        points.append(found)
        part.append(np.full(len(found) // 3, number, dtype=np.int64))
        names.append(solid[1].decode("utf-8", "replace"))
    return _soup(np.concatenate(points), np.concatenate(part), names)


def _corners(path: str, data: bytes, start: int, end: int) -> np.ndarray:
    """Corners of the triangles of one solid (3 T, 3)."""
    words = [match.groups() for match in _VERTEX.finditer(data, start, end)]
    try:
        found = np.array(words, dtype="S").astype(np.float64).reshape(-1, 3)
        if len(found) % 3:
            raise ValueError("a facet has not three corners")
    except ValueError as error:
        line = data.count(b"\n", 0, start) + 1
        raise MeshError(
            f"{path}: is no whole STL file (the solid that begins on line {line}: {error}): save it anew, or in binary"
        ) from None
    return found


def _soup(points: np.ndarray, part: np.ndarray, names: list[str]) -> MeshFile:
    triangles = np.arange(len(points)).reshape(-1, 3)
    return MeshFile(points, (Block("triangle", triangles, part),) if len(triangles) else (), tuple(names))
