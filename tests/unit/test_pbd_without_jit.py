"""The PBD kernels mean the same as plain Python, where numba checks no bounds and types."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pbd_run import Energy, PbdRun, block_scene

pytestmark = pytest.mark.kernels

GROUND = {"kind": "plane", "point": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0), "friction": 0.6}


@pytest.mark.parametrize(
    ("kind", "damping"), [("neo_hookean", {}), ("linear", {}), ("neo_hookean", {"mass": 1.0, "stiffness": 0.01})]
)
def test_one_cell_three_steps(kind: str, damping: dict[str, float]) -> None:
    """One cell falls on the ground: forces are gradients, momentum balances, nothing leaves the arrays."""
    scene = block_scene(
        cell=0.05,
        kind=kind,
        gravity=(0.0, 0.0, -9.81),
        position=(0.0, 0.0, 1e-5),
        tools={"ground": GROUND},
        pbd={"substeps": 3, "damping": damping, **({"sweeps": 3, "residual": 0.05} if damping else {})},
    )
    run = PbdRun(scene)
    for _ in range(3):
        before = run.solver.snapshot()
        reply = run.step()
        assert reply.status == "converged" and before != run.solver.snapshot()
    assert reply.extras["n_contacts"] == 9
    energy, x = Energy(run), run.x
    moved = x.copy()
    moved[5, 1] += 1e-6
    slope = (energy.value(moved) - energy.value(x)) / 1e-6
    np.testing.assert_allclose(energy.force(x)[5, 1], -slope, rtol=1e-3, atol=1e-3)
    assert np.abs(run.fields().cauchy).max() > 0.0


def test_an_edge_between_points() -> None:
    """One cell under a pad that covers a part of its top: patches count by the places that it presses, and wrench and
    momentum balance."""
    pad = {"kind": "box", "size": (0.03, 0.036, 0.01), "position": (0.004, 0.0, 0.055), "friction": 0.5}
    run = PbdRun(block_scene(cell=0.05, tools={"pad": pad}, pbd={"substeps": 2}))
    run.velocity[:, 2] = -0.05
    before = run.step()
    reply = run.step()
    assert (run.work.force[:, 0, 2] < 0.0).sum() == reply.extras["n_contacts"] == 12
    assert run.scratch.arrays.contacts.patch.any(axis=(1, 2)).sum() == 6 * 16
    assert reply.wrench[0, 2] > 0.1
    change = (reply.momentum - before.momentum) / run.scene.step
    np.testing.assert_allclose(change, -reply.wrench[0, :3], atol=1e-9)


def test_one_cell_leaps() -> None:
    """One cell swings by leapfrog: energy stays, nothing leaves the arrays."""
    rest = PbdRun(block_scene(cell=0.05)).body.x_rest
    run = PbdRun(block_scene(cell=0.05, pbd={"method": "leapfrog", "substeps": 20}), x=rest * np.array([1.1, 1.0, 1.0]))
    energy = run.solver.strain
    for _ in range(3):
        reply = run.step()
        np.testing.assert_allclose(reply.kinetic + reply.strain, energy, rtol=0.05)
    assert reply.extras["residual"] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["neo_hookean", "linear", "corotated"])
def test_two_graded_cells_three_steps(kind: str) -> None:
    """Blocks of any shape: forces are gradients, and a step keeps momentum."""
    shape = {"kind": "block", "size": (0.06, 0.02, 0.02), "grading": 3.0}
    run = PbdRun(block_scene((0.06, 0.02, 0.02), 0.02, kind=kind, body={"shape": shape}, pbd={"substeps": 2}))
    for _ in range(2):
        assert run.step().status == "converged"
    energy, x = Energy(run), run.x + 1e-4 * np.sin(np.arange(run.x.size)).reshape(-1, 3)
    moved = x.copy()
    moved[5, 1] += 1e-7
    slope = (energy.value(moved) - energy.value(x)) / 1e-7
    np.testing.assert_allclose(energy.force(x)[5, 1], -slope, rtol=1e-3, atol=1e-3)


@pytest.mark.slow
def test_kernels_pass_without_jit() -> None:
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-x",
            "-p",
            "no:cacheprovider",
            f"{__file__}::test_one_cell_three_steps",
            f"{__file__}::test_an_edge_between_points",
            f"{__file__}::test_one_cell_leaps",
            f"{__file__}::test_two_graded_cells_three_steps",
        ],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-3000:]
