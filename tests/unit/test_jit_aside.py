"""Kernels that stand aside are compiled when they are first called, and found again by another process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.kernels

KERNELS = """
from softseam_services.jit import njit


@njit(cache=True, error_model="numpy", aside=(float, int))
def summed(x, k):
    return x.sum() * k, k


@njit(cache=True, error_model="numpy", aside=())
def filled(x, k):
    if k == 3:
        raise ValueError("three is refused")
    x[:] = k


@njit(cache=True, error_model="numpy", aside=(float,))
def wrong(x):
    return x.no_such_thing


@njit(cache=True, error_model="numpy")
def choose(x, k):
    if k == 0:
        return 0.0
    if k == 4:
        return wrong(x)
    total, same = summed(x, k)
    if k >= 2:
        filled(x, k)
    return total + same
"""

RUN = """
import sys
import numpy as np
import kernels
compiled = []
for k in (0, 1, 2, 3):
    x = np.arange(4.0)
    try:
        found = kernels.choose(x, k)
    except Exception as error:
        found = error
    some = [each.__name__ for each in (kernels.summed, kernels.filled) if each.overloads]
    print(found, *x, *some, sep=";")
print(sum(sum(each.stats.cache_misses.values()) for each in (kernels.choose, kernels.summed, kernels.filled)))
if "wrong" in sys.argv:
    kernels.choose(x, 4)
"""


def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    (folder / "kernels.py").write_text(KERNELS)
    return subprocess.run(
        [sys.executable, "-c", RUN, *arguments],
        cwd=folder,
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "kept")} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.mark.slow
def test_a_kernel_that_stands_aside_is_compiled_when_it_is_called_and_kept(tmp_path: Path) -> None:
    """The caller's code, read from disk by another process, finds the address there, too; errors come through."""
    answers = [
        "0.0;0.0;1.0;2.0;3.0",
        "7.0;0.0;1.0;2.0;3.0;summed",
        "14.0;2.0;2.0;2.0;2.0;summed;filled",
        "three is refused;0.0;1.0;2.0;3.0;summed;filled",
    ]
    for misses in (3, 0):
        done = run(tmp_path)
        assert done.stdout.splitlines() == [*answers, str(misses)], done.stderr


@pytest.mark.slow
def test_one_that_cannot_be_compiled_ends_the_call_with_an_error(tmp_path: Path) -> None:
    done = run(tmp_path, "wrong")
    assert "RuntimeError: wrong could not be compiled; the log says why" in done.stderr
    assert "no_such_thing" in done.stderr
