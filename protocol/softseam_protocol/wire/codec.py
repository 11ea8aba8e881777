"""Messages to bytes and back, with every check that keeps bad bytes out of a solver.

`encode(message)` gives plain protobuf (see `descriptors`); `decode(data, allowed)` gives the message, or raises
DecodeError or SchemaMismatch, never anything else. Decoded arrays own their memory and can be written to, so that a
kernel compiled for arrays of this process is the one that runs on arrays from the bus. Equal messages have equal bytes
in every process; maps come back sorted by key.
"""

import functools
import re
import types
import typing
from typing import Any, TypeVar, overload

from google.protobuf.message import DecodeError as ProtobufDecodeError

from softseam_protocol.errors import DecodeError, EncodeError
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.wire.descriptors import (
    FIELDS,
    MESSAGES,
    PACKAGE,
    file_descriptor_set,
    full_name,
    protobuf_class,
)
from softseam_protocol.wire.fields import Wrong, is_name
from softseam_protocol.wire.functions import functions_of, wrong_schema

__all__ = ["MAX_BYTES", "decode", "encode", "file_descriptor_set", "full_name", "is_name", "peek"]

MAX_BYTES = 256 * 2**20
"""largest message [B]"""

T = TypeVar("T")


# ---- one message class -----------------------------------------------------------------------------------


class _Form:
    """The wire form of one message class."""

    def __init__(self, cls: type) -> None:
        self.wire = protobuf_class(cls.__name__)
        self.type_name = full_name(cls)
        self.fill, self.read = functions_of(cls)


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
        wire = form.wire(message_type=form.type_name)
        form.fill(wire, message)
        data = bytes(wire.SerializeToString(deterministic=True))
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
        raise wrong_schema(version[1].decode())
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
