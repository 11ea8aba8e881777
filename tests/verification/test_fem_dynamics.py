"""FEM in motion: invariants, rates, and trajectories of independent codes."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from test_fem_statics import clamped_beam

from softseam_protocol.messages.participant import BodyState


def _tip_path(run: FemRun, length: float, time: float, dt: float) -> NDArray[np.float64]:
    """uz of the tip after each step [m]."""
    tip = np.argmin(np.linalg.norm(run.body.x_rest - np.array([length, 0.0, 0.0]), axis=1))
    path = []
    for _ in range(round(time / dt)):
        run.step(dt=dt)
        path.append(run.x[tip, 2] - run.body.x_rest[tip, 2])
    return np.array(path)


@pytest.mark.slow
def test_scene_a_peaks_where_independent_codes_do() -> None:
    """Lowest tip -150.4 mm at 0.24 s on 4 x 1 x 1 cells; implicit Euler damps with the step, so 2 and 1 ms are
    extrapolated (first order) to within 2 %; the settled level is tested in the statics."""
    lowest = []
    for dt in (0.002, 0.001):
        path = _tip_path(FemRun(clamped_beam((0.2, 0.05, 0.05), 0.05, 0.4)), 0.2, 0.3, dt)
        lowest.append(path.min())
        assert abs(dt * (path.argmin() + 1) - 0.24) < 0.01
        assert abs(path.min() / -0.1504 - 1.0) < 0.08
    assert abs((2.0 * lowest[1] - lowest[0]) / -0.1504 - 1.0) < 0.02


def test_implicit_euler_is_first_order() -> None:
    """Halving the step halves the error of a swinging beam: slope 1 +- 0.15."""
    ends = [
        _tip_path(FemRun(clamped_beam((0.1, 0.05, 0.05), 0.05, 0.3)), 0.1, 0.04, dt)[-1]
        for dt in (4e-3, 2e-3, 1e-3, 5e-4)
    ]
    jumps = np.abs(np.diff(ends))
    slopes = np.log2(jumps[:-1] / jumps[1:])
    np.testing.assert_allclose(slopes, 1.0, atol=0.15)


def test_free_fall_is_exact() -> None:
    """x = sum of dt^2 g k: the integrator's own series, on every node, and no strain."""
    run = FemRun(block(step=0.01))
    for n in range(1, 11):
        reply = run.step()
        np.testing.assert_allclose(run.x[:, 2] - run.body.x_rest[:, 2], -9.81 * 1e-4 * n * (n + 1) / 2, atol=1e-12)
    assert reply.strain < 1e-12


def test_a_spinning_body_keeps_its_momentum() -> None:
    """Momentum and angular momentum to 1e-12 relative, about an axis that is none of the body's own, too."""
    run = FemRun(
        block(gravity=(0.0, 0.0, 0.0), step=0.002, body={"spin": (3.0, -2.0, 5.0), "velocity": (0.3, 0.1, -0.2)})
    )
    mass = run.parameters.mass[:, None]
    momentum = (mass * run.body.v_initial).sum(axis=0)
    turning = (mass * np.cross(run.body.x_rest, run.body.v_initial)).sum(axis=0)
    for _ in range(200):
        reply = run.step()
    np.testing.assert_allclose(reply.momentum, momentum, atol=1e-12 * float(np.linalg.norm(momentum)))
    np.testing.assert_allclose(reply.angular_momentum, turning, atol=1e-10 * float(np.linalg.norm(turning)))


def test_energy_never_grows() -> None:
    """A body kicked at random loses energy each step: implicit Euler dissipates."""
    scene = block(gravity=(0.0, 0.0, 0.0), step=0.002)
    run = FemRun(scene)
    v = np.random.default_rng(0).standard_normal(run.body.x_rest.shape) * 0.1
    points = len(run.body.surface.cell)
    state = BodyState(run.body.x_rest, v, np.zeros((points, 3)), np.full(points, -1, dtype=np.int32))
    run = FemRun(scene, state=state)
    energy = [np.inf]
    for _ in range(50):
        reply = run.step()
        energy.append(reply.kinetic + reply.strain)
        assert energy[-1] < energy[-2]


def test_the_seam_does_the_work_it_reports() -> None:
    """A constant force on seam nodes: its work plus gravity's is what energy gains and the integrator loses."""
    run = FemRun(block(step=0.001, gravity=(0.0, 0.0, 0.0)), seam=lambda body, cells: np.arange(9, dtype=np.int32))
    force = np.tile([0.0, 0.0, 0.01], (9, 1))
    energy = 0.0
    for _ in range(20):
        old_x, old_v = run.x.copy(), run.solver.state.v.copy()
        reply = run.step(force=force)
        moved = run.x[run.region.seam] - old_x[run.region.seam]
        np.testing.assert_allclose(reply.coupling.work, (force * moved).sum(), rtol=1e-12)
        jump = 0.5 * (run.parameters.mass[:, None] * (run.solver.state.v - old_v) ** 2).sum()
        gain = reply.kinetic + reply.strain - energy
        assert gain <= reply.coupling.work - jump + 1e-12
        energy += gain
