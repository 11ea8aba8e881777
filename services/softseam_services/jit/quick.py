"""Shorter ways through numba's compiler, which make the same code.

Most of a first start is not LLVM's: numba's own Python finds types and writes instructions. It asks some of its
questions ten thousand times over, each time anew. Here the answers are kept. The lock file pins the numba that is
patched.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator
from typing import Any

import numba.core.targetconfig
import numba.core.types.functions
from numba.extending import overload
from numba.np import arrayobj

targetconfig: Any = numba.core.targetconfig
functions: Any = numba.core.types.functions

_MISSING: Any = object()


def shorten() -> None:
    """Patch numba in this process. Idempotent."""
    config = targetconfig.TargetConfig
    if config.__eq__ is not _equal:
        config.__eq__, config.__hash__ = _equal, _hash
        functions.BaseFunction.get_call_type = _call_type


def _equal(config: Any, other: Any) -> Any:
    """Whether two sets of compiler flags agree; most often they are written alike."""
    if not isinstance(other, targetconfig.TargetConfig):
        return NotImplemented
    return config is other or config._values == other._values or config.values() == other.values()


def _hash(config: Any) -> int:
    """Of all flags: tables are keyed by types of arguments besides, which differ."""
    return hash(type(config))


_resolve = functions.BaseFunction.get_call_type


def _call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """The signature by which a function or an operator of numba's own takes these types: found once."""
    known: dict[Any, Any] = vars(function).setdefault("_signatures", {})
    flags = targetconfig.ConfigStack.top_or_none()
    key = args, tuple(kws.items()), flags, len(function.templates), id(context)
    found = known.get(key, _MISSING)
    if found is _MISSING:
        found = known[key] = _resolve(function, context, args, kws)
    return found


@contextlib.contextmanager
def quickly() -> Iterator[None]:
    """While a kernel is compiled.

    The collector of garbage rests: it would search what numba builds again and again, a tenth of the whole time. And
    where shapes do not fit, the error does not print them: numba compiles 20 functions on strings for that, 5 s.
    """
    collects, with_shapes = gc.isenabled(), arrayobj.raise_with_shape_context
    gc.disable()
    arrayobj.raise_with_shape_context = _shapes_differ
    try:
        yield
    finally:
        arrayobj.raise_with_shape_context = with_shapes
        if collects:
            gc.enable()


def _shapes_differ(source: Any, target: Any) -> None:
    """What compiled code raises where an array is assigned to one of another shape."""


@overload(_shapes_differ)
def _raise_shapes_differ(source: Any, target: Any) -> Any:
    def raised(source: Any, target: Any) -> None:
        raise ValueError("an array is assigned to a slice of another shape")

    return raised
