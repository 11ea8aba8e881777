"""PLY (Stanford), in text or binary of either byte order, as scanners and modellers write it.

Elements have properties, numbers or lists; `vertex` has x, y, z, `face` a list vertex_indices or vertex_index, and
`tristrips` one of strips that -1 ends. Colours, normals, texture and other elements are left out.
"""

import re

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile, polygon_file
from softseam_services.body.formats.ply_rows import BinaryRows, Element, Property, Read, TextRows, read_element
from softseam_services.body.formats.polygons import strip_triangles

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
