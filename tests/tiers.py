"""The fast tests: those that enter no compiled kernel and start no process, which might enter one.

In the folders `FAST` a test is fast that is not marked `kernels`. One that enters a kernel nevertheless fails, whatever
runs it, so that the fast tests stay what they are.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from numba.core.registry import CPUDispatcher

FAST = ("unit", "contract", "analysis")
"""folders of tests/"""


def may_be_fast(item: pytest.Item) -> bool:
    """Whether it is for a mark to say."""
    return item.path.parent.name in FAST


def is_fast(item: pytest.Item) -> bool:
    return may_be_fast(item) and item.get_closest_marker("kernels") is None


@contextmanager
def watched(found: Callable[[str], None]) -> Iterator[None]:
    """Call `found` with the name of each kernel that Python enters or compiles, and for each process."""
    call, translate, start = CPUDispatcher.__call__, CPUDispatcher.compile, subprocess.Popen.__init__

    def called(kernel: Any, *args: Any, **named: Any) -> Any:
        found(f"the kernel {kernel.py_func.__qualname__}")
        return call(kernel, *args, **named)

    def compiled(kernel: Any, sig: Any) -> Any:
        found(f"the kernel {kernel.py_func.__qualname__}")
        return translate(kernel, sig)

    def started(process: Any, *args: Any, **named: Any) -> None:
        found("another process")
        start(process, *args, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CPUDispatcher, "__call__", called)
        patch.setattr(CPUDispatcher, "compile", compiled)
        patch.setattr(subprocess.Popen, "__init__", started)
        yield


def refuse(what: str) -> None:
    """Fail the test that runs."""
    pytest.fail(f"a fast test enters {what}: mark it with pytest.mark.kernels")
