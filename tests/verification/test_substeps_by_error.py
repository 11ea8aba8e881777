"""Substeps as long as the error in time allows: the estimate, the order, first touches, determinism, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from test_fem_integrators import kicked, with_integrator

from softseam_protocol.messages.participant import BodyState
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import IntegratorKind
from softseam_protocol.scene.scene import Scene
from softseam_services.fem.substeps import DEEPEST
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

EDGE = 0.05


def bounded(scene: Scene, step_error: float | None) -> Scene:
    """The scene with substeps of this error, in cell edges."""
    fem = scene.models.fem.model_copy(update={"step_error": step_error})
    return scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})


def swinging(kind: IntegratorKind, step_error: float, radius: float | None = None) -> FemRun:
    """A clamped cube of one cell that is let go bent and stretched: large, nonlinear oscillations."""
    free = kicked(kind, radius)
    now, n_points = free.solver.state, len(free.body.surface.cell)
    state = BodyState(now.x, now.v, np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32))
    return FemRun(bounded(free.scene, step_error), state=state)


@pytest.mark.parametrize(
    ("kind", "radius"),
    [("implicit_euler", None), ("midpoint", None), ("midpoint", 0.8), ("bdf2", None), ("generalised_alpha", 0.5)],
)
def test_the_estimate_is_the_error(kind: IntegratorKind, radius: float | None) -> None:
    """One step in two halves against the same time in 400 steps of midpoint: within 20 %."""
    dt = 2e-4
    run = swinging(kind, 1.0, radius)
    reply = run.step(dt=dt)
    assert (reply.extras["n_substeps"], reply.extras["n_rejected"]) == (2, 0)
    exact = kicked("midpoint")
    exact.run(dt, dt=dt / 400)
    assert np.abs(run.x - exact.x).max() == pytest.approx(reply.extras["step_error"], rel=0.2)


@pytest.mark.parametrize(("kind", "order"), [("implicit_euler", 1), ("midpoint", 2), ("bdf2", 2)])
def test_the_error_follows_the_bound(kind: IntegratorKind, order: int) -> None:
    """A bound on each substep's error, of order p + 1, gives the motion one of order p: slope p/(p + 1) over the bound.

    Lengths go by powers of two, hence the width of the band; the bound itself is kept by every substep.
    """
    exact = kicked("midpoint")
    exact.run(0.02, dt=5e-5)
    bounds = [4e-4 / 4**k for k in range(4)]
    errors = []
    for bound in bounds:
        run = swinging(kind, bound)
        replies = run.run(0.02, dt=0.01)
        assert max(reply.extras["step_error"] for reply in replies) <= bound * EDGE
        errors.append(np.abs(run.x - exact.x).max())
    slope = np.polyfit(np.log(bounds), np.log(errors), 1)[0]
    assert slope == pytest.approx(order / (order + 1), abs=0.15)


def falling(step_error: float | None, kind: IntegratorKind = "implicit_euler") -> FemRun:
    """A stiff cube, 2 mm above the ground, that hits it at 0.5 m/s after 4 ms."""
    ground = {"ground": {"kind": "plane", "friction": 0.6}}
    body = {"position": (0.0, 0.0, 0.002), "velocity": (0.0, 0.0, -0.5)}
    scene = with_integrator(block(cell=0.05, young=100e3, body=body, tools=ground), kind)
    return FemRun(bounded(scene, step_error))


def test_a_first_touch_is_cut_and_quiet_flight_is_not() -> None:
    """Ten steps of 1 ms: long substeps before, short ones at the touch, rejected pieces counted, no energy gained."""
    exact = falling(None)
    exact.run(0.01, dt=1e-5)
    errors = []
    taken, rejected = [], []
    for bound in (1e-3, 1e-4, 1e-5):  # the last one cuts a step amid the touch to the deepest level
        run = falling(bound)
        replies = run.run(0.01, dt=1e-3)
        energy = [reply.kinetic + reply.strain + reply.gravity for reply in replies]
        assert (np.diff(energy) < 1e-9).all()
        errors.append(np.abs(run.x - exact.x).max())
        taken.append([reply.extras["n_substeps"] for reply in replies])
        rejected.append([reply.extras["n_rejected"] for reply in replies])
    assert max(taken[1][:3]) == 2
    assert max(taken[1][3:6]) >= 16
    assert rejected[1][0] == 0 < sum(rejected[1][3:6])
    assert errors[2] < errors[1] < 0.4 * errors[0]
    assert errors[1] < 2e-3 * EDGE


def test_a_bound_that_cannot_be_kept_ends_at_the_deepest_level() -> None:
    """Pieces of 2^-DEEPEST of the step are taken whatever their error, and the reply tells it."""
    run = swinging("implicit_euler", 1e-8)
    reply = run.step(dt=0.05)
    assert reply.extras["n_substeps"] == 2 << DEEPEST
    assert reply.extras["n_rejected"] == DEEPEST
    assert reply.extras["step_error"] > 1e-8 * EDGE


def arrays(run: FemRun) -> tuple[NDArray[np.float64], ...]:
    state = run.solver.state
    return state.x, state.v, state.contact, state.history


@pytest.mark.parametrize("kind", ["implicit_euler", "bdf2"])
def test_restored_repeated_and_uninterrupted_runs_are_the_same(kind: IntegratorKind) -> None:
    """Bit for bit: a snapshot amid a collision, and a step asked again from its start."""
    run, other = falling(1e-3, kind), falling(1e-3, kind)
    for one in (run, other):
        one.run(5e-3, dt=1e-3)
    other.solver.restore(run.solver.snapshot())
    for one in (run, other):
        one.run(3e-3, dt=1e-3)
    for a, b in zip(arrays(run), arrays(other), strict=True):
        np.testing.assert_array_equal(a, b)
    runs = []
    for _ in range(2):
        again = falling(1e-3, kind)
        again.run(4e-3, dt=1e-3)
        again.solver.advance(again.request(dt=2e-3))
        again.solver.advance(again.request(dt=1e-3, exchange=1))
        runs.append(again)
    for a, b in zip(arrays(runs[0]), arrays(runs[1]), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_report_tells_substeps() -> None:
    scene = bounded(
        block(cell=0.05, body={"position": (0.0, 0.0, 0.002)}, tools={"ground": {"kind": "plane"}}, step=0.01), 1e-3
    )
    scene = scene.model_copy(update={"regions": scene.regions.model_copy(update={"default": "fem"}), "duration": 0.05})
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(next(iter(simulation.step().parts.values())))
    simulation.close()
    assert sum(report.substeps for report in reports) > 20
    assert sum(report.rejected for report in reports) > 0
    assert 0.0 < max(report.step_error for report in reports) <= 1e-3 * EDGE


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"models": {"fem": {"step_error": 1e-3, "integrator": "static"}}}, "makes no error in time"),
        ({"models": {"fem": {"step_error": 1e-3, "integrator": "symplectic_euler"}}}, "what is stable"),
        ({"regions": {"default": "pbd", "near": {"within": 0.01}}}, "cannot meet a seam"),
    ],
)
def test_what_it_cannot_meet_is_refused_by_name(change: dict[str, Any], message: str) -> None:
    keys = {"models": {"fem": {"step_error": 1e-3}}, "tools": {"ground": {"kind": "plane"}}, **change}
    with pytest.raises(ValueError, match=message):
        Scene.model_validate({**block().model_dump(exclude={"models", "tools"}, exclude_none=True), **keys})


@pytest.mark.parametrize("dt", [5e-4, 1e-4, 2e-5])
def test_short_steps_gain_no_energy_in_contact(dt: float) -> None:
    """A multiplier that follows the gap one step late drives a light point: r has to grow with 1/dt^2.

    Without that a step of 0.1 ms throws the cube up by half its height, and shorter ones tear it.
    """
    run = falling(None)
    energy = np.array([reply.kinetic + reply.strain + reply.gravity for reply in run.run(8e-3, dt=dt)])
    rises = np.maximum(np.diff(energy), 0.0)
    assert rises.sum() < 1e-3 * energy[0]  # one of 2e-4, where points let go
    assert energy[-1] > 0.3 * energy[0]
