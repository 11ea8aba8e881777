"""FEM kernels mean the same as plain Python, where numba checks no bounds and types."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.kernels

HERE = Path(__file__).parent
FILES = [
    f"{HERE / 'test_fem_fronts.py'}::test_solve_equals_dense[one_cell]",
    f"{HERE / 'test_fem_fronts.py'}::test_last_fronts_hold_the_seam[two_columns]",
    f"{HERE / 'test_fem_cells.py'}::test_tangent_is_the_gradient_of_the_forces[partial-neo_hookean]",
    f"{HERE / 'test_fem_cells.py'}::test_patch",
    f"{HERE / 'test_fem_elements.py'}::test_forces_and_tangents_are_derivatives[tet4_fbar-neo_hookean]",
    f"{HERE / 'test_fem_contact.py'}::test_tangent_is_the_gradient_of_the_force",
    f"{HERE / 'test_fem_contact.py'}::test_friction_sticks_inside_the_cone_and_slips_on_it",
    f"{HERE / 'test_integrator_schemes.py'}",
    f"{HERE.parent / 'verification' / 'test_fem_integrators.py'}::test_snapshots_carry_the_history[symplectic_euler]",
    f"{HERE.parent / 'verification' / 'test_fem_integrators.py'}::test_snapshots_carry_the_history[midpoint]",
    f"{HERE.parent / 'verification' / 'test_fem_dynamics.py'}::test_free_fall_is_exact",
]


@pytest.mark.slow
def test_kernels_pass_without_jit() -> None:
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *FILES],
        cwd=HERE.parents[1],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-3000:]
