"""The two functions of a message class, made as source from its fields, as dataclasses make `__init__`.

`fill(wire, message)` writes a message into its protobuf form, `read(wire)` takes one from it with every check that its
fields declare. Loops over the fields in their place take 1.35 times as long (docs/decisions/32).
"""

import math
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from softseam_protocol.errors import SchemaMismatch
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.wire.descriptors import FIELDS, Field
from softseam_protocol.wire.fields import Wrong, array_reader, array_writer, scalar_check, wrong_float

Fill = Callable[[Any, Any], None]
Read = Callable[[Any], Any]


def wrong_schema(theirs: object) -> SchemaMismatch:
    """What a message of another schema version is refused with."""
    return SchemaMismatch(
        f"the other side speaks schema version {theirs}, this one speaks {SCHEMA_VERSION}: "
        "install the same version of softseam on both"
    )


def _wrong_scalar(wire: Any, message: Any, names: tuple[str, ...]) -> Wrong:
    """Which of the scalars protobuf does not take."""
    for name in names:
        try:
            setattr(wire, name, getattr(message, name))
        except (TypeError, ValueError, OverflowError) as error:
            return Wrong(f"{type(message).__name__}.{name}: {error}")
    return Wrong(type(message).__name__)


def _wrong_class(where: str, value: object, cls: type) -> Wrong:
    return Wrong(f"{where}: {type(value).__name__} where {cls.__name__} belongs")


_MADE: dict[str, Any] = {
    "Wrong": Wrong,
    "isfinite": math.isfinite,
    "wrong_class": _wrong_class,
    "wrong_float": wrong_float,
    "wrong_scalar": _wrong_scalar,
    "wrong_schema": wrong_schema,
}
"""all functions made so far, and what they call: those of nested messages find each other here"""
_making = threading.Lock()


def functions_of(cls: type) -> tuple[Fill, Read]:
    """`fill` and `read` of a message class."""
    with _making:
        _make(cls)
    return _MADE[f"fill_{cls.__name__}"], _MADE[f"read_{cls.__name__}"]


def _make(cls: type) -> None:
    """Make both, and those of all that a message may hold."""
    if cls.__name__ in _MADE:
        return
    _MADE[cls.__name__] = cls
    for field in FIELDS[cls]:
        if field.is_message:
            _make(field.of)
    exec("\n".join([*_fill_source(cls), *_read_source(cls)]), _MADE)


def _is_scalar(field: Field) -> bool:
    return not (field.is_array or field.is_message or field.container)


def _given(name: str, value: Any) -> str:
    """The name by which the source finds a value."""
    _MADE[name] = value
    return name


# ---- writing ---------------------------------------------------------------------------------------------


def _fill_source(cls: type) -> list[str]:
    scalars = tuple(field.name for field in FIELDS[cls] if _is_scalar(field))
    lines = ["    try:", "        pass"]
    lines += [f"        wire.{name} = message.{name}" for name in scalars]
    lines += ["    except (TypeError, ValueError, OverflowError):"]
    lines += [f"        raise wrong_scalar(wire, message, {scalars!r}) from None"]
    for field in FIELDS[cls]:
        if not _is_scalar(field):
            lines += [f"    {line}" for line in _written(cls, field)]
    return [f"def fill_{cls.__name__}(wire, message):", *lines]


