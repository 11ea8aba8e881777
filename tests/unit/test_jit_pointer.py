"""Kernels call functions by their address: compiled, without a compiler, and with the kernel kept on disk."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import TypingError

from softseam_services.jit import Prototype, PrototypeError, njit

pytestmark = pytest.mark.kernels

SHEAR = Prototype("shear of a row", {"scale": float, "n": int, "x": ("n",), "F": (2, 2)}, returns=2)
call = SHEAR.call


@njit(cache=False, error_model="numpy")
def kernel(address, scale, x, F):  # type: ignore[no-untyped-def]
    first, second = call(address, scale, len(x), x, F)
    return first, second


def weighted(scale, n, x, F):  # type: ignore[no-untyped-def]
    F[0, 1] += scale
    return scale * x.sum() + n, F[1, 0]


def other(scale, n, x, F):  # type: ignore[no-untyped-def]
    return -1.0, scale


def test_a_kernel_calls_what_lies_at_the_address() -> None:
    """One kernel, two functions; numbers, whole numbers, arrays that change in place, and two results."""
    x, F = np.arange(5.0), np.arange(4.0).reshape(2, 2)
    assert kernel(SHEAR.compile(weighted), 2.0, x, F) == (25.0, 2.0)
    assert F[0, 1] == 3.0
    assert kernel(SHEAR.compile(other), 2.0, x, F) == (-1.0, 2.0)
    assert len(kernel.signatures) == 1


def test_no_kernel_calls_address_0() -> None:
    with pytest.raises(ValueError, match="shear of a row: a kernel was given address 0"):
        kernel(0, 2.0, np.zeros(5), np.zeros((2, 2)))


@pytest.mark.parametrize("function", [lambda scale: scale, lambda scale, n, x, F: (scale, n, scale)])
def test_what_does_not_fit_is_refused(function) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(PrototypeError, match=r"shear of a row: <lambda> must be \(scale: float, n: int, x: array"):
        SHEAR.compile(function)


def test_a_call_that_does_not_fit_is_refused() -> None:
    """An array that is not contiguous, whose data a pointer alone cannot tell."""
    with pytest.raises(TypingError, match="shear of a row: called with"):
        kernel(SHEAR.compile(other), 2.0, np.zeros(10)[::2], np.zeros((2, 2)))


PROGRAM = """
import sys
import numpy as np
from softseam_services.jit import Prototype, njit
PROTOTYPE = Prototype("a row", {"a": float, "x": (3,)})
call = PROTOTYPE.call
@njit(cache=True, error_model="numpy")
def kernel(address, a, x):
    return call(address, a, x)
def plus(a, x):
    return a + x[0]
def times(a, x):
    return a * x[2]
address = PROTOTYPE.compile({"plus": plus, "times": times}[sys.argv[1]])
print(kernel(address, 2.0, np.array([1.0, 2.0, 3.0])))
print(sum(kernel.stats.cache_hits.values()) if hasattr(kernel, "stats") else -1)
"""


def run(program: Path, name: str, **environment: str) -> list[str]:
    process = subprocess.run(
        [sys.executable, str(program), name],
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | {"NUMBA_CACHE_DIR": str(program.parent / "kept")} | environment,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout.split()


def test_a_kept_kernel_calls_another_function(tmp_path: Path) -> None:
    """What one process keeps on disk, a second one loads, and calls a function that the first had not heard of."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    assert run(program, "plus") == ["3.0", "0"]
    assert run(program, "times") == ["6.0", "1"]


def test_without_a_compiler_an_address_is_a_function_of_python(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    assert run(program, "times", NUMBA_DISABLE_JIT="1") == ["6.0", "-1"]
