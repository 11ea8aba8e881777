"""Kernels that stand aside: compiled when one first calls them, which in most scenes nobody does.

A kernel that is linked into its callers is compiled with them, whether a scene needs it or not: other laws, elements
and integrators would be most of a first start. One that stands aside is a whole of its own, kept on disk by itself.
Callers know what it takes and returns, and no more; they call it by an address, which they ask for at the first call. A
call costs some nanoseconds more than the same code in line.
"""

from __future__ import annotations

import ctypes
import logging
import pickle
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import llvmlite.binding
import numba.core
from llvmlite import ir
from numba.core.serialize import dumps

cgutils: Any = numba.core.cgutils
types: Any = numba.core.types
typing: Any = numba.core.typing
_log = logging.getLogger(__name__)
_WORD, _BYTES = ir.IntType(64), ir.IntType(8).as_pointer()
_SYMBOL = "softseam_aside"
"""by this name compiled code finds `_address_of`, in every process, read from disk or not"""


def returned(kinds: Sequence[type]) -> Any:
    """Numba's type of what a kernel returns: nothing, a float or an int, or a tuple of such."""
    known = [types.float64 if kind is float else types.int64 for kind in kinds]
    return types.none if not known else known[0] if len(known) == 1 else types.Tuple(known)


class Aside:
    """What callers of a kernel see of it.

    kernel    compiles by `address`; a global of its module
    returns   numba's type of what it returns
    """

    def __init__(self, kernel: Any, returns: Any) -> None:
        self._kernel, self._returns = kernel, returns
        self._entries: dict[tuple[Any, ...], object] = {}

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """As `Dispatcher.get_call_template`, without a look at the kernel's code."""
        pysig, taken = self._kernel.fold_argument_types(args, kws)
        self.entry(taken)
        name = self._kernel.py_func.__name__
        template = typing.make_concrete_template(name, key=name, signatures=[self.signature(taken)])
        return template, pysig, taken, {}

    def signature(self, taken: tuple[Any, ...]) -> Any:
        """Of the kernel for these types."""
        return typing.signature(self._returns, *taken)

    def entry(self, taken: tuple[Any, ...]) -> object:
        """Under which the target knows how to call the kernel with these types."""
        if taken not in self._entries:
            entry = self._entries[taken] = object()
            function = self._kernel.py_func
            what = dumps((function.__module__, function.__qualname__, taken))  # type: ignore[no-untyped-call]
            self._kernel.targetctx.insert_func_defn([(_calling(function.__qualname__, what), entry, taken)])
        return self._entries[taken]

    def address(self, taken: tuple[Any, ...]) -> int:
        """Of the kernel for these types, compiled or read from disk where it was not."""
        self._kernel.compile(taken)
        compiled = self._kernel.overloads[taken]
        return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


def _calling(title: str, what: bytes) -> Any:
    """What a caller does: asks for the address where it has none, and calls."""

    def call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        module = builder.module
        slot = ir.GlobalVariable(module, _WORD, module.get_unique_name("aside"))
        slot.linkage, slot.initializer = "internal", _WORD(0)
        with cgutils.if_unlikely(builder, builder.icmp_unsigned("==", builder.load(slot), _WORD(0))):
            ask = cgutils.get_or_insert_function(module, ir.FunctionType(_WORD, [_BYTES, _WORD]), _SYMBOL)
            text = builder.bitcast(cgutils.global_constant(module, "asked", cgutils.make_bytearray(what)), _BYTES)
            builder.store(builder.call(ask, [text, _WORD(len(what))]), slot)
        address = builder.load(slot)
        with cgutils.if_unlikely(builder, builder.icmp_unsigned("==", address, _WORD(0))):
            context.call_conv.return_user_exc(
                builder, RuntimeError, (f"{title} could not be compiled; the log says why",)
            )
        function = context.call_conv.get_function_type(signature.return_type, signature.args)
        status, value = context.call_conv.call_function(
            builder, builder.inttoptr(address, function.as_pointer()), signature.return_type, signature.args, arguments
        )
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return value

    return call


def _address_of(at: int, size: int) -> int:
    """What compiled code asks for. Nothing can be raised through it: 0 where the kernel cannot be compiled."""
    try:
        module, name, taken = pickle.loads(ctypes.string_at(at, size))
        address: int = getattr(import_module(module), name).aside.address(taken)
    except Exception:
        _log.exception("a kernel that stands aside could not be compiled")
        return 0
    return address


_ENTRY = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p, ctypes.c_uint64)(_address_of)
llvmlite.binding.add_symbol(_SYMBOL, ctypes.cast(_ENTRY, ctypes.c_void_p).value)
