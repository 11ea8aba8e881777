"""Kernels are optimised once, in what Python calls; and what a start compiles does not grow unseen."""

from __future__ import annotations

import ast
import itertools
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import llvmlite.binding as llvm
import numba
import numpy as np
import pytest

import softseam_coupling
import softseam_services
from softseam_services.jit.linking import _link, njit

SERVICES, COUPLING = (Path(package.__path__[0]) for package in (softseam_services, softseam_coupling))


@njit(cache=False, error_model="numpy")
def _lowest(x, i):  # type: ignore[no-untyped-def]
    return x[i] * 2.0


@njit(cache=False, error_model="numpy")
def _middle(x, scale=3.0):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(x)):
        total += scale * _lowest(x, i)
    return total


@njit(cache=False, error_model="numpy")
def _highest(x):  # type: ignore[no-untyped-def]
    if len(x) == 0:
        raise ValueError("nothing to add up")
    return _middle(x) + _middle(x, 1.0) + _lowest(x, 0)


@numba.njit
def _plain(x):  # type: ignore[no-untyped-def]
    return _highest(x) + _middle(x)


@pytest.mark.kernels
def test_kernels_call_each_other_and_answer_python() -> None:
    x = np.array([1.0, 2.0])
    assert _highest(x) == 18.0 + 6.0 + 2.0
    assert _middle(x) == 18.0 and _middle(x, scale=1.0) == 6.0 and _lowest(x, 1) == 4.0
    assert _plain(x) == 26.0 + 18.0
    with pytest.raises(ValueError, match="nothing"):
        _highest(x[:0])


@dataclass
class Library:
    """Code as numba hands it on for linking."""

    code: llvm.ModuleRef

    def _get_module_for_linking(self) -> llvm.ModuleRef:
        return self.code


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))), ids=str)
def test_parts_are_linked_whatever_their_order(order: tuple[int, ...]) -> None:
    """A library may be reached before the code that calls it: LLVM leaves it out then."""
    parts = [
        llvm.parse_assembly(text)
        for text in (
            "declare i32 @middle()\n define linkonce_odr i32 @upper() {\n %x = call i32 @middle()\n ret i32 %x\n}",
            "declare i32 @lower()\n define linkonce_odr i32 @middle() {\n %x = call i32 @lower()\n ret i32 %x\n}",
            "define linkonce_odr i32 @lower() {\n ret i32 1\n}",
        )
    ]
    whole = llvm.parse_assembly(
        "declare i32 @upper()\n declare i32 @abs(i32)\n define i32 @whole() {\n"
        "%x = call i32 @upper()\n %y = call i32 @abs(i32 %x)\n ret i32 %y\n}"
    )
    _link(whole, [Library(parts[i]) for i in order])
    assert [f.name for f in whole.functions if f.is_declaration] == ["abs"]


@pytest.mark.kernels
def test_only_what_python_calls_becomes_machine_code() -> None:
    """Of three kernels that call each other, two specialisations of the middle one: one whole, which holds all."""

    @njit(cache=False, error_model="numpy")
    def lowest(x):  # type: ignore[no-untyped-def]
        return x + 1

    @njit(cache=False, error_model="numpy")
    def middle(x):  # type: ignore[no-untyped-def]
        return lowest(x) + 1

    @njit(cache=False, error_model="numpy")
    def highest(x):  # type: ignore[no-untyped-def]
        return middle(x) + middle(2.0 * x)

    assert highest(1) == 7.0
    assert len(highest.overloads) == 1 and not middle.overloads and not lowest.overloads
    assert _specialisations(highest) == 5
    assert _entries(highest) == [True] and _entries(middle._part) == _entries(lowest._part) == [False, False]


def _entries(kernel) -> list[bool]:  # type: ignore[no-untyped-def]
    """Whether there is machine code, which Python could enter, of each specialisation of a kernel."""
    known = kernel.overloads.values()
    return [k.library.codegen._engine.is_symbol_defined(k.fndesc.llvm_cpython_wrapper_name) for k in known]


def _specialisations(kernel) -> int:  # type: ignore[no-untyped-def]
    """How many functions a kernel was compiled from, one for each set of argument types: each leaves an environment."""
    modules = [known.library._get_module_for_linking() for known in kernel.overloads.values()]
    return sum(variable.name.startswith("_ZN08NumbaEnv") for module in modules for variable in module.global_variables)


@pytest.mark.parametrize(
    ("package", "instead"),
    [(SERVICES, "softseam_services.jit.linking"), (COUPLING, "softseam_coupling.kept_kernels")],
    ids=["services", "coupling"],
)
def test_no_kernel_is_numbas_own(package: Path, instead: str) -> None:
    """Numba's njit would compile a kernel of the services again in whatever calls it, and end runs for a bad cache."""
    taken = [
        f"{path.relative_to(package)}: from {instead} import njit"
        for path in sorted(package.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == "numba" and any(a.name == "njit" for a in node.names)
    ]
    assert taken == []


COUNT = """
import gc, json, sys
from softseam_services.jit.linking import _Kernel
from softseam_services.warm_up import warm_participant

warm_participant(sys.argv[1])
found = {}
for kernel in [k for k in gc.get_objects() if isinstance(k, _Kernel) and k.overloads]:
    functions = instructions = 0
    for known in kernel.overloads.values():
        module = known.library._get_module_for_linking()
        names = [variable.name for variable in module.global_variables]
        functions += sum(name.startswith("_ZN08NumbaEnv") and "softseam" in name for name in names)
        instructions += sum(len(list(b.instructions)) for f in module.functions for b in f.blocks)
    found[kernel.__qualname__] = functions, instructions
print(json.dumps(found))
"""

BUDGET = {
    "fem": ({"advance": 207}, 108_000),
    "pbd": ({"advance_step": 149, "probe_seam": 116}, 125_000),
}
"""most functions in the largest kernels that a first start compiles (others: 30), and most instructions of all

Functions are the same on every machine. Instructions are counted after vectorisation and differ among processors: of
FEM 107,200 with AVX-512 (contact that stores energy, laws that relax or yield brought 15,000), of XPBD 119,800 (the
same 10,000).
"""


@pytest.mark.kernels
@pytest.mark.slow
@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_start_compiles_no_more_than_it_did(model: str) -> None:
    """Counts, not seconds: each function costs some 0.1 s to type and translate, each thousand instructions 0.15 s.

    Where this fails, look whether a rare path can do without the common kernels, or an argument without a second type;
    then raise the budget (docs/decisions/35-compiling-kernels.md).
    """
    done = subprocess.run([sys.executable, "-c", COUNT, model], capture_output=True, text=True, check=True, timeout=300)
    found: dict[str, tuple[int, int]] = json.loads(done.stdout)
    functions, instructions = BUDGET[model]
    others = {name: n for name, (n, _) in found.items() if n > functions.get(name, 30)}
    assert others == {}
    assert sum(n for _, n in found.values()) <= instructions
    assert len(found) <= 27
