"""Functions that kernels call by their address: how a row that is added from outside gets into a compiled kernel.

A kernel reaches softseam's own rows through branches: the compiler sees them and puts them in line. It cannot see a row
that an extension adds later, so it takes that row's address, a number in a table, and calls what lies there: the kernel
stays as it is on disk, whatever is added. A call costs some nanoseconds more than the same function in line (5 ns for a
law with ten results). Addresses belong to one process: never keep or send one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import NumbaError, TypingError
from numba.extending import intrinsic

Argument = type[float] | type[int] | tuple[int | str, ...]
"""float, int, or the shape of a C-contiguous array of float64; a length that varies is named as an int before it"""

_PYTHON_ONLY = bool(vars(numba.config)["DISABLE_JIT"])
_KNOWN: dict[int, Any] = {}
"""what lies at each address: keeps it alive, and is called where numba is told not to compile"""


class PrototypeError(TypeError):
    """A function does not fit the prototype by which kernels call it; the text says what is asked for."""


class Prototype:
    """Arguments and results of a family of functions, of which a kernel chooses one by its address.

    title      what the functions are, for messages: "response of a material law"
    arguments  by name, in order; arrays may be updated in place
    returns    how many floats they return: none, one, or a tuple of as many
    lengths    arguments that only give arrays their shapes: callers pass them, functions do not take them
    call       for kernels, as a global of their module: call(address, *arguments) returns what the function does and
               raises ValueError at address 0; sizes of arrays are the caller's to check
    """

    def __init__(
        self, title: str, arguments: Mapping[str, Argument], returns: int = 1, lengths: Collection[str] = ()
    ) -> None:
        self.title, self.arguments, self.returns = title, dict(arguments), returns
        self.taken = {name: kind for name, kind in self.arguments.items() if name not in lengths}
        self.call: Any = self._call_python if _PYTHON_ONLY else _calling(self)

    def compile(self, function: Callable[..., Any]) -> int:
        """The address of a function that numba can compile. Raises PrototypeError where it does not fit."""
        if _PYTHON_ONLY:
            address = len(_KNOWN) + 1
            _KNOWN[address] = function
            return address
        kernel = function if hasattr(function, "py_func") else numba.njit(error_model="numpy")(function)
        signature = types.void(*map(_kind, self.arguments.values()), *[types.CPointer(types.float64)][: self.returns])
        try:
            entry = numba.cfunc(signature, error_model="numpy")(self._entry(kernel))
        except NumbaError as error:
            raise PrototypeError(f"{self.title}: {function.__name__} must be {self.text()}; {error}") from None
        address = int(entry.address)  # type: ignore[arg-type]  # numba has it optional
        _KNOWN[address] = entry
        return address

    def text(self) -> str:
        """The prototype as one would write it: (a: float, x: array (3,)) -> 2 floats."""
        given = ", ".join(
            f"{name}: {kind.__name__ if isinstance(kind, type) else f'array {kind}'}"
            for name, kind in self.taken.items()
        )
        return f"({given}) -> {('nothing', 'float')[self.returns] if self.returns < 2 else f'{self.returns} floats'}"

    def nothing_there(self) -> str:
        """What to tell of address 0."""
        return f"{self.title}: a kernel was given address 0; nothing was compiled for this row"

    def _entry(self, kernel: Any) -> Callable[..., None]:
        """What is called through the address: gives arrays their shapes, and writes results to the caller's memory."""
        given = ", ".join(
            f"carray({name}, ({''.join(f'{size}, ' for size in kind)}))" if isinstance(kind, tuple) else name
            for name, kind in self.taken.items()
        )
        lines = [f"def entry({', '.join([*self.arguments, *['results_'][: self.returns]])}):"]
        lines.append(f"    values_ = kernel({given})")
        if self.returns == 1:
            lines.append("    results_[0] = values_")
        elif self.returns:
            lines.append(f"    {', '.join(f'results_[{k}]' for k in range(self.returns))} = values_")
        names: dict[str, Any] = {"kernel": kernel, "carray": vars(numba)["carray"]}
        exec("\n".join(lines), names)
        entry: Callable[..., None] = names["entry"]
        return entry

    def _call_python(self, address: int, *given: Any) -> Any:
        """`call` where nothing is compiled. Here an array of a wrong size raises ValueError."""
        if address == 0:
            raise ValueError(self.nothing_there())
        lengths = dict(zip(self.arguments, given, strict=True))
        shaped = (
            value.reshape([lengths[size] if isinstance(size, str) else size for size in kind])
            if isinstance(kind, tuple)
            else value
            for value, (name, kind) in zip(given, self.arguments.items(), strict=True)
            if name in self.taken
        )
        return _KNOWN[address](*shaped)


def _kind(argument: Argument) -> Any:
    """Numba's type of an argument, as it is passed through the address."""
    if isinstance(argument, tuple):
        return types.CPointer(types.float64)
    return types.int64 if argument is int else types.float64


def _calling(prototype: Prototype) -> Any:
    """What kernels call: takes arrays by their data, and lends the function memory for its results."""
    kinds, n_results = [_kind(argument) for argument in prototype.arguments.values()], prototype.returns
    returned = (types.none, types.float64)[n_results] if n_results < 2 else types.UniTuple(types.float64, n_results)

    def fits(typingctx: Any, value: Any, kind: Any) -> bool:
        if isinstance(kind, types.CPointer):
            return isinstance(value, types.Array) and value.dtype == types.float64 and value.layout == "C"
        return typingctx.can_convert(value, kind) is not None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address, packed = arguments
        with cgutils.if_unlikely(builder, builder.icmp_signed("==", address, address.type(0))):
            context.call_conv.return_user_exc(builder, ValueError, (prototype.nothing_there(),))
        passed = []
        for place, (source, kind) in enumerate(zip(signature.args[1], kinds, strict=True)):
            value = builder.extract_value(packed, place)
            if isinstance(kind, types.CPointer):
                passed.append(context.make_array(source)(context, builder, value).data)
            else:
                passed.append(context.cast(builder, value, source, kind))
        results = cgutils.alloca_once(builder, ir.DoubleType(), size=max(n_results, 1))
        passed += [results][:n_results]
        function = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
        builder.call(builder.inttoptr(address, function.as_pointer()), passed)
        if not n_results:
            return context.get_dummy_value()
        values = [builder.load(builder.gep(results, [ir.IntType(32)(k)])) for k in range(n_results)]
        return values[0] if n_results == 1 else context.make_tuple(builder, returned, values)

    def call(typingctx: Any, address: Any, *given: Any) -> Any:
        values = given[0] if len(given) == 1 and isinstance(given[0], tuple) else given
        if len(values) != len(kinds) or not all(map(fits, [typingctx] * len(kinds), values, kinds)):
            raise TypingError(f"{prototype.title}: called with {values}, not {prototype.text()}")
        return returned(types.int64, types.StarArgTuple(values)), generate

    return intrinsic(call)
