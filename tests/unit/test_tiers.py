"""A fast test that enters a kernel or starts a process fails."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
from numba import njit
from tiers import watched

from softseam_services.jit import njit as njit_of_ours


def double(x: float) -> float:
    return 2.0 * x


PLAIN: Any = njit(double)
OURS: Any = njit_of_ours(cache=False, error_model="numpy")(double)


def test_a_fast_test_enters_no_kernel() -> None:
    for kernel in (PLAIN, OURS):
        with pytest.raises(pytest.fail.Exception, match="the kernel double: mark it with"):
            kernel(1.0)


def test_a_fast_test_starts_no_process() -> None:
    with pytest.raises(pytest.fail.Exception, match="another process: mark it"):
        subprocess.run([sys.executable, "-c", ""], check=True)


@pytest.mark.kernels
def test_a_marked_one_does() -> None:
    found: list[str] = []
    with watched(found.append):
        assert PLAIN(1.0) == OURS(1.0) == 2.0
        subprocess.run([sys.executable, "-c", ""], check=True)
    assert set(found) == {"the kernel double", "another process"}
