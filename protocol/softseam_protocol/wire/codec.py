"""Messages to bytes and back, with every check that keeps bad bytes out of a solver.

`encode(message)` gives plain protobuf (see `descriptors`); `decode(data, allowed)` gives the message, or raises
DecodeError or SchemaMismatch, never anything else. Decoded arrays own their memory and can be written to, so that a
kernel compiled for arrays of this process is the one that runs on arrays from the bus. Equal messages have equal bytes
in every process; maps come back sorted by key.
"""

from __future__ import annotations

import functools
import re
import types
import typing
from collections.abc import Callable
from operator import attrgetter
from typing import Any, TypeVar, overload

from google.protobuf.message import DecodeError as ProtobufDecodeError

from softseam_protocol.errors import DecodeError, EncodeError, SchemaMismatch
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.wire.descriptors import (
    FIELDS,
    MESSAGES,
    PACKAGE,
    Field,
    file_descriptor_set,
    full_name,
    protobuf_class,
)
from softseam_protocol.wire.fields import Wrong, field_reader, field_writer, is_name

__all__ = ["MAX_BYTES", "decode", "encode", "file_descriptor_set", "full_name", "is_name", "peek"]

MAX_BYTES = 256 * 2**20
"""largest message [B]"""

T = TypeVar("T")


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
        self._writers = [field_writer(f"{cls.__name__}.{f.name}", f, _form) for f in rest]
        self._get_all = _getter([f.name for f in self.fields])
        self._readers: list[tuple[int, Callable[[Any], Any]]] = []
        self._absent: list[tuple[int, str, Any]] = []
        self._defaulted: list[tuple[int, str, Any, Callable[[], Any]]] = []
        for i, f in enumerate(self.fields):
            read = field_reader(f"{cls.__name__}.{f.name}", f, _form)
            if f.is_array and not f.container and f.make_default is not None:
                self._defaulted.append((i, f.name, read, f.make_default))
            elif read is not None and not f.optional:
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
            except (TypeError, ValueError, OverflowError) as error:
                raise Wrong(f"{self.cls.__name__}.{name}: {error}") from None
        for write, value in zip(self._writers, self._get_rest(message), strict=True):
            write(wire, value)

    def read(self, wire: Any) -> Any:
        for name in self._required:
            if not wire.HasField(name):
                raise Wrong(f"{self.cls.__name__}.{name}: missing")
        values = list(self._get_all(wire))
        if self._is_header and values[0] != SCHEMA_VERSION:
            raise SchemaMismatch(_mismatch(f"{values[0]}"))
        for i, read in self._readers:
            values[i] = read(values[i])
        for i, name, read in self._optional:
            values[i] = read(values[i]) if wire.HasField(name) else None
        for i, name, read, make_default in self._defaulted:
            values[i] = read(values[i]) if wire.HasField(name) else make_default()
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
        data = bytes(form.new(message).SerializeToString(deterministic=True))
    except Wrong as error:
        raise EncodeError(str(error)) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise EncodeError(f"{type(message).__name__}: {error}") from None
    if len(data) > MAX_BYTES:
        raise EncodeError(f"{type(message).__name__}: {len(data)} bytes, more than the {MAX_BYTES} allowed")
    return data


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
    except Wrong as error:
        raise DecodeError(f"{cls.__name__}: {error}") from None
    except ProtobufDecodeError:
        raise DecodeError(f"{cls.__name__}: truncated or damaged bytes ({len(data)} B)") from None
