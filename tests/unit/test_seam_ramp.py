"""A seam force that is linear in time, as both participants take it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from pbd_run import CLAMP_LEFT, PbdRun, block_scene

from softseam_protocol.messages.participant import Advance, Advanced
from softseam_protocol.scene.kinds import IntegratorKind
from softseam_protocol.scene.scene import Scene
from softseam_services.fem.integrators.table import build_scheme, forces_at, velocity_gain, works_at

Floats = NDArray[np.float64]
Run = FemRun | PbdRun
DT = 0.004


def fem(integrator: str) -> FemRun:
    scene = block(gravity=(0.0, 0.0, 0.0), models={"fem": {"tolerance": 1e-9, "integrator": integrator}})
    return FemRun(scene, seam=lambda body, cells: np.arange(6, dtype=np.int32))


def pbd(substeps: int = 7) -> PbdRun:
    scene = block_scene((0.1, 0.025, 0.025), step=DT, fixed=CLAMP_LEFT, pbd={"substeps": substeps})
    return PbdRun(scene, seam=np.flatnonzero(PbdRun(scene).body.x_rest[:, 0] > 0.049).astype(np.int32))


def ramped(run: Run, start: Floats, end: Floats, compliance: bool = False, exchange: int = 0) -> Advance:
    request = run.request(end) if isinstance(run, PbdRun) else run.request(force=end, dt=DT)
    header = dataclasses.replace(request.header, exchange=exchange)
    return dataclasses.replace(request, header=header, dt=DT, compliance=compliance, coupling_force_start=start)


def forces(run: Run, seed: int) -> Floats:
    return 1e-3 * np.random.default_rng(seed).normal(size=(len(run.region.seam), 3))


def moving(run: Run) -> Run:
    """After three steps under forces, so that integrators have a history."""
    for seed in range(3):
        reply = run.solver.advance(ramped(run, forces(run, seed), forces(run, seed + 1)))
        assert reply.status == "converged"
        run.solver.commit()
        run.n_steps += 1
    return run


RAMPED: tuple[IntegratorKind, ...] = ("implicit_euler", "midpoint", "bdf2", "newmark", "generalised_alpha")
RUNS: dict[str, Any] = {
    **{name: (lambda name=name: fem(name)) for name in RAMPED},
    "pbd": pbd,
}


@pytest.mark.kernels
@pytest.mark.parametrize("name", RUNS)
def test_compliance_of_a_ramp_is_the_derivative_of_the_velocities(name: str) -> None:
    run = moving(RUNS[name]())
    start, end = forces(run, 3), forces(run, 4)
    reply: Advanced = run.solver.advance(ramped(run, start, end, compliance=True))
    assert reply.status == "converged"
    way = forces(run, 5)
    ahead, behind = (
        run.solver.advance(ramped(run, start, end + sign * way, exchange=i + 1)).coupling.v
        for i, sign in enumerate((0.5, -0.5))
    )
    expected = (ahead - behind).ravel()
    # the probe of PBD stands still and looks at its neighbourhood, as that of a constant force does
    off = np.linalg.norm(reply.coupling.compliance @ way.ravel() - expected) / np.linalg.norm(expected)
    assert off < (0.06 if name == "pbd" else 1e-3), off


@pytest.mark.kernels
@pytest.mark.parametrize("name", RUNS)
def test_a_ramp_that_does_not_rise_is_a_constant_force(name: str) -> None:
    one, two = moving(RUNS[name]()), moving(RUNS[name]())
    force = forces(one, 9)
    ramp = one.solver.advance(ramped(one, force, force))
    constant = two.solver.advance(dataclasses.replace(ramped(two, force, force), coupling_force_start=np.zeros((0, 3))))
    np.testing.assert_array_equal(ramp.coupling.x, constant.coupling.x)
    assert ramp.coupling.work == pytest.approx(constant.coupling.work, rel=1e-12)
    assert ramp.coupling.v.shape == force.shape
    assert constant.coupling.v.shape == (0, 3)


@pytest.mark.kernels
def test_every_substep_of_pbd_feels_its_own_force() -> None:
    """A ramp over a step of seven substeps is seven steps of one substep under forces that rise by a seventh."""
    run, parts = pbd(), pbd(1)
    start, end = forces(run, 0), forces(run, 1)
    whole = run.solver.advance(ramped(run, start, end))
    work = 0.0
    for j in range(7):
        force = start + (j + 1) / 7 * (end - start)
        request = dataclasses.replace(parts.request(force), dt=DT / 7)
        reply = parts.solver.advance(request)
        parts.solver.commit()
        parts.n_steps += 1
        work += reply.coupling.work
    np.testing.assert_allclose(whole.coupling.x, reply.coupling.x, atol=1e-9)
    assert whole.coupling.work == pytest.approx(work, rel=1e-4)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["bdf2", "newmark"])
def test_a_ramp_works_over_parts_of_a_step_as_over_as_many_steps(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that is too hard at once is taken in parts."""
    monkeypatch.setattr("softseam_services.fem.step.CAREFUL_ITERATIONS", 4)
    hard, parts = fem(name), fem(name)
    hard.stepper._spec = hard.stepper._spec.model_copy(update={"iterations": 4})
    start, end = 300.0 * forces(hard, 3), 300.0 * forces(hard, 4)
    reply = hard.solver.advance(ramped(hard, start, end))
    n = int(reply.extras["n_substeps"])
    assert reply.status == "converged" and n > 1
    work = 0.0
    for j in range(n):
        request = ramped(parts, start + j / n * (end - start), start + (j + 1) / n * (end - start))
        part = parts.solver.advance(dataclasses.replace(request, dt=DT / n))
        work += part.coupling.work
        parts.n_steps += 1
    np.testing.assert_allclose(reply.coupling.x, part.coupling.x, atol=1e-9)
    assert reply.coupling.work == pytest.approx(work, rel=1e-6)


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("name", "acts", "works"),
    [("implicit_euler", 1.0, 1.0), ("midpoint", 0.5, 0.5), ("bdf2", 1.0, 0.5), ("newmark", 1.0, 0.5)],
)
def test_where_a_ramp_acts_and_works(name: str, acts: float, works: float) -> None:
    run = fem(name)
    scheme = build_scheme(run.scene.models.fem, run.model, run.parameters, run.work, False)
    assert (forces_at(scheme, DT), works_at(scheme, DT)) == (acts, works)
    first = 0.5 if name != "implicit_euler" else 1.0  # without a history a step of midpoint
    assert forces_at(scheme, 0.0) == first
    assert velocity_gain(scheme, DT, 0.0) == 1.0 / (first * DT)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["implicit_euler", "pbd"])
def test_ramps_that_make_no_sense_are_refused(name: str) -> None:
    run = RUNS[name]()
    end = forces(run, 0)
    good = ramped(run, end, end)
    cases = {
        "at the step's start has shape": dataclasses.replace(good, coupling_force_start=np.zeros((1, 3))),
        "not finite": dataclasses.replace(good, coupling_force_start=np.full_like(end, np.nan)),
        "send one of the two": dataclasses.replace(good, coupling_target=np.zeros_like(end)),
    }
    before = run.solver.snapshot()
    for words, request in cases.items():
        reply = run.solver.advance(request)
        assert words in reply.why
        assert reply.status != "converged"
        assert np.isfinite(reply.coupling.v).all()
        assert run.solver.snapshot() == before


def test_the_default_scheme_is_position() -> None:
    scene: Scene = block_scene()
    assert scene.seam.scheme == "position"
