"""Writes messages that are laid out like one before: same fields, shapes and texts, other numbers.

A message that was encoded teaches where its numbers stand. Another one with the same shapes and texts, and with numbers
that take as many bytes, is then one `struct` call: the bytes that protobuf would give. What does not fit, and whatever
is not what its field declares, is left to the codec.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np

from softseam_protocol.descriptors import FIELDS, Field
from softseam_protocol.learned import Learned
from softseam_protocol.wire_walk import BYTES, FIXED64, VARINT, Unteachable, fields_between

Writer = Callable[[Any], bytes | None]
"""the bytes of a message, or None where the codec has to look"""

_ALIKE = 16
"""layouts that are kept of one sender"""
_sender = attrgetter("header.session", "header.participant")


class WrittenLayouts:
    """The layouts in which messages of one class, which have a header, are written."""

    def __init__(self, cls: type) -> None:
        self._cls = cls
        self._optional = [field.name for field in FIELDS[cls] if field.optional]
        self._learned: Learned[tuple[str, str], Writer] = Learned(_ALIKE)

    def write(self, message: Any) -> bytes | None:
        """The message's bytes, or None if no layout fits."""
        try:
            sender = _sender(message)
            for writer in self._learned.known.get(sender, ()):
                data = writer(message)
                if data is not None:
                    self._learned.prefer(sender, writer)
                    return data
        except (AttributeError, TypeError, ValueError, OverflowError, struct.error):
            return None  # something in it is not what its field declares: the codec's text says what
        return None

    def meet(self, data: bytes, message: Any) -> None:
        """Learn from a message that the codec had to encode as `data`."""
        if any(getattr(message, name) is not None for name in self._optional):
            return
        self._learned.meet(_sender(message), lambda: _Lesson(data).writer(self._cls, message))


class _Lesson:
    """Walks a message beside its bytes and writes the function that encodes its like."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._format = ["<"]
        self._parts: list[str] = []
        """expressions that the format takes"""
        self._at = self._n_locals = 0
        self._tests: list[str] = []
        """what makes a message alike, in the order in which it is tested"""
        self._zeros: list[str] = []
        """numbers that are 0.0, which is left out, or -0.0, which is not"""
        self._signs = b""
        """their bytes"""
        self._names: dict[str, Any] = {"ndarray": np.ndarray}

    def writer(self, cls: type, message: Any) -> Writer | None:
        try:
            self._message(cls, message, "m", 0, len(self._data))
        except Unteachable:
            return None
        self._keep(len(self._data))
        if self._zeros:
            zeros = self._constant(struct.Struct(f"<{len(self._zeros)}d").pack)
            self._tests.append(f"{zeros}({', '.join(self._zeros)}) == {self._signs!r}")
        self._names["pack"] = struct.Struct("".join(self._format)).pack
        same = " and ".join(self._tests)
        exec(f"def write(m):\n    return pack({', '.join(self._parts)}) if {same} else None\n", self._names)
        write: Writer = self._names["write"]  # every name in it is ours
        return write if write(message) == self._data else None

    def _message(self, cls: type, message: Any, name: str, begin: int, end: int) -> None:
        """Walk a message that the function calls `name`; its bytes are data[begin:end]."""
        if any(field.container or field.of is bytes for field in FIELDS[cls]):
            raise Unteachable
        found = fields_between(self._data, begin, end)
        numbers = [number for number in found if number > 1]  # 1 is the message's type
        if numbers != sorted(numbers):
            raise Unteachable
        for field in FIELDS[cls]:
            value, expression = getattr(message, field.name), f"{name}.{field.name}"
            at = found.get(field.number)
            if at is None:
                self._absent(field, value, expression)
            else:
                self._present(field, value, expression, *at)

    def _absent(self, field: Field, value: Any, expression: str) -> None:
        """A field that was left out stays out only as long as it is the same."""
        if field.is_array:
            self._tests.append(f"type({self._local(expression)}) is ndarray and {self._last}.shape == {value.shape}")
        elif field.is_message:
            self._tests.append(f"{expression} is None")
        elif field.has_presence:
            raise Unteachable
        elif field.of is float:
            self._zero(value, expression)
        elif field.of is int:
            self._tests.append(f"type({self._local(expression)}) is int and {self._last} == 0")
        else:
            self._same(field, value, expression)

    def _present(self, field: Field, value: Any, expression: str, kind: int, lo: int, hi: int) -> None:
        if field.is_message:
            self._tests.append(f"type({self._local(expression)}) is {self._constant(field.of)}")
            self._message(field.of, value, self._last, lo, hi)
        elif field.is_array:
            self._array(field, value, expression, lo, hi)
        elif field.of is float and kind == FIXED64:
            if value == 0.0 and not field.has_presence:
                self._zero(value, expression)
            else:
                test = f"isinstance({self._local(expression)}, float)"
                self._tests.append(test if field.has_presence else f"{test} and {self._last} != 0.0")
                self._value("d", self._last, lo, hi)
        elif field.of is int and kind == VARINT:
            self._integer(field, expression, lo, hi)
        else:
            self._same(field, value, expression)

    def _zero(self, value: float, expression: str) -> None:
        self._tests.append(f"isinstance({self._local(expression)}, float)")
        self._zeros.append(self._last)
        self._signs += struct.pack("<d", value)

    def _same(self, field: Field, value: Any, expression: str) -> None:
        """Texts and flags are part of the layout."""
        compare = "is" if field.of is bool else "=="
        self._tests.append(f"{expression} {compare} {self._constant(value)}")

    def _integer(self, field: Field, expression: str, lo: int, hi: int) -> None:
        """A varint of as many bytes; never negative, for that takes ten."""
        n = hi - lo
        if n > 4:
            raise Unteachable
        least = 128 ** (n - 1) if n > 1 or not field.has_presence else 0  # 0 is left out unless it has presence
        self._tests.append(f"type({self._local(expression)}) is int and {least} <= {self._last} < {128**n}")
        name = self._last
        for i in range(n - 1):
            self._value("B", f"{name} >> {7 * i} & 127 | 128", lo + i, lo + i + 1)
        self._value("B", f"{name} >> {7 * (n - 1)}" if n > 1 else name, hi - 1, hi)

    def _array(self, field: Field, value: Any, expression: str, lo: int, hi: int) -> None:
        dtype = self._constant(field.of.dtype)
        self._tests.append(
            f"type({self._local(expression)}) is ndarray and {self._last}.shape == {value.shape}"
            f" and {self._last}.dtype == {dtype}"
        )
        if value.size:
            kind, begin, end = fields_between(self._data, lo, hi)[3]
            assert kind == BYTES
            self._value(f"{value.nbytes}s", f"{self._last}.tobytes()", begin, end)

    def _local(self, expression: str) -> str:
        """Bind what is used more than once; its name is `_last`."""
        self._n_locals += 1
        self._last = f"x{self._n_locals}"
        return f"{self._last} := {expression}"

    def _constant(self, value: Any) -> str:
        name = f"c{len(self._names)}"
        self._names[name] = value
        return name

    def _value(self, code: str, expression: str, lo: int, hi: int) -> None:
        """A value at data[lo:hi]; what is between it and the last one stays as it is."""
        self._keep(lo)
        self._format.append(code)
        self._parts.append(expression)
        self._at = hi

    def _keep(self, end: int) -> None:
        if end > self._at:
            self._format.append(f"{end - self._at}s")
            self._parts.append(repr(self._data[self._at : end]))
            self._at = end
