"""Gmsh's files of versions 1, 2 and 4, in text or binary: nodes, elements of any order, physical groups as parts.

Version 1 has $NOD and $ELM, 2 and 4 have $Nodes and $Elements (Gmsh's reference manual, "MSH file format"; 1 and 4.0
in "Legacy formats"). What else is in a file is left out.
"""

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Block, Cells, MeshFile
from softseam_services.body.formats.text import numbers

Layout = list[tuple[str, int]]
"""numpy's type and how many of it, one after the other"""


class TextNumbers:
    """Text has no types: all are read alike."""

    def __init__(self, content: bytes) -> None:
        self._numbers, self._at = numbers(content), 0

    def count(self) -> int:
        """A number on a line of its own."""
        return self.ints("i4", 1)[0]

    def ints(self, kind: str, count: int) -> list[int]:
        """Whole numbers of a type."""
        return [int(value) for value in self._take(count)]

    def rows(self, layout: Layout, count: int) -> list[NDArray[np.generic]]:
        """So many rows, part by part of the layout, each (count, n)."""
        width = sum(n for _, n in layout)
        table = self._take(count * width).reshape(count, width)
        return list(np.split(table, np.cumsum([n for _, n in layout])[:-1], axis=1))

    def rest(self) -> NDArray[np.float64]:
        """All that comes."""
        return self._take(len(self._numbers) - self._at)

    def _take(self, count: int) -> NDArray[np.float64]:
        found = self._numbers[self._at : self._at + count]
        if len(found) != count:
            raise ValueError(f"{len(found):,} numbers in place of {count:,} in a section")
        self._at += count
        return found


class BinaryNumbers:
    """Binary, but for counts on a line of their own."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def count(self) -> int:
        """A number on a line of its own, in text."""
        end = self._content.index(b"\n", self._at)
        line, self._at = self._content[self._at : end], end + 1
        return int(line)

    def ints(self, kind: str, count: int) -> list[int]:
        """Whole numbers of a type."""
        return [int(value) for value in self.rows([(kind, count)], 1)[0].ravel()]

    def rows(self, layout: Layout, count: int) -> list[NDArray[np.generic]]:
        """So many rows, part by part of the layout, each (count, n)."""
        dtype = np.dtype([(f"f{k}", kind, (n,)) for k, (kind, n) in enumerate(layout)])
        if self._at + count * dtype.itemsize > len(self._content):
            raise ValueError(f"a section ends before {count:,} rows")
        table = np.frombuffer(self._content, dtype, count, self._at)
        self._at += count * dtype.itemsize
        return [table[f"f{k}"] for k in range(len(layout))]


Numbers = TextNumbers | BinaryNumbers


_TYPES = {1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6),
          7: ("pyramid", 5), 8: ("line", 3), 9: ("triangle", 6), 10: ("quad", 9), 11: ("tetra", 10),
          12: ("hexahedron", 27), 13: ("wedge", 18), 14: ("pyramid", 14), 15: ("vertex", 1), 16: ("quad", 8),
          17: ("hexahedron", 20), 18: ("wedge", 15), 19: ("pyramid", 13), 21: ("triangle", 10), 23: ("triangle", 15),
          26: ("line", 4), 27: ("line", 5), 29: ("tetra", 20), 30: ("tetra", 35), 36: ("quad", 16), 37: ("quad", 25),
          90: ("wedge", 40), 92: ("hexahedron", 64), 93: ("hexahedron", 125)}  # fmt: skip
"""kinds and numbers of nodes, corners first and in VTK's order"""
_DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2}
"""of elements; of all others 3"""
_PHYSICAL = re.compile(rb"^\$PhysicalNames(.*?)^\$EndPhysicalNames", re.M | re.S)
_NAMED = re.compile(rb'^\s*(\d+)\s+(-?\d+)\s+"([^"\n]*)"', re.M)

Elements = list[tuple[int, Cells, Cells]]
"""type, tags of nodes (m, k), physical group (m,), 0 of none"""


