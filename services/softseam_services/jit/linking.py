"""Numba's `njit` for kernels that call each other: code is optimised once, in the kernel that Python calls.

Numba finishes every function by itself: it links in all that the function calls, optimises that, and turns it into
machine code, with a wrapper for Python and another for C. Where kernels call each other several levels deep, the one at
the bottom is optimised again at every level above, and nobody ever enters most of the machine code. Here a kernel that
another one calls is a *part*: typed and translated, and no more. The kernel that Python calls, the *whole*, links all
parts that it reaches, directly or not, and is optimised and kept on disk as one. A kernel may be both: called from
Python it becomes a whole of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numba
from numba.core import compiler, event, sigutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher

from softseam_coupling.kept_kernels import keep
from softseam_services.jit.aside import Aside, returned
from softseam_services.jit.quick import quickly, shorten

shorten()


def njit(
    *, cache: bool, apart: bool = False, aside: tuple[type, ...] | None = None, **options: Any
) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` with the same options; what the decorated function calls is compiled with it if decorated alike.

    apart: no two of its arrays overlap, as the compiler may then take for granted; and a kernel that Python calls is
    optimised twice. Where all that a loop over lanes does is call a deep tree of kernels with large tuples, it needs
    both to see that it can use vector instructions.
    aside: what the function returns, floats and ints; it is compiled when first called, not with its callers (`Aside`).
    For what few scenes need. Arguments have no defaults.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        if vars(numba.config)["DISABLE_JIT"]:
            return function
        kernel = _Kernel(function, options | {"nopython": True, "boundscheck": None}, apart, aside)
        if cache:
            keep(kernel)
        return kernel

    return decorate


_unliteral: Callable[[Any], Any] = types.unliteral


class _Kernel(CPUDispatcher):
    """What Python sees of a kernel: called, it compiles a whole; kernels that call it get a part."""

    def __init__(
        self, py_func: Callable[..., Any], targetoptions: dict[str, Any], apart: bool, aside: tuple[type, ...] | None
    ) -> None:
        super().__init__(py_func, None, targetoptions, _WholeCompilerApart if apart else _WholeCompiler)
        self._part = _Part(py_func, None, targetoptions, _PartCompilerApart if apart else _PartCompiler)
        self.aside = None if aside is None else Aside(self, returned(aside))

    def compile(self, sig: Any) -> Any:
        if self.aside is not None:
            sig = self.aside.signature(tuple(sigutils.normalize_signature(sig)[0]))  # type: ignore[no-untyped-call]
        with quickly():
            return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        # one part for all constants that it is called with
        plain = tuple(_unliteral(each) for each in args)
        named = {name: _unliteral(each) for name, each in kws.items()}
        return (self._part if self.aside is None else self.aside).get_call_template(plain, named)

    def get_overload(self, sig: Any) -> Any:
        return self._part.get_overload(sig) if self.aside is None else self.aside.entry(tuple(sig))


class _Part(CPUDispatcher):
    """What other kernels see of a kernel. Never called: an entry point only names an overload."""

    _compiler: Any
    overloads: Any
    targetctx: Any

    def compile(self, sig: Any) -> Any:
        with global_compiler_lock, self._compiling_counter:
            args, returned = sigutils.normalize_signature(sig)  # type: ignore[no-untyped-call]
            known = self.overloads.get(tuple(args))
            if known is None:
                details = {"dispatcher": self, "args": args, "return_type": returned}
                with event.trigger_event("numba:compile", data=details):
                    known = self._compiler.compile(args, returned)._replace(entry_point=object())
                self.overloads[tuple(args)] = known
                self.targetctx.insert_user_function(known.entry_point, known.fndesc, [known.library])
            return known.entry_point


class _PartCompiler(compiler.Compiler):
    """Numba's compiler up to, and without, optimisation, machine code and wrappers."""

    def define_pipelines(self) -> Any:
        state = self.state
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)  # type: ignore[no-untyped-call]
        return super().define_pipelines()  # type: ignore[no-untyped-call]


class _WholeCompiler(compiler.Compiler):
    """Numba's compiler without the wrapper for C, which nobody calls."""

    @property
    def library(self) -> type[_WholeLibrary]:
        """Of code."""
        return _WholeLibrary

    def define_pipelines(self) -> Any:
        state = self.state
        state.flags.no_cfunc_wrapper = True
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()  # type: ignore[no-untyped-call]


class _PartCompilerApart(_PartCompiler):
    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()


class _WholeCompilerApart(_WholeCompiler):
    library = property(lambda self: _TwiceLibrary)

    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()


class _PartLibrary(JITCodeLibrary):
    """Code as translated, which waits for a whole."""

    def finalize(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage.name == "external":
                function.linkage = "linkonce_odr"  # dropped where it was inlined into all that call it
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """For a plain numba function that calls a kernel: the part with all that it reaches."""
        if self._shared_module is None:
            module = self._final_module.clone()
            _link(module, _reached(self))
            self._shared_module = module
        return self._shared_module


class _WholeLibrary(JITCodeLibrary):
    """Code with all that it reaches."""

    def finalize(self) -> None:
        reached = list(_reached(self))
        for library in reached:
            self._reload_init.update(library._reload_init)
        _link(self._final_module, reached)
        self._linking_libraries = []
        super().finalize()  # type: ignore[no-untyped-call]


class _TwiceLibrary(_WholeLibrary):
    def _optimize_final_module(self) -> None:
        super()._optimize_final_module()  # type: ignore[no-untyped-call]
        super()._optimize_final_module()  # type: ignore[no-untyped-call]


def _link(module: Any, libraries: Iterable[Any]) -> None:
    """Link the code of libraries into a module, whatever their order.

    LLVM leaves out what nothing calls yet: where code that is linked later does, it is linked again.
    """
    codes = [_code(library) for library in libraries]
    waiting, missing = codes, set[str]()
    while waiting:
        for code in waiting:
            module.link_in(code, preserve=True)
        before, missing = missing, {function.name for function in module.functions if function.is_declaration}
        waiting = [] if missing == before else [code for code in codes if missing.intersection(_defined(code))]


def _defined(code: Any) -> Iterator[str]:
    """Names of the functions that are in a module."""
    return (function.name for function in code.functions if not function.is_declaration)


def _code(library: Any) -> Any:
    return library._final_module if isinstance(library, _PartLibrary) else library._get_module_for_linking()


def _reached(library: Any) -> Iterator[Any]:
    """All libraries that one links, directly or through parts, each once and in a fixed order."""
    seen = {library}
    waiting = [iter(library._linking_libraries)]
    while waiting:
        linked = next(waiting[-1], None)
        if linked is None:
            waiting.pop()
        elif linked not in seen:
            seen.add(linked)
            yield linked
            if isinstance(linked, _PartLibrary):
                waiting.append(iter(linked._linking_libraries))
