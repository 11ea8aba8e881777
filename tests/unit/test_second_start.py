"""A second start compiles nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

STEP = """
import gc
from numba.core.dispatcher import Dispatcher
from fem_run import CLOSE, FemRun, tofu

run = FemRun(tofu())
run.step(CLOSE)
run.solver.snapshot()
ours = [d for d in gc.get_objects() if isinstance(d, Dispatcher) and d.__module__.startswith("softseam_services")]
print(*sorted(d.__qualname__ for d in ours if d.stats.cache_misses))
print(sum(sum(d.stats.cache_hits.values()) for d in ours))
"""


@pytest.mark.slow
def test_kernels_of_fem_come_from_the_cache() -> None:
    """Whatever a step of FEM calls from Python is loaded, not compiled, once another process has compiled it."""
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", STEP],
            cwd=Path(__file__).parents[1],
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        )
    missed, hits = done.stdout.split("\n")[:2]
    assert missed == ""
    assert int(hits) > 0