def read_gmsh(path: str, data: bytes) -> MeshFile:
    """Nodes and elements; raises MeshError where the file is not whole."""
    try:
        if data.lstrip().startswith(b"$NOD"):
            tags, points = _tagged_nodes(TextNumbers(_section(data, "NOD", "ENDNOD")))
            elements = _elements_1(TextNumbers(_section(data, "ELM", "ENDELM")))
        else:
            version, source = _version(data)
            nodes, rows = source(_section(data, "Nodes")), source(_section(data, "Elements"))
            if version < 4.0:
                tags, points = _tagged_nodes(nodes)
                elements = _elements_2(rows)
            else:
                tags, points = _nodes_4(nodes, version)
                entities = source(_section(data, "Entities")) if b"\n$Entities" in data else None
                elements = _elements_4(rows, version, _groups(entities, version) if entities else {})
        return _mesh(data, tags, points, elements)
    except (ValueError, IndexError) as error:
        raise MeshError(f"{path}: is no whole Gmsh file ({error}): open it in gmsh and save it anew") from None


def _section(data: bytes, begin: str, end: str = "") -> bytes:
    """What stands between two marks. Raises ValueError where one is missing."""
    end = end or f"End{begin}"
    first = re.search(rb"^[ \t]*\$" + begin.encode() + rb"[ \t\r]*\n", data, re.M)
    last = data.find(b"$" + end.encode(), first.end()) if first else -1
    if first is None or last < 0:
        raise ValueError(f"no ${begin} to ${end}")
    return data[first.end() : last]


def _version(data: bytes) -> tuple[float, type[TextNumbers] | type[BinaryNumbers]]:
    words = _section(data, "MeshFormat")[:200].split()
    version = float(words[0])
    if not 2.0 <= version < 5.0:
        raise ValueError(f"version {version:g}, but 1, 2 and 4 are read")
    return version, BinaryNumbers if int(words[1]) else TextNumbers


def _tagged_nodes(nodes: Numbers) -> tuple[Cells, Floats]:
    """Tags (n,) and points (n, 3) of versions 1 and 2."""
    tags, points = nodes.rows([("i4", 1), ("f8", 3)], nodes.count())
    return tags.ravel().astype(np.int64), points.astype(np.float64)


def _elements_1(numbers: TextNumbers) -> Elements:
    """Rows of tag, type, physical group, region, number of nodes, nodes."""
    count = numbers.count()
    return _in_text(numbers, count, lambda row, at: (5, row[at + 4], row[at + 2]))


def _elements_2(numbers: Numbers) -> Elements:
    """Rows of tag, type, number of tags, tags, of which the first is the physical group, nodes; in binary those of one
    type in blocks of type, count, number of tags."""
    count = numbers.count()
    if isinstance(numbers, TextNumbers):
        return _in_text(
            numbers, count, lambda row, at: (3 + row[at + 2], _nodes_of(row[at + 1]), row[at + 3] if row[at + 2] else 0)
        )
    found: Elements = []
    while count > 0:
        kind, more, n_tags = numbers.ints("i4", 3)
        rows = numbers.rows([("i4", 1 + n_tags + _nodes_of(kind))], more)[0].astype(np.int64)
        found.append((kind, rows[:, 1 + n_tags :], rows[:, 1] if n_tags else np.zeros(more, dtype=np.int64)))
        count -= max(more, 1)
    return found


def _in_text(numbers: TextNumbers, count: int, head: Callable[[list[int], int], tuple[int, int, int]]) -> Elements:
    """Rows of any length; head says of one that begins at a place how many numbers come before its nodes, how many
    nodes there are, and its group."""
    flat = numbers.rest().astype(np.int64)
    row, at = flat.tolist(), 0
    begins: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for _ in range(count):
        before, n_nodes, group = head(row, at)
        begins.setdefault((row[at + 1], n_nodes), []).append((at + before, group))
        at += before + n_nodes
    if at != len(row):
        raise ValueError(f"{count:,} elements of {at:,} numbers in place of {len(row):,}")
    found: Elements = []
    for (kind, n_nodes), places in begins.items():
        first, group = np.array(places, dtype=np.int64).T
        found.append((kind, flat[first[:, None] + np.arange(n_nodes)], group))
    return found


