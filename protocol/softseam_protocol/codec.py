"""Messages to bytes and back, with every check that keeps bad bytes out of a solver.

`encode(message)` gives plain protobuf (see `descriptors`); `decode(data, allowed)` gives the message, or raises
DecodeError or SchemaMismatch, never anything else. Decoded arrays own their memory and can be written to, so that a
kernel compiled for arrays of this process is the one that runs on arrays from the bus. Equal messages have equal bytes
in every process; maps come back sorted by key.
"""

from __future__ import annotations

import functools
import math
import re
import types
import typing
from collections.abc import Callable
from operator import attrgetter
from typing import Any, TypeVar, overload

import numpy as np
from google.protobuf.message import DecodeError as ProtobufDecodeError

from softseam_protocol.descriptors import (
    FIELDS,
    MESSAGES,
    PACKAGE,
    Field,
    file_descriptor_set,
    full_name,
    protobuf_class,
    shape_text,
)
from softseam_protocol.errors import DecodeError, EncodeError, SchemaMismatch
from softseam_protocol.messages import SCHEMA_VERSION, Array, Header

__all__ = ["MAX_BYTES", "decode", "encode", "file_descriptor_set", "full_name", "is_name", "peek"]

MAX_BYTES = 256 * 2**20
"""largest message [B]"""
_MAX_AXIS = 2**31

T = TypeVar("T")
_NAME = re.compile(r"[A-Za-z0-9_-]{0,64}")


class _Wrong(Exception):
    """A field's value is not allowed; the text names class, field and reason."""


@functools.lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Whether a text may stand in a key expression or a file name (empty: not given)."""
    return _NAME.fullmatch(text) is not None


# ---- one array -------------------------------------------------------------------------------------------


def _array_writer(where: str, array: Array) -> Callable[[Any, Any], None]:
    """Fill a Tensor message from an array that must be what the field declares."""
    name, dtype, rank = array.name, array.dtype, len(array.shape)
    fixed = tuple((axis, n) for axis, n in enumerate(array.shape) if n is not None)

    def write(tensor: Any, value: Any) -> None:
        if not (isinstance(value, np.ndarray) and value.dtype == dtype and value.ndim == rank):
            found = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
            raise _Wrong(f"{where}: {found} where {shape_text(array)} belongs")
        for axis, n in fixed:
            if value.shape[axis] != n:
                raise _Wrong(f"{where}: shape {value.shape} where {shape_text(array)} belongs")
        tensor.dtype = name
        tensor.shape.extend(value.shape)
        tensor.data = value.tobytes()

    return write


def _array_reader(where: str, array: Array) -> Callable[[Any], Any]:
    """Take an array from a Tensor message, refusing what the field does not declare."""
    name, dtype, rank = array.name, array.dtype, len(array.shape)
    itemsize, is_float = dtype.itemsize, dtype.kind == "f"
    fixed = tuple((axis, n) for axis, n in enumerate(array.shape) if n is not None)
    # vdot, for dot warns when it overflows
    frombuffer, vdot = np.frombuffer, np.vdot

    def check_floats(values: Any) -> None:
        """The exact test, after the fast one raised a suspicion."""
        bad = np.isnan(values) | (values == -np.inf) if array.unbounded else ~np.isfinite(values)
        if bad.any():
            raise _Wrong(f"{where}: entry {int(np.argmax(bad))} is {values[np.argmax(bad)]}, not a finite number")

    def read(tensor: Any) -> Any:
        if tensor.dtype != name:
            if not tensor.dtype:
                raise _Wrong(f"{where}: missing")
            raise _Wrong(f"{where}: dtype {tensor.dtype[:16]!r} where {name!r} belongs")
        shape, data = tensor.shape, tensor.data
        if len(shape) != rank:
            raise _Wrong(f"{where}: {len(shape)} axes where {shape_text(array)} belongs")
        shape = tuple(shape)
        for axis, n in fixed:
            if shape[axis] != n:
                raise _Wrong(f"{where}: shape {shape} where {shape_text(array)} belongs")
        if math.prod(shape) * itemsize != len(data):
            raise _Wrong(f"{where}: shape {shape} needs {math.prod(shape) * itemsize} bytes, but {len(data)} came")
        if not data:
            if max(shape) >= _MAX_AXIS:
                raise _Wrong(f"{where}: shape {shape} has an axis that is too long")
            return np.zeros(shape, dtype)
        values = frombuffer(bytearray(data), dtype)
        if is_float:
            # the squares' sum is finite only if every entry is; overflow is settled by the exact test
            if not math.isfinite(vdot(values, values)):
                check_floats(values)
        elif array.least is not None and values.min() < array.least:
            raise _Wrong(f"{where}: entry {int(values.argmin())} is {values.min()}, less than {array.least}")
        return values.reshape(shape)

    return read


# ---- one field -------------------------------------------------------------------------------------------


def _scalar_check(where: str, field: Field) -> Callable[[Any], Any] | None:
    """Check of one decoded scalar, or None if any value will do."""
    if field.of is float:

        def check_float(value: float) -> float:
            if not math.isfinite(value):
                raise _Wrong(f"{where}: {value} is not a finite number")
            return value

        return check_float
    if field.least is not None:
        least = field.least

        def check_least(value: int) -> int:
            if value < least:
                raise _Wrong(f"{where}: {value} is less than {least}")
            return value

        return check_least
    if field.named:

        def check_name(value: str) -> str:
            if not is_name(value):
                raise _Wrong(f"{where}: {value[:80]!r} is not a name (letters, digits, _ and -, at most 64)")
            return value

        return check_name
    return None


def _element_reader(where: str, field: Field) -> Callable[[Any], Any] | None:
    if isinstance(field.of, Array):
        return _array_reader(where, field.of)
    if field.is_message:
        # resolved at the first call: classes may come in any order
        of = field.of
        return lambda wire: _form(of).read(wire)
    return _scalar_check(where, field)


def _field_reader(where: str, field: Field) -> Callable[[Any], Any] | None:
    one = _element_reader(where, field)
    if field.container == "list":
        return lambda wire: [one(item) for item in wire] if one else list(wire)
    if field.container == "map":
        # by key: protobuf's own order differs from process to process
        return lambda wire: {k: one(wire[k]) if one else wire[k] for k in sorted(wire)}
    return one


def _element_writer(where: str, field: Field) -> Callable[[Any, Any], None]:
    if isinstance(field.of, Array):
        return _array_writer(where, field.of)
    of = field.of

    def write(wire: Any, value: Any) -> None:
        if type(value) is not of:
            raise _Wrong(f"{where}: {type(value).__name__} where {of.__name__} belongs")
        wire.SetInParent()
        _form(of).fill(wire, value)

    return write


def _field_writer(where: str, field: Field) -> Callable[[Any, Any], None]:
    """Write a field's value into the message that holds it."""
    name = field.name
    scalar = not (field.is_array or field.is_message)
    if scalar and field.container == "map":
        return lambda wire, value: getattr(wire, name).update(value)
    if scalar:
        return lambda wire, value: getattr(wire, name).extend(value)
    write = _element_writer(where, field)
    if field.container == "map":

        def write_map(wire: Any, value: Any) -> None:
            entries = getattr(wire, name)
            for key, item in value.items():
                write(entries[key], item)

        return write_map
    if field.container == "list":

        def write_list(wire: Any, value: Any) -> None:
            items = getattr(wire, name)
            for item in value:
                write(items.add(), item)

        return write_list
    if field.optional:

        def write_optional(wire: Any, value: Any) -> None:
            if value is not None:
                write(getattr(wire, name), value)

        return write_optional
    return lambda wire, value: write(getattr(wire, name), value)


