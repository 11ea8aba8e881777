"""The same kernel for another kind of number, other constants and another machine, from one source.

A kernel of lanes is written once, for four lanes of float64. `Retarget` makes of it a function of the same code whose
literals are of another type, whose named constants have other values, and whose calls go to kernels made in the same
way. Whoever makes them compiles them: for this processor, or for a graphics card.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from typing import Any

Function = Callable[..., Any]


class Retarget:
    """Makes functions of kernels, each once.

    real      type of the numbers, such as `numpy.float32`
    name      of the target, which tells its functions from others
    compile   makes a kernel of a function
    values    of constants, by their names, in place of those in the kernels' modules
    instead   kernels in place of others, by their names
    """

    def __init__(
        self,
        real: type[Any],
        name: str,
        compile: Callable[[Function], Any],
        values: Mapping[str, int],
        instead: Mapping[str, Any],
    ) -> None:
        self._real, self._name, self._compile = real, name, compile
        self._values, self._instead = dict(values), dict(instead)
        self._made: dict[Function, Any] = {}

    def __call__(self, kernel: Any) -> Any:
        """The kernel for the target."""
        function: types.FunctionType = getattr(kernel, "py_func", kernel)
        if function not in self._made:
            self._made[function] = self._compile(self._copy(function))
        return self._made[function]

    def _copy(self, function: types.FunctionType) -> types.FunctionType:
        code = function.__code__
        name = f"{code.co_name}_{self._name}"
        numbers = tuple(self._number(each) for each in code.co_consts)
        code = code.replace(co_consts=numbers, co_name=name, co_qualname=name)
        own = function.__globals__ | {
            each: self._global(each, function.__globals__[each])
            for each in code.co_names
            if each in function.__globals__
        }
        return types.FunctionType(code, own, name, function.__defaults__)

    def _global(self, name: str, value: Any) -> Any:
        if name in self._instead:
            return self._instead[name]
        if name in self._values:
            return self._values[name]
        return self(value) if hasattr(value, "py_func") else self._number(value)

    def _number(self, value: Any) -> Any:
        if isinstance(value, float):
            return self._real(value)
        return tuple(self._number(each) for each in value) if isinstance(value, tuple) else value