def _nodes_4(numbers: Numbers, version: float) -> tuple[Cells, Floats]:
    """Tags (n,) and points (n, 3), entity by entity."""
    new = version >= 4.1
    n_blocks = numbers.ints("u8", 4 if new else 2)[0]
    tags, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _ in range(n_blocks):
        first, second, parametric = numbers.ints("i4", 3)
        width = 3 + (first if new else second) * parametric
        (count,) = numbers.ints("u8", 1)
        if new:
            tags.append(numbers.rows([("u8", 1)], count)[0].ravel().astype(np.int64))
            points.append(numbers.rows([("f8", width)], count)[0][:, :3].astype(np.float64))
        else:
            tag, x = numbers.rows([("i4", 1), ("f8", width)], count)
            tags.append(tag.ravel().astype(np.int64))
            points.append(x[:, :3].astype(np.float64))
    return np.concatenate(tags), np.concatenate(points)


def _elements_4(numbers: Numbers, version: float, groups: dict[tuple[int, int], int]) -> Elements:
    """Elements of one type, entity by entity."""
    new = version >= 4.1
    n_blocks = numbers.ints("u8", 4 if new else 2)[0]
    found: Elements = []
    for _ in range(n_blocks):
        first, second, kind = numbers.ints("i4", 3)
        entity = (first, second) if new else (second, first)
        (count,) = numbers.ints("u8", 1)
        rows = numbers.rows([("u8" if new else "i4", 1 + _nodes_of(kind))], count)[0].astype(np.int64)
        found.append((kind, rows[:, 1:], np.full(count, groups.get(entity, 0))))
    return found


def _groups(numbers: Numbers, version: float) -> dict[tuple[int, int], int]:
    """The first physical group of each entity that has one, by dimension and tag."""
    found = {}
    for dimension, count in enumerate(numbers.ints("u8", 4)):
        for _ in range(count):
            (tag,) = numbers.ints("i4", 1)
            numbers.rows([("f8", 3 if dimension == 0 and version >= 4.1 else 6)], 1)
            groups = numbers.ints("i4", numbers.ints("u8", 1)[0])
            if dimension:
                numbers.ints("i4", numbers.ints("u8", 1)[0])  # what bounds it
            if groups:
                found[dimension, tag] = groups[0]
    return found


def _nodes_of(kind: int) -> int:
    if kind not in _TYPES:
        raise ValueError(f"elements of type {kind} are not known")
    return _TYPES[kind][1]


def _mesh(data: bytes, tags: Cells, points: Floats, elements: Elements) -> MeshFile:
    order = np.argsort(tags, kind="stable")
    listed = _PHYSICAL.search(data)
    found = _NAMED.findall(listed[1]) if listed else []
    named = {(int(dimension), int(tag)): name.decode("utf-8", "replace") for dimension, tag, name in found}
    names = [""]
    blocks: list[Block] = []
    for number, nodes, group in elements:
        kind, n_nodes = _TYPES.get(number, (f"Gmsh type {number}", 0))
        if nodes.shape[1] != n_nodes:
            raise ValueError(f"elements of type {number} have {nodes.shape[1]} nodes")
        place = np.searchsorted(tags, nodes, sorter=order).clip(max=max(len(tags) - 1, 0))
        missing = nodes[tags[order[place]] != nodes] if len(tags) else nodes.ravel()
        if len(missing):
            raise ValueError(f"an element has node {missing[0]}, which is not among its {len(tags):,}")
        part = np.zeros(len(nodes), dtype=np.int64)
        for tag in np.unique(group[group != 0]).tolist():
            name = named.get((_DIMENSION.get(kind, 3), tag), str(tag))
            if name not in names:
                names.append(name)
            part[group == tag] = names.index(name)
        blocks.append(Block(kind, order[place], part))
    return MeshFile(points, tuple(blocks), tuple(names))
