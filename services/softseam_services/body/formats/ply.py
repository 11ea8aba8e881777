"""PLY (Stanford), in text or binary of either byte order, as scanners and modellers write it.

Elements have properties, numbers or lists; `vertex` has x, y, z, `face` a list vertex_indices or vertex_index, and
`tristrips` one of strips that -1 ends. Colours, normals, texture and other elements are left out.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile, polygon_file
from softseam_services.body.formats.polygons import strip_triangles
from softseam_services.body.formats.text import numbers

Numbers = NDArray[np.generic]
Read = dict[str, tuple[Numbers, NDArray[np.int64]]]
"""of each property the values of all rows, flat, and how many each row has"""


@dataclass(frozen=True)
class Property:
    """A number of each row, or a list."""

    name: str
    number: str
    """numpy's type of its numbers"""
    length: str
    """numpy's type of its length; "" of what is no list"""


@dataclass(frozen=True)
class Element:
    """Rows with the same properties."""

    name: str
    count: int
    properties: list[Property]


class TextRows:
    """A body in text, a row a line; what a line has beyond its properties is passed over."""

    def __init__(self, body: bytes) -> None:
        self._lines, self.at = [line for line in body.splitlines() if not line.isspace() and line], 0

    def row(self, properties: list[Property]) -> list[Numbers]:
        """Values of each property of the next row. Raises ValueError and IndexError where there is none."""
        values = numbers(self._lines[self.at])
        found: list[Numbers] = []
        place = 0
        for each in properties:
            length = int(values[place]) if each.length else 1
            place += bool(each.length)
            found.append(values[place : place + length])
            place += length
        if place > len(values):
            raise ValueError(f"a row has {len(values)} numbers in place of {place}")
        self.at += 1
        return found

    def columns(self, layout: list[tuple[str, int]], count: int) -> list[Numbers] | None:
        """The next rows, column by column, each (count, n) of a type; None where they are fewer, or not alike."""
        lines = self._lines[self.at : self.at + count]
        values = numbers(b" ".join(lines))
        ends = np.cumsum([n for _, n in layout])
        width, rest = divmod(len(values), max(count, 1))
        if rest or len(lines) < count or (count and width < ends[-1]):
            return None
        table: Numbers = values.reshape(count, width)
        return np.split(table, ends, axis=1)[: len(layout)]

    def skip(self, layout: list[tuple[str, int]], count: int) -> None:
        """Pass over rows."""
        self.at += count


class BinaryRows:
    """A body in binary, of the order < or >, from a byte on."""

    def __init__(self, data: bytes, at: int, order: str) -> None:
        self._data, self.at, self._order = data, at, order

    def row(self, properties: list[Property]) -> list[Numbers]:
        """Values of each property of the next row. Raises ValueError where there is none."""
        return [
            self._take(each.number, int(self._take(each.length, 1).item()) if each.length else 1) for each in properties
        ]

    def _take(self, kind: str, count: int) -> Numbers:
        found = np.frombuffer(self._data, self._order + kind, count, self.at)
        self.at += found.nbytes
        return found

    def columns(self, layout: list[tuple[str, int]], count: int) -> list[Numbers] | None:
        """The next rows, column by column, each (count, n) of a type; None where there are fewer."""
        dtype = self._dtype(layout)
        if self.at + count * dtype.itemsize > len(self._data):
            return None
        rows = np.frombuffer(self._data, dtype, count, self.at) if dtype.itemsize else np.zeros(count, dtype)
        return [rows[f"f{k}"] for k in range(len(layout))]

    def skip(self, layout: list[tuple[str, int]], count: int) -> None:
        """Pass over rows."""
        self.at += count * self._dtype(layout).itemsize

    def _dtype(self, layout: list[tuple[str, int]]) -> np.dtype[np.void]:
        return np.dtype([(f"f{k}", self._order + kind, (n,)) for k, (kind, n) in enumerate(layout)])


