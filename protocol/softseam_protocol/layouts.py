"""Reads messages that are laid out like one before: same fields, shapes and texts, other numbers.

A message that was decoded and found good teaches where its numbers stand. One `struct` call then takes another of the
same length apart; the bytes in between must be those of the first. What does not fit, and what might be refused, is
left to the codec, so that nothing is accepted here that it would not accept.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from operator import itemgetter
from typing import Any

import numpy as np

from softseam_protocol.descriptors import FIELDS, Field
from softseam_protocol.learned import Learned
from softseam_protocol.wire_fields import suspicious
from softseam_protocol.wire_walk import FIXED64, VARINT, Unteachable, fields_between

Reader = Callable[[bytes], Any]
"""the message, or None where the codec has to look"""

_ALIKE = 4
"""layouts that are kept of one length: other sessions' messages have the same"""
_SMALL = 4096
"""arrays up to this size are copied to be tested together [B]"""


class Layouts:
    """The layouts of one class of messages."""

    def __init__(self, cls: type) -> None:
        self._cls = cls
        self._learned: Learned[int, Reader] = Learned(_ALIKE)

    def read(self, data: bytes) -> Any:
        """The message, or None if no layout fits."""
        for reader in self._learned.known.get(len(data), ()):
            message = reader(data)
            if message is not None:
                return message
        return None

    def meet(self, data: bytes, message: Any) -> None:
        """Learn from a message that the codec had to decode."""
        self._learned.meet(len(data), lambda: _Lesson(data).reader(self._cls, message))


class _Lesson:
    """Walks one message and writes the function that reads its like."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._format = ["<"]
        self._at = 0
        self._n = 0
        """values that the format gives so far"""
        self._fixed: list[int] = []
        self._floats: list[str] = []
        self._small: list[str] = []
        self._doubts: list[str] = []
        """conditions in which the codec has to look"""
        self._names: dict[str, Any] = {
            "ndarray": np.ndarray,
            "zeros": np.zeros,
            "suspicious": suspicious,
            "infinity": np.inf,
        }

    def reader(self, cls: type, message: Any) -> Reader | None:
        try:
            build = self._message(cls, message, 0, len(self._data))
        except Unteachable:
            return None
        self._keep(len(self._data))
        unpack = struct.Struct("".join(self._format)).unpack
        fixed = itemgetter(*self._fixed)
        self._names |= {"unpack": unpack, "fixed": fixed, "known": fixed(unpack(self._data))}
        if self._floats:
            # infinite and NaN survive a sum; one that overflows is doubtful, too
            self._doubts.append(f"not -infinity < {' + '.join(self._floats)} < infinity")
        if self._small:
            self._doubts.append(f"suspicious([{', '.join(self._small)}])")
        doubts = " or ".join(["fixed(v) != known", *self._doubts])
        source = f"def read(data):\n    v = unpack(data)\n    return None if {doubts} else {build}\n"
        exec(source, self._names)  # every name and index in it is ours
        read: Reader = self._names["read"]
        return read

    def _message(self, cls: type, message: Any, begin: int, end: int) -> str:
        """The expression that builds a message from the values; its bytes are data[begin:end]."""
        fields = {field.number: field for field in FIELDS[cls]}
        values = {field.number: getattr(message, field.name) for field in FIELDS[cls]}
        if any(field.container or field.of is bytes for field in FIELDS[cls]):
            raise Unteachable
        # in the order of the bytes, which need not be that of the fields
        found = {
            number: self._field(fields[number], values[number], kind, lo, hi)
            for number, (kind, lo, hi) in fields_between(self._data, begin, end).items()
            if number in fields
        }
        absent = {
            number: self._empty(values[number]) if field.is_array else self._constant(values[number])
            for number, field in fields.items()
            if number not in found
        }
        arguments = found | absent
        return f"{self._constant(cls)}({', '.join(arguments[number] for number in fields)})"

    def _field(self, field: Field, value: Any, kind: int, lo: int, hi: int) -> str:
        if field.is_message:
            return self._message(field.of, value, lo, hi)
        if field.is_array:
            return self._array(field, value, lo, hi)
        if field.of is float and kind == FIXED64:
            self._floats.append(self._value("d", lo, hi))
            return self._floats[-1]
        if field.of is int and kind == VARINT and field.name != "schema":
            return self._integer(lo, hi)
        return self._constant(value)  # texts, flags, the schema

    def _integer(self, lo: int, hi: int) -> str:
        """A varint of as many bytes; never negative, for that takes ten."""
        if hi - lo > 4:
            raise Unteachable
        parts = [self._value("B", at, at + 1) for at in range(lo, hi)]
        self._doubts += [f"{part} < 128" for part in parts[:-1]]
        self._doubts.append(f"{parts[-1]} > 127")
        terms = [f"({part} & 127) << {7 * i}" if i else f"({part} & 127)" for i, part in enumerate(parts)]
        return f"({' | '.join(terms)})"

    def _array(self, field: Field, value: Any, lo: int, hi: int) -> str:
        if value.size == 0:
            return self._empty(value)
        array = field.of
        data = fields_between(self._data, lo, hi)
        if 3 not in data or array.dtype.kind != "f":
            raise Unteachable
        part = self._value(f"{value.nbytes}s", data[3][1], data[3][2])
        if array.unbounded:
            self._doubts.append(f"not ndarray({value.size}, {self._constant(array.dtype)}, {part}).min() > -infinity")
        elif value.nbytes <= _SMALL:
            self._small.append(part)
        else:
            self._doubts.append(f"suspicious([{part}])")
        return f"ndarray({value.shape}, {self._constant(array.dtype)}, bytearray({part}))"

    def _empty(self, value: Any) -> str:
        return f"zeros({value.shape}, {self._constant(value.dtype)})"

    def _constant(self, value: Any) -> str:
        name = f"c{len(self._names)}"
        self._names[name] = value
        return name

    def _value(self, code: str, lo: int, hi: int) -> str:
        """A value at data[lo:hi]; what is between it and the last one stays as it is."""
        self._keep(lo)
        self._format.append(code)
        self._at = hi
        self._n += 1
        return f"v[{self._n - 1}]"

    def _keep(self, end: int) -> None:
        if end > self._at:
            self._format.append(f"{end - self._at}s")
            self._fixed.append(self._n)
            self._at = end
            self._n += 1
