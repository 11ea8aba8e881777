"""A fast test that enters a kernel or starts a process fails, and marks that are in vain are found."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numba import njit
from tiers import Marks, watched

from softseam_services.jit import njit as njit_of_ours


@njit
def plain(x: float) -> float:
    return 2.0 * x


@njit_of_ours(cache=False, error_model="numpy")
def ours(x: np.ndarray) -> float:
    return x[0]


def test_a_fast_test_enters_no_kernel() -> None:
    for kernel, value, name in ((plain, 1.0, "plain"), (ours, np.ones(1), "ours")):
        with pytest.raises(pytest.fail.Exception, match=f"the kernel {name}: mark it with"):
            kernel(value)


def test_a_fast_test_starts_no_process() -> None:
    with pytest.raises(pytest.fail.Exception, match="another process: mark it"):
        subprocess.run([sys.executable, "-c", ""], check=True)


@pytest.mark.kernels
def test_a_marked_one_does() -> None:
    found: list[str] = []
    with watched(found.append):
        assert plain(1.0) == 2.0 and ours(np.ones(1)) == 1.0
        subprocess.run([sys.executable, "-c", ""], check=True)
    assert set(found) == {"the kernel plain", "the kernel ours", "another process"}


def test_a_file_whose_marks_are_in_vain_is_named() -> None:
    """One that has a marked test which enters a kernel is not."""
    marks = Marks()
    for file, entered in (("one.py", [False, False]), ("other.py", [False, True]), ("third.py", [])):
        for each in entered:
            marks.see(_report(file, [("kernels", each)]))
        marks.see(_report(file, []))
    assert marks.vain == ["one.py"]


def _report(file: str, properties: list[tuple[str, object]]) -> pytest.TestReport:
    return pytest.TestReport(
        f"{file}::test", (file, 1, "test"), {}, "passed", None, "teardown", user_properties=properties
    )
