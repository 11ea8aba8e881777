"""The protobuf form of the messages, derived from their annotations: fields, descriptors, generated classes.

Field 1 of every protobuf message is `message_type`, set on the outermost message only: a payload names itself, so
that it can be recorded verbatim and read by any language. The package name carries the schema version.
"""

import dataclasses
import sys
import types
import typing
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from softseam_protocol.messages import header, participant, pile, recording, session
from softseam_protocol.messages.arrays import Array, Least, Name
from softseam_protocol.messages.header import SCHEMA_VERSION

PACKAGE = f"softseam.v{SCHEMA_VERSION}"
FILE_NAME = "softseam.proto"
TENSOR = f"{PACKAGE}.Tensor"

_Proto = descriptor_pb2.FieldDescriptorProto
_SCALARS: dict[type, Any] = {
    int: _Proto.TYPE_INT64,
    float: _Proto.TYPE_DOUBLE,
    bool: _Proto.TYPE_BOOL,
    str: _Proto.TYPE_STRING,
    bytes: _Proto.TYPE_BYTES,
}


@dataclass(frozen=True)
class Field:
    """One field of a message: `of` is its Python type, an Array, a StrEnum, or another message class."""

    name: str
    number: int
    of: Any
    container: str = ""
    """'', 'list' or 'map' (of `key` to `of`)"""
    key: Any = str
    """of a map: str, or a StrEnum"""
    optional: bool = False
    """may be None"""
    default: Any = None
    has_default: bool = False
    make_default: Any = None
    """makes the default of an array or a container"""
    least: int | None = None
    named: Name | None = None
    """of a text that must be a name, or an id"""

    @property
    def is_array(self) -> bool:
        return isinstance(self.of, Array)

    @property
    def is_enum(self) -> bool:
        """A text that is one of a few."""
        return isinstance(self.of, type) and issubclass(self.of, StrEnum)

    @property
    def is_message(self) -> bool:
        return dataclasses.is_dataclass(self.of)

    @property
    def has_presence(self) -> bool:
        """A scalar whose absence means its default."""
        return not (self.container or self.is_array or self.is_message) and self.has_default


def _unwrap(annotation: Any) -> tuple[Any, int | None, Name | None]:
    """The type that a field or element holds, its least value, and which name it must be."""
    least, named = None, None
    if typing.get_origin(annotation) is typing.Annotated:
        of, *notes = typing.get_args(annotation)
        for note in notes:
            if isinstance(note, Array):
                return note, None, None
            if isinstance(note, Least):
                least = note.value
            if isinstance(note, Name):
                named = note
        annotation = of
    return annotation, least, named


def _field(name: str, number: int, annotation: Any, default: Any, make_default: Any) -> Field:
    optional, container, key = False, "", str
    if typing.get_origin(annotation) in (types.UnionType, typing.Union):
        (annotation,) = (a for a in typing.get_args(annotation) if a is not types.NoneType)
        optional = True
    if typing.get_origin(annotation) is list:
        (annotation,), container = typing.get_args(annotation), "list"
    elif typing.get_origin(annotation) is dict:
        (key, annotation), container = typing.get_args(annotation), "map"
    of, least, named = _unwrap(annotation)
    is_enum = isinstance(of, type) and issubclass(of, StrEnum)
    if not (isinstance(of, Array) or of in _SCALARS or is_enum or dataclasses.is_dataclass(of)):
        raise TypeError(f"{name}: no wire form for {annotation!r}")
    has_default = default is not dataclasses.MISSING
    if make_default is dataclasses.MISSING:
        make_default = None
    if not has_default:
        default = None
    return Field(name, number, of, container, key, optional, default, has_default, make_default, least, named)


def _fields(cls: type) -> tuple[Field, ...]:
    # explicit namespaces: a slot named `bytes` would otherwise shadow the type of that name
    hints = typing.get_type_hints(cls, globalns=vars(sys.modules[cls.__module__]), localns={}, include_extras=True)
    # number 1 is message_type
    return tuple(
        _field(f.name, i, hints[f.name], f.default, f.default_factory)
        for i, f in enumerate(dataclasses.fields(cls), start=2)
    )