def read_element(rows: TextRows | BinaryRows, element: Element) -> Read:
    """All values of the rows of an element, which come next. Raises ValueError where there are fewer."""
    start = rows.at
    first = rows.row(element.properties) if element.count else [np.zeros(0)] * len(element.properties)
    rows.at = start
    layout: list[tuple[str, int]] = []
    for each, values in zip(element.properties, first, strict=True):
        layout += [(each.length, 1), (each.number, len(values))] if each.length else [(each.number, 1)]
    columns = rows.columns(layout, element.count)
    if columns is None and not any(each.length for each in element.properties):
        raise ValueError(f"it ends within its {element.count:,} of {element.name}")
    if columns is not None:
        even, found = True, {}
        for each in element.properties:
            lengths = columns.pop(0) if each.length else np.ones(0)
            values = columns.pop(0)
            even = even and bool((lengths == values.shape[1]).all() if each.length else True)
            found[each.name] = (values.ravel(), np.full(element.count, values.shape[1], dtype=np.int64))
        if even:
            rows.skip(layout, element.count)
            return found
    table = [rows.row(element.properties) for _ in range(element.count)]
    return {
        each.name: (
            np.concatenate([row[k] for row in table]),
            np.array([len(row[k]) for row in table], dtype=np.int64),
        )
        for k, each in enumerate(element.properties)
    }


_NUMBERS = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
            "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
            "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8"}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_INDICES = ("vertex_indices", "vertex_index")


def read_ply(path: str, data: bytes) -> MeshFile:
    """Vertices and polygons; raises MeshError where the file is not whole, or has no faces."""
    try:
        order, elements, at = _header(data)
        rows = BinaryRows(data, at, order) if order else TextRows(data[at:])
        read = {element.name: read_element(rows, element) for element in elements}
        points = _points(read)
        corners, sizes = _polygons(read)
        if len(corners) and not (0 <= corners.min() and corners.max() < len(points)):
            raise ValueError(f"a face has vertex {corners.max()}, or one below 0, of {len(points)}")
    except KeyError as error:
        raise MeshError(f"{path}: is no PLY file of a surface: it has no {error}: save it anew, or as STL") from None
    except (ValueError, IndexError) as error:
        reason = "it ends too early" if isinstance(error, IndexError) else error
        raise MeshError(f"{path}: is no whole PLY file ({reason}): save it anew, or as STL") from None
    return polygon_file(points, corners, sizes)


def _header(data: bytes) -> tuple[str, list[Element], int]:
    """Byte order ("" of text), elements, and where the body begins. Raises ValueError, KeyError and IndexError."""
    end = re.search(rb"^end_header[^\n]*(\n|\Z)", data, re.M)
    if end is None:
        raise ValueError("its header does not end")
    order = None
    elements: list[Element] = []
    for line in data[: end.start()].decode("latin-1").splitlines():
        match line.split():
            case ["format", kind, *_]:
                order = _ORDERS[kind]
            case ["element", name, count, *_]:
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, number, name, *_]:
                elements[-1].properties.append(Property(name, _NUMBERS[number], _NUMBERS[length]))
            case ["property", number, name, *_]:
                elements[-1].properties.append(Property(name, _NUMBERS[number], ""))
    if order is None:
        raise ValueError("it names no format")
    return order, elements, end.end()


def _points(read: dict[str, Read]) -> Floats:
    """Vertices (n, 3)."""
    vertex = read["vertex"]
    return np.stack([vertex[axis][0] for axis in "xyz"], axis=1).astype(np.float64)


def _polygons(read: dict[str, Read]) -> tuple[Cells, Cells]:
    """Corners of faces and of triangles of strips (k,), and how many each has (m,)."""
    corners, sizes = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for name in _INDICES:
        if name in read.get("face", {}):
            flat, lengths = read["face"][name]
            corners.append(flat.astype(np.int64))
            sizes.append(lengths)
        if name in read.get("tristrips", {}):
            flat, lengths = read["tristrips"][name]
            triangles = strip_triangles(flat.astype(np.int64), np.cumsum(lengths)[:-1])
            corners.append(triangles.ravel())
            sizes.append(np.full(len(triangles), 3, dtype=np.int64))
    return np.concatenate(corners), np.concatenate(sizes)
