"""Whole numbers that a user gives."""

import operator

import numpy as np


def whole(value: object) -> int | None:
    """A whole number, numpy's too; None of what is none. True and False are none, though Python counts with them."""
    if isinstance(value, bool | np.bool_):
        return None
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return None