def _written(cls: type, field: Field) -> list[str]:
    name, where = field.name, f"{cls.__name__}_{field.name}"
    if not (field.is_array or field.is_message):
        return [f"wire.{name}.{'update' if field.container == 'map' else 'extend'}(message.{name})"]
    if field.is_array:
        write = _given(f"write_{where}", array_writer(f"{cls.__name__}.{name}", field.of))
        one = [f"{write}(into, value)"]
    else:
        of = field.of.__name__
        one = [
            f"if type(value) is not {of}:",
            f"    raise wrong_class('{cls.__name__}.{name}', value, {of})",
            "into.SetInParent()",
            f"fill_{of}(into, value)",
        ]
    if field.container == "map":
        each = [f"entries = wire.{name}", f"for key, value in message.{name}.items():", "    into = entries[key]"]
    elif field.container == "list":
        each = [f"for value in message.{name}:", f"    into = wire.{name}.add()"]
    elif field.optional:
        each = [f"value = message.{name}", "if value is not None:", f"    into = wire.{name}"]
    elif field.is_array and field.make_default is not None and field.make_default().size == 0:
        # an empty default need not travel: its absence means the same
        empty = field.make_default().shape
        each = [f"value = message.{name}", f"if getattr(value, 'shape', None) != {empty!r}:", f"    into = wire.{name}"]
    else:
        return [f"value, into = message.{name}, wire.{name}", *one]
    return [*each, *(f"    {line}" for line in one)]


# ---- reading ---------------------------------------------------------------------------------------------


def _read_source(cls: type) -> list[str]:
    fields = FIELDS[cls]
    lines = [line for field in fields for line in _taken(cls, field)]
    floats = tuple(field.name for field in fields if _is_scalar(field) and field.of is float)
    if floats:
        # a sum is finite only if all are; where it overflows the exact test settles it
        lines.append(f"if not isfinite({' + '.join(f'wire.{name}' for name in floats)}):")
        lines.append(f"    wrong_float({cls.__name__!r}, wire, {floats!r})")
    if cls is Header:
        lines += [f"if v_schema != {SCHEMA_VERSION}:", "    raise wrong_schema(v_schema)"]
    lines.append(f"return {cls.__name__}({', '.join(f'v_{field.name}' for field in fields)})")
    return [f"def read_{cls.__name__}(wire):", *(f"    {line}" for line in lines)]


def _taken(cls: type, field: Field) -> list[str]:
    """Lines that give `v_NAME`."""
    name, where = field.name, f"{cls.__name__}_{field.name}"
    take = _taker(cls, field)
    if field.container == "map":
        # by key: protobuf's own order differs from process to process
        key = "key"
        if field.key is not str:
            check = scalar_check(f"{cls.__name__}.{name}", replace(field, of=field.key))
            key = f"{_given(f'check_key_{where}', check)}(key)"
        return [f"entries = wire.{name}", f"v_{name} = {{{key}: {take('entries[key]')} for key in sorted(entries)}}"]
    if field.container == "list":
        return [f"v_{name} = [{take('item')} for item in wire.{name}]"]
    here = take(f"wire.{name}")
    if field.optional:
        return [f"v_{name} = {here} if wire.HasField({name!r}) else None"]
    if field.is_array and field.make_default is not None:
        default = _given(f"default_{where}", field.make_default)
        return [f"v_{name} = {here} if wire.HasField({name!r}) else {default}()"]
    if field.is_message:
        missing = f"    raise Wrong('{cls.__name__}.{name}: missing')"
        return [f"if not wire.HasField({name!r}):", missing, f"v_{name} = {here}"]
    if field.has_presence and not (here == f"wire.{name}" and type(field.default) in _ZEROS and not field.default):
        default = _given(f"default_{where}", field.default)
        return [f"v_{name} = {here} if wire.HasField({name!r}) else {default}"]
    return [f"v_{name} = {here}"]


_ZEROS = (int, float, bool, str, bytes)
"""types of which protobuf gives the zero where a field is absent"""


def _taker(cls: type, field: Field) -> Callable[[str], str]:
    """The expression that takes one value from the expression of its protobuf form."""
    where, text = f"{cls.__name__}_{field.name}", f"{cls.__name__}.{field.name}"
    if field.is_message:
        return lambda wire: f"read_{field.of.__name__}({wire})"
    if field.is_array:
        take = _given(f"take_{where}", array_reader(text, field.of))
        return lambda wire: f"{take}({wire})"
    check = scalar_check(text, field)
    if check is None or (field.of is float and not field.container):  # all floats are checked at once
        return lambda wire: wire
    checked = _given(f"check_{where}", check)
    return lambda wire: f"{checked}({wire})"
