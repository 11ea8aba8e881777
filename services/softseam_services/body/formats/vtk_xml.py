"""VTK's XML files of PolyData (.vtp) and UnstructuredGrid (.vtu).

Arrays are text, base64, or appended to the file, as they are or compressed by zlib or lzma, of either byte order.
"""

import base64
import lzma
import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol
from xml.etree import ElementTree

import numpy as np

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile
from softseam_services.body.formats.text import numbers
from softseam_services.body.formats.vtk_cells import vtk_cells

_NUMBERS = {"Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4", "Int64": "i8",
            "UInt64": "u8", "Float32": "f4", "Float64": "f8"}  # fmt: skip


class _Decompressor(Protocol):
    def decompress(self, data: bytes, max_length: int, /) -> bytes: ...


_COMPRESSORS: dict[str, Callable[[], _Decompressor]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}
_MOST_BYTES = 2**30
"""that compressed arrays of a file may have, which state it before they are unpacked"""
_POLYDATA = {"Polys": 7, "Strips": 6}
"""types of the cells of each section"""
_APPENDED = re.compile(rb"<AppendedData\b[^>]*>\s*_", re.S)


@dataclass(frozen=True)
class _Layout:
    """How arrays are stored."""

    order: str
    header: np.dtype[np.unsignedinteger]
    decompressor: Callable[[], _Decompressor] | None
    appended: bytes
    raw: bool
    """whether what is appended is no base64"""
    unpacked: list[int]
    """bytes of the compressed arrays that were read, updated in place"""


def read_xml(path: str, data: bytes) -> MeshFile:
    """Points and cells; raises MeshError where the file is not whole, or holds something else."""
    try:
        root, appended, raw = _parsed(data)
        kind = root.get("type", "")
        if kind not in ("PolyData", "UnstructuredGrid"):
            raise MeshError(
                f"{path}: is VTK XML of {kind or 'nothing'}, which is not read: extract its surface in ParaView, and "
                "save that as VTP or STL"
            )
        compressor = root.get("compressor")
        if compressor and compressor not in _COMPRESSORS:
            raise MeshError(f"{path}: is compressed by {compressor}: save it by zlib or not compressed, or as STL")
        order = ">" if root.get("byte_order", "") == "BigEndian" else "<"
        header = np.dtype(order + _NUMBERS[root.get("header_type", "UInt32")])
        layout = _Layout(order, header, _COMPRESSORS[compressor] if compressor else None, appended, raw, [])
        points, cells, before = [np.zeros((0, 3))], [], 0
        for piece in root.iter("Piece"):
            at = piece.find("Points/DataArray")
            found = np.zeros(0) if at is None else _array(at, layout)
            points.append(found.reshape(-1, 3).astype(np.float64))
            cells += [(types, nodes + before, sizes) for types, nodes, sizes in _cells(piece, layout)]
            before += len(points[-1])
        types, nodes, sizes = (
            (np.concatenate([np.zeros(0, dtype=np.int64), *parts]) for parts in zip(*cells, strict=True))
            if cells
            else (np.zeros(0, dtype=np.int64),) * 3
        )
        return vtk_cells(np.concatenate(points), types, nodes, sizes)
    except MeshError:
        raise
    except (ValueError, KeyError, IndexError, ElementTree.ParseError, zlib.error, lzma.LZMAError) as error:
        reason = f"it has no {error}" if isinstance(error, KeyError) else error
        raise MeshError(f"{path}: is no whole VTK XML file ({reason}): save it anew, or as STL") from None


def _parsed(data: bytes) -> tuple[ElementTree.Element, bytes, bool]:
    """The document without what is appended, that, and whether it is no base64."""
    found = _APPENDED.search(data)
    if found is None:
        return ElementTree.fromstring(data), b"", False
    end = data.rfind(b"</AppendedData>")
    end = len(data) if end < 0 else end
    tail = data[end:].partition(b">")[2] or b"</VTKFile>"
    return ElementTree.fromstring(data[: found.start()] + tail), data[found.end() : end], b"raw" in found[0]


