"""What makes a class a message: fields in their order, set when it is made."""

from dataclasses import dataclass, field
from typing import TypeVar, dataclass_transform

_T = TypeVar("_T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def message(declared: type[_T]) -> type[_T]:
    """Makes a class a dataclass that nobody changes: the type checker refuses who writes to a field.

    Not when it runs, for a frozen dataclass takes five times as long to make: 9 us in place of 2 for the answer to a
    step, of which a hybrid step makes four.
    """
    return dataclass(slots=True)(declared)
