"""The kernels on particles mean the same as plain Python, where numba checks no bounds and types."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from particle_run import ParticleRun, particle_scene

pytestmark = pytest.mark.kernels


def test_a_corner_is_folded() -> None:
    """A few particles between gripper and ground, layers in touch: finite, held, nothing leaves the arrays."""
    body = {
        "kind": "sheet",
        "size": (0.05, 0.03),
        "divisions": (5, 3),
        "density": 0.3,
        "stretch": 50.0,
        "bending": 1e-5,
    }
    tools = {
        "ground": {"kind": "plane", "friction": 0.5, "point": (0.0, 0.0, -0.004)},
        "hand": {"kind": "sphere", "radius": 0.005, "position": (0.035, 0.0, 0.0)},
    }
    run = ParticleRun(particle_scene({**body, "restitution": 0.3}, gravity=(0.0, 0.0, -9.81), tools=tools))
    run.gripping[1] = 1
    run.velocity[1, :3] = -1.0, 0.0, 0.5
    for _ in range(3):
        reply = run.step()
    assert reply.extras["held"] > 0
    assert reply.extras["n_contacts"] > 0
    run.x[:, 0] = np.abs(run.x[:, 0])
    run.gripping[1] = 0
    reply = run.step()
    assert np.isfinite(run.x).all() and np.isfinite(reply.wrench).all()
    assert run.solver.fields(reply.header).point_x.shape == (48, 3)


@pytest.mark.slow
def test_kernels_pass_without_jit() -> None:
    tests = Path(__file__).parents[1]
    chosen = [f"{__file__}::test_a_corner_is_folded", f"{tests}/verification/test_particle_constraints.py"]
    solids = f"{tests}/verification/test_classic_solids.py"
    chosen += [f"{solids}::test_{name}" for name in ("a_projection_of_a_volume", "a_lifted_block_slips_anew")]
    chosen += [f"{solids}::test_a_block_inside_out_is_told_of"]
    chosen += ["-k", "not fem and not sweeps and not stiffens"]
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *chosen],
        cwd=tests.parent,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-3000:]