def _cells(piece: ElementTree.Element, layout: _Layout) -> list[tuple[Cells, Cells, Cells]]:
    """Types, nodes and sizes of the cells of a piece, section by section."""
    found = []
    for section in piece:
        if section.tag == "Cells" or section.tag in _POLYDATA:
            arrays = {each.get("Name", ""): each for each in section.iter("DataArray")}
            if "offsets" not in arrays and "connectivity" not in arrays:
                continue
            ends = _array(arrays["offsets"], layout).astype(np.int64)
            nodes = _array(arrays["connectivity"], layout).astype(np.int64)
            sizes = np.diff(ends, prepend=0)
            if section.tag == "Cells":
                types = _array(arrays["types"], layout).astype(np.int64)
            else:
                types = np.full(len(sizes), _POLYDATA[section.tag])
            found.append((types, nodes[: sizes.sum()], sizes))
    return found


def _array(element: ElementTree.Element, layout: _Layout) -> np.ndarray:
    """Values of a DataArray, flat. Raises ValueError and KeyError."""
    dtype = np.dtype(layout.order + _NUMBERS[element.get("type", "")])
    kind, text = element.get("format", "ascii"), (element.text or "").strip()
    if kind == "ascii":
        return numbers(text)
    if kind == "appended":
        rest = layout.appended[int(element.get("offset", "0")) :]
        return np.frombuffer(_content(rest, layout, layout.raw), dtype)
    return np.frombuffer(_content("".join(text.split()).encode(), layout, False), dtype)


def _content(stored: bytes, layout: _Layout, raw: bool) -> bytes:
    """Bytes of an array that begins here, after a header that states its size, or the sizes of compressed blocks."""
    size = layout.header.itemsize

    def part(at: int, count: int) -> bytes:
        """Bytes from a place on, where base64 begins."""
        if raw:
            return stored[at : at + count]
        return base64.b64decode(stored[at : at + _in_base64(count)])[:count]

    if layout.decompressor is None:
        n_bytes = int(np.frombuffer(part(0, size), layout.header)[0])
        found = part(0, size + n_bytes)[size:]
        if len(found) != n_bytes:
            raise ValueError(f"an array has {len(found):,} bytes in place of {n_bytes:,}")
        return found
    n_blocks = int(np.frombuffer(part(0, size), layout.header)[0])
    head = (3 + n_blocks) * size
    stated = np.frombuffer(part(0, head), layout.header)
    if len(stated) != 3 + n_blocks:
        raise ValueError(f"an array has {len(stated):,} numbers in place of a head of {3 + n_blocks:,}")
    whole, rest = int(stated[1]), int(stated[2])
    sizes = [whole] * (n_blocks - 1) + [rest or whole] if n_blocks else []
    layout.unpacked.append(sum(sizes))
    if sum(layout.unpacked) > _MOST_BYTES:
        raise ValueError(f"it packs arrays of {sum(layout.unpacked):,} bytes, more than {_MOST_BYTES:,}")
    lengths = stated[3:].astype(np.int64)
    packed = part(head if raw else _in_base64(head), int(lengths.sum()))
    blocks = []
    for n_bytes, n_packed, end in zip(sizes, lengths.tolist(), np.cumsum(lengths).tolist(), strict=True):
        block = layout.decompressor().decompress(packed[end - n_packed : end], n_bytes + 1)
        if len(block) != n_bytes:
            more = "more than" if len(block) > n_bytes else f"{len(block):,} bytes in place of"
            raise ValueError(f"a block has {more} {n_bytes:,} bytes that it states")
        blocks.append(block)
    return b"".join(blocks)


def _in_base64(count: int) -> int:
    """Letters of so many bytes."""
    return 4 * ((count + 2) // 3)