MESSAGES: dict[str, type] = {
    name: value
    for module in (header, pile, participant, session, recording)
    for name, value in vars(module).items()
    if isinstance(value, type) and dataclasses.is_dataclass(value) and value.__module__ == module.__name__
}
FIELDS: dict[type, tuple[Field, ...]] = {cls: _fields(cls) for cls in MESSAGES.values()}


def full_name(cls: type) -> str:
    """Name of a message in protobuf and in recordings, e.g. `softseam.v1.StepReport`."""
    return f"{PACKAGE}.{cls.__name__}"


def _declare(proto: Any, field: Field) -> None:
    """Append `field` to the descriptor of a message."""
    if field.is_array:
        kind, type_name = _Proto.TYPE_MESSAGE, "." + TENSOR
    elif field.is_message:
        kind, type_name = _Proto.TYPE_MESSAGE, "." + full_name(field.of)
    else:
        kind, type_name = _SCALARS[str if field.is_enum else field.of], None
    label = _Proto.LABEL_OPTIONAL
    if field.container == "map":
        entry = "".join(part.capitalize() for part in field.name.split("_")) + "Entry"
        nested = proto.nested_type.add(name=entry)
        nested.options.map_entry = True
        nested.field.add(name="key", number=1, type=_Proto.TYPE_STRING, label=label)
        nested.field.add(name="value", number=2, type=kind, label=label, type_name=type_name)
        kind, type_name = _Proto.TYPE_MESSAGE, f".{PACKAGE}.{proto.name}.{entry}"
    if field.container:
        label = _Proto.LABEL_REPEATED
    declared = proto.field.add(name=field.name, number=field.number, type=kind, label=label, type_name=type_name)
    if field.has_presence:
        declared.proto3_optional = True
        declared.oneof_index = len(proto.oneof_decl)
        proto.oneof_decl.add(name="_" + field.name)


def file_descriptor() -> Any:
    """The FileDescriptorProto of all messages."""
    file = descriptor_pb2.FileDescriptorProto(name=FILE_NAME, package=PACKAGE, syntax="proto3")
    tensor = file.message_type.add(name="Tensor")
    tensor.field.add(name="dtype", number=1, type=_Proto.TYPE_STRING, label=_Proto.LABEL_OPTIONAL)
    tensor.field.add(name="shape", number=2, type=_Proto.TYPE_UINT64, label=_Proto.LABEL_REPEATED)
    tensor.field.add(name="data", number=3, type=_Proto.TYPE_BYTES, label=_Proto.LABEL_OPTIONAL)
    for cls, fields in FIELDS.items():
        proto = file.message_type.add(name=cls.__name__)
        proto.field.add(name="message_type", number=1, type=_Proto.TYPE_STRING, label=_Proto.LABEL_OPTIONAL)
        for field in fields:
            _declare(proto, field)
    return file


def file_descriptor_set(cls: type) -> bytes:
    """The serialised FileDescriptorSet that describes `cls`, as MCAP's protobuf schemas want it."""
    if cls not in FIELDS:
        raise TypeError(f"{cls.__name__} is not a message")
    return bytes(descriptor_pb2.FileDescriptorSet(file=[file_descriptor()]).SerializeToString(deterministic=True))


_POOL = descriptor_pool.DescriptorPool()
_POOL.Add(file_descriptor())


def protobuf_class(name: str) -> Any:
    """The generated protobuf class of the message called `name` (without the package)."""
    return message_factory.GetMessageClass(_POOL.FindMessageTypeByName(f"{PACKAGE}.{name}"))


def shape_text(array: Array) -> str:
    """A declaration such as `f8 (n, 3)`."""
    axes = ", ".join("n" if n is None else str(n) for n in array.shape)
    return f"{array.name} ({axes}{',' if len(array.shape) == 1 else ''})"


def type_text(field: Field) -> str:
    """Type of a field as a .proto file writes it, label included."""
    if field.is_array:
        text = "Tensor"
    elif field.is_message:
        text = field.of.__name__
    else:
        texts = {int: "int64", float: "double", bool: "bool", str: "string", bytes: "bytes"}
        text = "string" if field.is_enum else texts[field.of]
    if field.container == "map":
        return f"map<string, {text}>"
    return {"list": "repeated "}.get(field.container, "optional " if field.has_presence else "") + text
