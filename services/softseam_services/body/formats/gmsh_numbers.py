"""Numbers of a section of a Gmsh file, one after the other, in text or in binary of this machine's byte order."""

import numpy as np
from numpy.typing import NDArray

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
