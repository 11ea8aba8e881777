"""Rows of numbers and lists of a PLY file's body, all at once where their lists are equally long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    """A body in text."""

    def __init__(self, body: bytes) -> None:
        self._numbers, self.at = numbers(body), 0

    def take(self, kind: str, count: int) -> Numbers:
        """The next numbers. Raises ValueError where there are fewer."""
        found = self._numbers[self.at : self.at + count]
        if len(found) != count:
            raise ValueError("it ends too early")
        self.at += count
        return found

    def columns(self, layout: list[tuple[str, int]], count: int) -> list[Numbers] | None:
        """The next rows, column by column, each (count, n) of a type; None where there are fewer."""
        width = sum(n for _, n in layout)
        if self.at + count * width > len(self._numbers):
            return None
        table = self._numbers[self.at : self.at + count * width].reshape(count, width)
        return list(np.split(table, np.cumsum([n for _, n in layout])[:-1], axis=1))

    def skip(self, layout: list[tuple[str, int]], count: int) -> None:
        """Pass over rows."""
        self.at += count * sum(n for _, n in layout)


class BinaryRows:
    """A body in binary, of the order < or >, from a byte on."""

    def __init__(self, data: bytes, at: int, order: str) -> None:
        self._data, self.at, self._order = data, at, order

    def take(self, kind: str, count: int) -> Numbers:
        """The next numbers. Raises ValueError where there are fewer."""
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
    first = _row(rows, element) if element.count else [np.zeros(0)] * len(element.properties)
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
    table = [_row(rows, element) for _ in range(element.count)]
    return {
        each.name: (
            np.concatenate([row[k] for row in table]),
            np.array([len(row[k]) for row in table], dtype=np.int64),
        )
        for k, each in enumerate(element.properties)
    }


def _row(rows: TextRows | BinaryRows, element: Element) -> list[Numbers]:
    """Values of each property of the next row."""
    return [
        rows.take(each.number, int(rows.take(each.length, 1).item()) if each.length else 1)
        for each in element.properties
    ]
