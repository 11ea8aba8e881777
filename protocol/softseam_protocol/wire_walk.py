"""Finds the fields of an encoded message: where the bytes of each begin and end."""

from __future__ import annotations

VARINT, FIXED64, BYTES = 0, 1, 2
"""kinds of fields on the wire"""


class Unteachable(Exception):
    """A message whose layout is not worth knowing."""


def fields_between(data: bytes, begin: int, end: int) -> dict[int, tuple[int, int, int]]:
    """Number -> kind, begin and end of each field's bytes, in the order in which they come. Raises Unteachable."""
    found: dict[int, tuple[int, int, int]] = {}
    at = begin
    while at < end:
        tag, at = _varint(data, at)
        number, kind = tag >> 3, tag & 7
        if kind == VARINT:
            after = _varint(data, at)[1]
        elif kind == FIXED64:
            after = at + 8
        elif kind == BYTES:
            size, at = _varint(data, at)
            after = at + size
        else:
            raise Unteachable
        if number in found:
            raise Unteachable  # the last one counts, or they are merged
        found[number] = (kind, at, after)
        at = after
    return found


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number at `at`, and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
