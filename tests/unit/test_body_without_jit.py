"""Kernels of body and tools mean the same as plain Python, where numba checks no bounds and types."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.kernels

HERE = Path(__file__).parent
FILES = [
    HERE / "test_materials.py",
    HERE / "test_tool_kernels.py",
    HERE / "test_body_block.py",
    HERE / "test_tools.py",
    HERE.parent / "verification" / "test_embedding.py::test_moments_of_a_cut_corner_are_exact",
    HERE / "test_mesh_errors.py::test_self_crossing",
    HERE / "test_mesh_errors.py::test_pieces_and_cavities",
]


@pytest.mark.slow
def test_kernels_pass_without_jit() -> None:
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *map(str, FILES)],
        cwd=HERE.parents[1],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-3000:]
