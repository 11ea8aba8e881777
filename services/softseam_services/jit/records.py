"""Named tuples of arrays that kernels take as one pointer.

A kernel that takes a tuple takes every array of it, as seven or more numbers each; one with a hundred arrays that calls
others with the same tuple compiles for minutes, and each call from Python unpacks all of them. Here the numbers lie in
one block of memory, laid out when the record is made, and a kernel loads what it names. The block never changes, so the
compiler may load a number once, before a loop. Arrays belong to the record; kernels borrow them.
"""

from __future__ import annotations

import hashlib
import operator
import struct
from collections.abc import Sequence
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_builtin,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)

_T = TypeVar("_T")
_WORD = ir.IntType(64)
_INTEGER, _DOUBLE = struct.Struct("q"), struct.Struct("d")


def record(declared: type[_T]) -> type[_T]:
    """Decorates a NamedTuple: its instances are records that kernels take by reference; fields read as before.

    Fields are arrays, numbers, truth values, or other records. Raises TypeError for any other value.
    """
    return cast(type[_T], type(declared.__name__, (_Record,), {"_declared": declared, "__doc__": declared.__doc__}))


class _Record:
    """Keeps the block of memory, and alive what it points to."""

    _declared: type[Any]
    _numba_type_: RecordType
    _address: int

    def __init__(self, *arguments: Any, **named: Any) -> None:
        values = self._declared(*arguments, **named)
        words: list[int] = []
        for name, value in zip(values._fields, values, strict=True):
            words += _words(name, value)
        block = np.array(words, dtype=np.int64)
        vars(self).update(
            values._asdict(), _block=block, _address=block.__array_interface__["data"][0], _numba_type_=_type_of(values)
        )

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{self._declared.__name__}.{name} is fixed: fill arrays in place, or use _replace")

    def _replace(self, **named: Any) -> Any:
        """Another record that differs in the fields named."""
        return type(self)(**{name: getattr(self, name) for name in self._declared._fields} | named)


class Rows:
    """Records of one type, which kernels take by one pointer: rows[i] is the record of that place there.

    Raises TypeError where they are not of one type.
    """

    def __init__(self, records: Sequence[Any]) -> None:
        self._records = tuple(records)
        kinds = {record._numba_type_.name for record in self._records}
        if len(kinds) != 1:
            raise TypeError(f"rows hold records of one type, not of {len(kinds)}")
        self._block = np.array([record._address for record in self._records], dtype=np.int64)
        self._address: int = self._block.__array_interface__["data"][0]
        self._numba_type_ = RowsType(self._records[0]._numba_type_)

    def __getitem__(self, place: int) -> Any:
        return self._records[place]

    def __len__(self) -> int:
        return len(self._records)


def n_bytes(record: object) -> int:
    """Of the arrays of a record, and of those of records in it."""
    parts = vars(record).values()
    arrays = sum(part.nbytes for part in parts if isinstance(part, np.ndarray))
    return arrays + sum(n_bytes(part) for part in parts if isinstance(part, _Record))


def _words(name: str, value: Any) -> list[int]:
    """A value as 64-bit numbers; an array as number and bytes of its items, address, shape, strides."""
    if isinstance(value, np.ndarray):
        return [value.size, value.itemsize, value.__array_interface__["data"][0], *value.shape, *value.strides]
    if isinstance(value, _Record):
        return [value._address]
    if isinstance(value, bool | int):
        return [int(value)]
    if isinstance(value, float):
        return [_INTEGER.unpack(_DOUBLE.pack(value))[0]]
    raise TypeError(f"{name} is {type(value).__name__}: records for kernels hold arrays, numbers and records")


_KNOWN: dict[tuple[object, ...], RecordType] = {}


def _type_of(values: Any) -> RecordType:
    """Numba's type of a record with these values. A record of a step's inputs is made each step, which cannot wait for
    numba to find the type of every value."""
    key = type(values), *map(_kind, values)
    if key not in _KNOWN:
        fields, place = [], 0
        for name, value in zip(values._fields, values, strict=True):
            fields.append((name, place, typeof(value)))
            place += len(_words(name, value))
        _KNOWN[key] = RecordType(type(values).__name__, tuple(fields))
    return _KNOWN[key]


def _kind(value: Any) -> object:
    """What the type of a value follows from."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    return value._numba_type_.name if isinstance(value, _Record) else type(value)


class RecordType(types.Type):
    """Numba's type of a record: fields are (name, place of the first word, type)."""

    def __init__(self, title: str, fields: tuple[tuple[str, int, types.Type], ...]) -> None:
        self.fields = {name: (place, kind) for name, place, kind in fields}
        digest = hashlib.sha256(repr(fields).encode()).hexdigest()[:16]
        super().__init__(name=f"{title}.{digest}")


class RowsType(types.Type):
    """Numba's type of rows of records."""

    def __init__(self, row: RecordType) -> None:
        self.row = row
        super().__init__(name=f"Rows.{row.name}")


register_model(RecordType)(models.OpaqueModel)
register_model(RowsType)(models.OpaqueModel)


@infer_global(operator.getitem)
class _RowOf(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if len(args) == 2 and isinstance(args[0], RowsType) and isinstance(args[1], types.Integer):
            return signature(args[0].row, args[0], types.intp)
        return None


@lower_builtin(operator.getitem, RowsType, types.intp)
def _load_row(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    block = builder.bitcast(args[0], _WORD.as_pointer())
    return builder.inttoptr(builder.load(builder.gep(block, [args[1]])), cgutils.voidptr_t)


@unbox(RowsType)
@unbox(RecordType)
def _unbox(kind: Any, record: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(record, "_address")
    word = c.pyapi.long_as_ulonglong(address)
    c.pyapi.decref(address)
    return NativeValue(c.builder.inttoptr(word, cgutils.voidptr_t))


@infer_getattr
class _Attributes(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, typ: Any, attr: str) -> Any:  # type: ignore[override]  # numba has NotImplemented there
        return typ.fields[attr][1] if attr in typ.fields else None


@lower_getattr_generic(RecordType)
def _load_field(context: Any, builder: Any, record: RecordType, pointer: Any, name: str) -> Any:
    place, kind = record.fields[name]
    block = builder.bitcast(pointer, _WORD.as_pointer())

    def word(offset: int) -> Any:
        value = builder.load(builder.gep(block, [_WORD(place + offset)]))
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        return value

    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        array.nitems, array.itemsize = word(0), word(1)
        array.data = builder.inttoptr(word(2), array.data.type)
        array.shape = cgutils.pack_array(builder, [word(3 + axis) for axis in range(kind.ndim)])
        array.strides = cgutils.pack_array(builder, [word(3 + kind.ndim + axis) for axis in range(kind.ndim)])
        return array._getvalue()
    if isinstance(kind, RecordType):
        return builder.inttoptr(word(0), cgutils.voidptr_t)
    if isinstance(kind, types.Boolean):
        return builder.icmp_signed("!=", word(0), _WORD(0))
    if isinstance(kind, types.Float):
        return builder.bitcast(word(0), ir.DoubleType())
    return word(0)