# ---- one message class -----------------------------------------------------------------------------------


def _getter(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    if not names:
        return lambda _: ()
    if len(names) == 1:
        get = attrgetter(names[0])
        return lambda message: (get(message),)
    return attrgetter(*names)


class _Form:
    """The precomputed wire form of one message class."""

    def __init__(self, cls: type) -> None:
        self.cls = cls
        self.wire = protobuf_class(cls.__name__)
        self.type_name = full_name(cls)
        self.fields = FIELDS[cls]
        rest = [f for f in self.fields if f.is_array or f.is_message or f.container]
        self._scalars = [f.name for f in self.fields if f not in rest]
        self._get_scalars = _getter(self._scalars)
        self._get_rest = _getter([f.name for f in rest])
        self._writers = [_field_writer(f"{cls.__name__}.{f.name}", f) for f in rest]
        self._get_all = _getter([f.name for f in self.fields])
        self._readers: list[tuple[int, Callable[[Any], Any]]] = []
        self._absent: list[tuple[int, str, Any]] = []
        for i, f in enumerate(self.fields):
            read = _field_reader(f"{cls.__name__}.{f.name}", f)
            if read is not None and not f.optional:
                self._readers.append((i, read))
            if f.has_presence:
                self._absent.append((i, f.name, f.default))
        self._optional = [(i, f.name, _form_reader(f)) for i, f in enumerate(self.fields) if f.optional]
        self._required = [f.name for f in self.fields if f.is_message and not (f.optional or f.container)]
        self._is_header = cls is Header

    def new(self, message: Any) -> Any:
        """The protobuf message for an outermost message."""
        wire = self.wire(message_type=self.type_name)
        self.fill(wire, message)
        return wire

    def fill(self, wire: Any, message: Any) -> None:
        for name, value in zip(self._scalars, self._get_scalars(message), strict=True):
            try:
                setattr(wire, name, value)
            except (TypeError, ValueError) as error:
                raise _Wrong(f"{self.cls.__name__}.{name}: {error}") from None
        for write, value in zip(self._writers, self._get_rest(message), strict=True):
            write(wire, value)

    def read(self, wire: Any) -> Any:
        for name in self._required:
            if not wire.HasField(name):
                raise _Wrong(f"{self.cls.__name__}.{name}: missing")
        values = list(self._get_all(wire))
        if self._is_header and values[0] != SCHEMA_VERSION:
            raise SchemaMismatch(_mismatch(f"{values[0]}"))
        for i, read in self._readers:
            values[i] = read(values[i])
        for i, name, read in self._optional:
            values[i] = read(values[i]) if wire.HasField(name) else None
        for i, name, default in self._absent:
            if not wire.HasField(name):
                values[i] = default
        return self.cls(*values)


def _form_reader(field: Field) -> Callable[[Any], Any]:
    of = field.of
    return lambda wire: _form(of).read(wire)


_FORMS: dict[type, _Form] = {}


def _form(cls: type) -> _Form:
    form = _FORMS.get(cls)
    if form is None:
        if cls not in FIELDS:
            raise EncodeError(f"{cls.__name__} is not a message")
        form = _FORMS[cls] = _Form(cls)
    return form


# ---- public ----------------------------------------------------------------------------------------------


def encode(message: Any) -> bytes:
    """The bytes of a message. Raises EncodeError if a field is not what it is declared to be."""
    form = _form(type(message))
    try:
        data = form.new(message).SerializeToString(deterministic=True)
    except _Wrong as error:
        raise EncodeError(str(error)) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise EncodeError(f"{type(message).__name__}: {error}") from None
    if len(data) > MAX_BYTES:
        raise EncodeError(f"{type(message).__name__}: {len(data)} bytes, more than the {MAX_BYTES} allowed")
    return bytes(data)


_BY_TYPE_NAME = {full_name(cls).encode(): cls for cls in MESSAGES.values()}
_Probe = protobuf_class("Released")
_VERSION = re.compile(rb"softseam\.v(\d{1,9})\.")


def _mismatch(theirs: str) -> str:
    return (
        f"the other side speaks schema version {theirs}, this one speaks {SCHEMA_VERSION}: "
        "install the same version of softseam on both"
    )


def _type_name(data: bytes) -> bytes:
    # the usual case: field 1 comes first and is shorter than 128 bytes
    if len(data) > 2 and data[0] == 0x0A and data[1] < 0x80:
        return data[2 : 2 + data[1]]
    try:
        return bytes(_Probe.FromString(data).message_type.encode())
    except (ProtobufDecodeError, UnicodeError):
        return b""


def peek(data: bytes) -> type:
    """The class of an encoded message. Raises DecodeError or SchemaMismatch."""
    if len(data) > MAX_BYTES:
        raise DecodeError(f"{len(data)} bytes, more than the {MAX_BYTES} allowed for a message")
    name = _type_name(data)
    cls = _BY_TYPE_NAME.get(name)
    if cls is not None:
        return cls
    version = _VERSION.match(name)
    if version is not None and int(version[1]) != SCHEMA_VERSION:
        raise SchemaMismatch(_mismatch(version[1].decode()))
    if name.startswith(PACKAGE.encode() + b"."):
        raise DecodeError(f"unknown message type {name.decode(errors='replace')!r}")
    raise DecodeError(f"{len(data)} bytes that are not a softseam message")


@functools.lru_cache(maxsize=256)
def _classes(allowed: Any) -> tuple[type, ...]:
    if isinstance(allowed, types.UnionType):
        return typing.get_args(allowed)
    return allowed if isinstance(allowed, tuple) else (allowed,)


@overload
def decode(data: bytes, allowed: type[T]) -> T: ...
@overload
def decode(data: bytes, allowed: types.UnionType | tuple[type, ...] | None = None) -> Any: ...
def decode(data: bytes, allowed: Any = None) -> Any:
    """The message in `data`; `allowed` is a class, a union or a tuple of classes, or None for any message.

    Raises SchemaMismatch if the other side speaks another version, DecodeError for everything else.
    """
    data = bytes(data)
    cls = peek(data)
    if allowed is not None and cls not in _classes(allowed):
        wanted = ", ".join(c.__name__ for c in _classes(allowed))
        raise DecodeError(f"a message of type {cls.__name__} where one of these belongs: {wanted}")
    form = _form(cls)
    try:
        return form.read(form.wire.FromString(data))
    except _Wrong as error:
        raise DecodeError(f"{cls.__name__}: {error}") from None
    except ProtobufDecodeError:
        raise DecodeError(f"{cls.__name__}: truncated or damaged bytes ({len(data)} B)") from None
