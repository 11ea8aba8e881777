"""How one field is written to and read from its protobuf message, with the checks that it declares."""

import functools
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from softseam_protocol.messages.arrays import Array
from softseam_protocol.wire.descriptors import Field, shape_text

_MAX_AXIS = 2**31
_NAME = re.compile(r"[A-Za-z0-9_-]{0,64}")


class Wrong(Exception):
    """A field's value is not allowed; the text names class, field and reason."""


@functools.lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Whether a text may stand in a key expression or a file name (empty: not given)."""
    return _NAME.fullmatch(text) is not None


def is_id(text: str) -> bool:
    """Whether a text is two names with a dot between them."""
    head, dot, tail = text.partition(".")
    return bool(head and dot and tail) and is_name(head) and is_name(tail)


# ---- one array -------------------------------------------------------------------------------------------


def array_writer(where: str, array: Array) -> Callable[[Any, Any], None]:
    """Fills a Tensor message from an array that must be what the field declares."""
    name, dtype, rank = array.name, array.dtype, len(array.shape)
    fixed = tuple((axis, n) for axis, n in enumerate(array.shape) if n is not None)

    def write(tensor: Any, value: Any) -> None:
        if not (isinstance(value, np.ndarray) and value.dtype == dtype and value.ndim == rank):
            found = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
            raise Wrong(f"{where}: {found} where {shape_text(array)} belongs")
        for axis, n in fixed:
            if value.shape[axis] != n:
                raise Wrong(f"{where}: shape {value.shape} where {shape_text(array)} belongs")
        tensor.dtype = name
        tensor.shape.extend(value.shape)
        tensor.data = value.tobytes()

    return write


def array_reader(where: str, array: Array) -> Callable[[Any], Any]:
    """Take an array from a Tensor message, refusing what the field does not declare."""
    name, dtype, rank = array.name, array.dtype, len(array.shape)
    itemsize, is_float = dtype.itemsize, dtype.kind == "f"
    fixed = tuple((axis, n) for axis, n in enumerate(array.shape) if n is not None)
    # vdot, for dot warns when it overflows
    ndarray, vdot, prod, isfinite = np.ndarray, np.vdot, math.prod, math.isfinite

    def check_floats(values: Any) -> None:
        """The exact test, after the fast one raised a suspicion."""
        values = values.reshape(-1)
        bad = np.isnan(values) | (values == -np.inf) if array.unbounded else ~np.isfinite(values)
        if bad.any():
            raise Wrong(f"{where}: entry {int(np.argmax(bad))} is {values[np.argmax(bad)]}, not a finite number")

    def read(tensor: Any) -> Any:
        if tensor.dtype != name:
            if not tensor.dtype:
                raise Wrong(f"{where}: missing")
            raise Wrong(f"{where}: dtype {tensor.dtype[:16]!r} where {name!r} belongs")
        shape, data = tensor.shape[:], tensor.data
        if len(shape) != rank:
            raise Wrong(f"{where}: {len(shape)} axes where {shape_text(array)} belongs")
        for axis, n in fixed:
            if shape[axis] != n:
                raise Wrong(f"{where}: shape {tuple(shape)} where {shape_text(array)} belongs")
        if prod(shape) * itemsize != len(data):
            needed = prod(shape) * itemsize
            raise Wrong(f"{where}: shape {tuple(shape)} needs {needed} bytes, but {len(data)} came")
        if not data:
            if max(shape) >= _MAX_AXIS:
                raise Wrong(f"{where}: shape {tuple(shape)} has an axis that is too long")
            return np.zeros(shape, dtype)
        values = ndarray(shape, dtype, bytearray(data))
        if is_float and array.unbounded:
            if not values.min() > -math.inf:  # nor NaN, which it would be
                check_floats(values)
        elif is_float:
            # the squares' sum is finite only if every entry is; overflow is settled by the exact test
            if not isfinite(vdot(values, values)):
                check_floats(values)
        elif array.least is not None and values.min() < array.least:
            raise Wrong(f"{where}: entry {int(values.argmin())} is {values.min()}, less than {array.least}")
        return values

    return read


# ---- scalars ---------------------------------------------------------------------------------------------


def wrong_float(owner: str, wire: Any, names: tuple[str, ...]) -> None:
    """Raises Wrong for the first of these floats that is not finite."""
    for name in names:
        value = getattr(wire, name)
        if not math.isfinite(value):
            raise Wrong(f"{owner}.{name}: {value} is not a finite number")


def scalar_check(where: str, field: Field) -> Callable[[Any], Any] | None:
    """Check of one decoded scalar, or None if any value will do."""
    if field.of is float:

        def check_float(value: float) -> float:
            if not math.isfinite(value):
                raise Wrong(f"{where}: {value} is not a finite number")
            return value

        return check_float
    if field.least is not None:
        least = field.least

        def check_least(value: int) -> int:
            if value < least:
                raise Wrong(f"{where}: {value} is less than {least}")
            return value

        return check_least
    if field.is_enum:
        members = {str(member): member for member in field.of}

        def check_member(value: str) -> Any:
            member = members.get(value)
            if member is None:
                raise Wrong(f"{where}: {value[:80]!r} is none of {', '.join(members)}")
            return member

        return check_member
    if field.named is not None:
        dotted = field.named.dotted

        def check_name(value: str) -> str:
            if not is_name(value) and not (dotted and is_id(value)):
                what = "an id (names with a dot between them)" if dotted else "a name"
                raise Wrong(f"{where}: {value[:80]!r} is not {what} (letters, digits, _ and -, at most 64)")
            return value

        return check_name
    return None
