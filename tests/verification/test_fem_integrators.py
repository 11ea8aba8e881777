"""FEM's integrators: order, energy, contact, history, and the pairs that are refused."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from fem_run import FemRun, block, tofu
from numpy.typing import NDArray

from softseam_protocol.messages.participant import BodyState
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import INTEGRATORS, IntegratorKind
from softseam_protocol.scene.models import FemSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.fem.integrators.symplectic_euler import SAFETY
from softseam_services.fem.kernels.cells import strain_energy
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

CLAMPED = {"fixed": [{"min": (-1.0, -1.0, -1e-6), "max": (1.0, 1.0, 1e-6)}]}
WEIGHT = 1050.0 * 0.05**3 * 9.81


def with_integrator(scene: Scene, kind: IntegratorKind, radius: float | None = None) -> Scene:
    """The scene with another integrator; what it may meet is not checked."""
    fem = FemSpec(integrator=kind, radius=radius, tolerance=1e-9)
    return scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})


def kicked(kind: IntegratorKind, radius: float | None = None) -> FemRun:
    """A clamped cube of one cell, bent and stretched, with such velocities too, large enough to be nonlinear."""
    scene = with_integrator(block(cell=0.05, poisson=0.3, gravity=(0.0, 0.0, 0.0), body=CLAMPED), kind, radius)
    run = FemRun(scene)
    rest = run.body.x_rest
    v = np.zeros_like(rest)
    v[:, 0] = 0.6 * np.sin(np.pi * rest[:, 2] / 0.1) ** 2
    v[:, 2] = 0.3 * np.sin(np.pi * rest[:, 2] / 0.1)
    x = rest + 4e-3 * v
    n_points = len(run.body.surface.cell)
    state = BodyState(x, v, np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32))
    return FemRun(scene, state=state)


def energies(run: FemRun, time: float, dt: float) -> NDArray[np.float64]:
    """Kinetic + strain energy after each step, over the initial one."""
    v = run.solver.state.v
    kinetic = 0.5 * float((run.parameters.mass[:, None] * v**2).sum())
    start = kinetic + float(strain_energy(run.x, run.model, run.parameters, run.work))
    return np.array([r.kinetic + r.strain for r in run.run(time, dt=dt)]) / start


ORDERS: list[tuple[IntegratorKind, float | None, float]] = [
    ("implicit_euler", None, 1.0),
    ("midpoint", None, 2.0),
    ("midpoint", 0.8, 1.0),
    ("bdf2", None, 2.0),
    ("newmark", None, 2.0),
    ("generalised_alpha", 0.0, 2.0),
    ("generalised_alpha", 0.5, 2.0),
    ("generalised_alpha", 1.0, 2.0),
    ("symplectic_euler", None, 1.0),
]


@pytest.mark.parametrize(("kind", "radius", "order"), ORDERS)
def test_order(kind: IntegratorKind, radius: float | None, order: float) -> None:
    """Fitted slope of the difference between successive halvings, every node of the body, 6.4 ms."""
    ends = []
    for dt in (2e-4, 1e-4, 5e-5, 2.5e-5):
        run = kicked(kind, radius)
        run.run(6.4e-3, dt=dt)
        ends.append(run.x.copy())
    jumps = [np.abs(a - b).max() for a, b in pairwise(ends)]
    slope = -np.polyfit(np.arange(3), np.log2(jumps), 1)[0]
    assert slope == pytest.approx(order, abs=0.12)


def test_bdf2_keeps_its_order_with_uneven_steps() -> None:
    """Steps that alternate 1 : 2 : 1 ..., as where a step is cut."""
    ends = []
    for n in (4, 8, 16, 32):
        run = kicked("bdf2")
        dt = 6.4e-3 / (3 * n)
        for _ in range(n):
            run.step(dt=dt)
            run.step(dt=2 * dt)
        ends.append(run.x.copy())
    jumps = [np.abs(a - b).max() for a, b in pairwise(ends)]
    assert np.log2(jumps[-2] / jumps[-1]) == pytest.approx(2.0, abs=0.15)


KEPT: list[tuple[IntegratorKind, float | None, float, float]] = [
    # share of the energy left after 0.5 s, 30 periods of the slowest oscillation: least, most
    ("midpoint", None, 0.999, 1.002),
    ("newmark", None, 0.99, 1.03),
    ("generalised_alpha", 1.0, 0.999, 1.002),
    ("symplectic_euler", None, 0.9, 1.05),
    ("generalised_alpha", None, 0.97, 1.01),
    ("bdf2", None, 0.85, 1.001),
    ("implicit_euler", None, 0.0, 1.0),
]


@pytest.mark.parametrize(("kind", "radius", "least", "most"), KEPT)
def test_energy_of_a_free_oscillation(kind: IntegratorKind, radius: float | None, least: float, most: float) -> None:
    """Steps of 1 ms. The four that conserve keep energy within 0.2 % (midpoint; generalised-alpha with radius 1, which
    is the same), 3 % (Newmark) and 10 % (symplectic Euler, which swings); implicit Euler loses 90 % of it."""
    energy = energies(kicked(kind, radius), 0.5, 1e-3)
    assert energy.min() >= least
    assert energy.max() <= most
    if kind == "implicit_euler":
        assert (np.diff(energy) < 0.0).all()
        assert energy[-1] < 0.15


def test_symplectic_euler_divides_steps_beyond_its_limit() -> None:
    """A step of 10 ms, six times the longest stable one: energy stays bounded."""
    run = kicked("symplectic_euler")
    energy = energies(run, 2.0, 0.01)
    assert 0.01 > 2.0 * run.stepper.scheme.parameters[1] / SAFETY
    assert 0.85 < energy.min() < energy.max() < 1.1


@pytest.mark.parametrize("kind", ["midpoint", "bdf2", "newmark", "generalised_alpha", "symplectic_euler"])
def test_snapshots_carry_the_history(kind: IntegratorKind) -> None:
    """Continuing from restored bytes is the same, bit for bit, as not to stop."""
    run, other = kicked(kind), kicked(kind)
    run.run(5e-3, dt=1e-3)
    other.solver.restore(run.solver.snapshot())
    for one in (run, other):
        one.run(5e-3, dt=1e-3)
    np.testing.assert_array_equal(run.x, other.x)
    np.testing.assert_array_equal(run.solver.state.v, other.solver.state.v)


@pytest.mark.parametrize("kind", ["bdf2", "generalised_alpha"])
def test_a_step_asked_again_is_the_same(kind: IntegratorKind) -> None:
    """An exchange repeats a step from its start, history included."""
    run, other = kicked(kind), kicked(kind)
    for one in (run, other):
        one.run(4e-3, dt=1e-3)
    run.solver.advance(run.request(dt=2e-3))
    run.solver.advance(run.request(dt=1e-3, exchange=1))
    other.solver.advance(other.request(dt=1e-3))
    np.testing.assert_allclose(run.x, other.x, atol=1e-11)


# ---- contact -----------------------------------------------------------------------------------------------


def dropped(kind: IntegratorKind, dt: float, radius: float | None = None) -> tuple[NDArray[np.float64], list[float]]:
    """A cube of one cell falls 2 mm onto the ground: all its energy over that of the fall, and the ground's force."""
    ground = {"ground": {"kind": "plane", "friction": 0.6}}
    scene = with_integrator(block(cell=0.05, body={"position": (0.0, 0.0, 0.002)}, tools=ground), kind, radius)
    run = FemRun(scene)
    energy, force = [], []
    for _ in range(round(1.5 / dt)):
        reply = run.solver.advance(run.request(dt=dt))
        if reply.status != "converged":
            break
        run.n_steps += 1
        energy.append((reply.kinetic + reply.strain + reply.gravity) / (WEIGHT * 0.002))
        force.append(-reply.wrench[0, 2])
    return np.array(energy), force


@pytest.mark.parametrize(
    "kind", sorted(name for name, facts in INTEGRATORS.items() if facts.meets_tools and facts.moves)
)
def test_a_dropped_body_gains_nothing_and_comes_to_rest(kind: IntegratorKind) -> None:
    energy, force = dropped(kind, 5e-3)
    assert energy.max() < 1e-9
    np.testing.assert_allclose(force[-50:], WEIGHT, rtol=0.01)


def test_why_newmark_may_not_meet_tools() -> None:
    """The failing control: its energy grows a thousandfold before the step that cannot be solved."""
    energy, _ = dropped("newmark", 5e-3)
    assert len(energy) == 0 or energy.max() > 1e3


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", sorted(name for name, facts in INTEGRATORS.items() if facts.meets_tools and facts.moves)
)
def test_every_integrator_grips_with_the_same_force(kind: IntegratorKind) -> None:
    """Scene B on 2^3 cells: held at 15 %, then lifted. The integrators differ in how long the body swings."""
    run = FemRun(with_integrator(tofu(), kind))
    close = {"left": (0.02, 0.0, 0.0), "right": (-0.02, 0.0, 0.0)}
    lift = {"left": (0.0, 0.0, 0.05), "right": (0.0, 0.0, 0.05)}
    run.run(0.2)
    run.run(0.2125, close)
    held = run.run(0.3)[-1]
    run.run(0.3, lift)
    lifted = run.run(0.2)[-1]
    assert abs(held.wrench[1, 0]) == pytest.approx(13.33, rel=0.005)
    assert abs(lifted.wrench[1, 0]) == pytest.approx(10.46, rel=0.005)


# ---- statics -----------------------------------------------------------------------------------------------


def cantilever(young: float) -> Scene:
    """Scene A: 0.2 x 0.05 x 0.05 m, clamped at x = 0, on 4 x 1 x 1 cells."""
    clamp = {"position": (0.1, 0.0, -0.025), "fixed": [{"min": (-1e-6, -1.0, -1.0), "max": (1e-6, 1.0, 1.0)}]}
    return block((0.2, 0.05, 0.05), 0.05, young, 0.4, 1000.0, body=clamp)


def tip_of(run: FemRun) -> float:
    tip = np.argmin(np.linalg.norm(run.body.x_rest - [0.2, 0.0, 0.0], axis=1))
    return float((run.x - run.body.x_rest)[tip, 2])


def test_statics_is_where_motion_settles() -> None:
    """Scene A: settled tip -85.75 mm by independent codes, 2 % less on these cells; a second step changes nothing."""
    static = FemRun(with_integrator(cantilever(100e3), "static"))
    reply = static.step()
    tip = tip_of(static)
    assert tip == pytest.approx(-0.08575, rel=0.025)
    assert reply.kinetic == 0.0
    static.step()
    assert tip_of(static) == pytest.approx(tip, abs=1e-9)
    moving = FemRun(with_integrator(cantilever(100e3), "implicit_euler"))
    moving.run(6.0, dt=0.05)
    assert tip_of(moving) == pytest.approx(tip, rel=1e-4)


def test_a_great_load_is_raised_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A beam of E 20 kPa hangs down by nearly its length; in parts, or at once where there is patience for that.

    Snapshots carry the share of the load that is borne: the restored beam stays where it is.
    """
    scene = with_integrator(cantilever(20e3), "static")
    run = FemRun(scene)
    patient = run.step()
    monkeypatch.setattr("softseam_services.fem.step.CAREFUL_ITERATIONS", 5)
    fem = scene.models.fem.model_copy(update={"iterations": 20})
    hasty = FemRun(scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})}))
    assert hasty.step().extras["iterations"] > 2 * patient.extras["iterations"]
    assert tip_of(hasty) == pytest.approx(tip_of(run), abs=1e-7)
    assert tip_of(run) < -0.18
    hasty.solver.restore(run.solver.snapshot())
    hasty.step()
    assert tip_of(hasty) == pytest.approx(tip_of(run), abs=1e-7)


def test_statics_in_contact() -> None:
    """A clamped cube pressed flat by 10 %: the force is where implicit Euler's settles."""
    plate = {"top": {"kind": "box", "size": (0.2, 0.2, 0.01), "position": (0.0, 0.0, 0.055), "friction": 0.3}}
    forces = []
    settled: tuple[tuple[IntegratorKind, int, float], ...] = (("static", 5, 0.1), ("implicit_euler", 50, 0.01))
    for kind, n, dt in settled:
        run = FemRun(with_integrator(block(gravity=(0.0, 0.0, 0.0), body=CLAMPED, tools=plate), kind))
        run.run(n * dt, {"top": (0.0, 0.0, -0.01)}, dt=dt)
        forces.append(run.run(3 * dt, dt=dt)[-1].wrench[0, 2])
    assert forces[0] == pytest.approx(forces[1], rel=0.01)
    assert forces[0] > 5.0


# ---- the seam ----------------------------------------------------------------------------------------------


def swung(kind: IntegratorKind, near: str) -> tuple[NDArray[np.float64], float]:
    """A clamped bar that swings under gravity, its far half PBD: total energy after each step, and the largest gap."""
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "swing",
            "step": 0.002,
            "duration": 0.3,
            "gravity": (0.0, 0.0, -2.0),
            "body": {
                "shape": {"kind": "block", "size": (0.12, 0.03, 0.03)},
                "cell": 0.03,
                "material": {"young": 1e5, "poisson": 0.3, "density": 1000.0},
                "fixed": [{"min": (-0.0601, -1.0, -1.0), "max": (-0.0599, 1.0, 1.0)}],
            },
            "regions": {
                "default": "pbd",
                "near": {"model": near, "split": "always", "boxes": [{"min": (-1, -1, -1), "max": (0.0, 1, 1)}]},
            },
            "models": {"fem": {"integrator": kind}},
        }
    )
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    energy, gap = [], 0.0
    while not simulation.done:
        report = simulation.step()
        energy.append(sum(report.energy[part] for part in ("kinetic", "strain", "gravity")))
        gap = max(gap, report.seam.gap)
    simulation.close()
    return np.array(energy), gap


def test_midpoint_beside_pbd_gains_nothing_and_loses_less() -> None:
    """From rest at zero energy the total never rises above it, and the FEM half loses less than with implicit Euler."""
    midpoint, gap = swung("midpoint", "fem")
    euler, _ = swung("implicit_euler", "fem")
    assert midpoint.max() < 0.0
    assert gap < 3e-4 * 0.03 * 1.01  # the seam's own tolerance
    assert midpoint[-1] > 0.5 * euler[-1]


@pytest.mark.parametrize("kind", ["implicit_euler", "midpoint"])
def test_compliance_is_the_derivative_of_the_end(kind: IntegratorKind) -> None:
    """d(coupling.x)/d(coupling_force) against central differences, in a body that moves and is bent."""

    def at(force: NDArray[np.float64], compliance: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        scene = with_integrator(block(cell=0.05, poisson=0.3, body=CLAMPED), kind, 0.7 if kind == "midpoint" else None)
        run = FemRun(scene, seam=lambda body, cells: np.flatnonzero(body.x_rest[:, 2] > 0.049).astype(np.int32))
        run.run(0.02, dt=0.005, force=np.tile([0.05, 0.0, -0.02], (9, 1)))
        reply = run.solver.advance(run.request(dt=0.005, force=force, compliance=compliance))
        return reply.coupling.x, reply.coupling.compliance

    rest = np.tile([0.05, 0.0, -0.02], (9, 1))
    inverse = at(rest, True)[1]
    for column in (0, 13, 26):
        step = np.zeros(27)
        step[column] = 1e-3
        way = step.reshape(9, 3)
        difference = (at(rest + way)[0] - at(rest - way)[0]).reshape(-1) / 2e-3
        np.testing.assert_allclose(inverse[:, column], difference, atol=2e-4 * np.abs(inverse).max())


def test_a_snapshot_of_another_integrator_is_refused() -> None:
    """A snapshot of one integrator is not taken by one that keeps more."""
    run = kicked("midpoint")
    run.run(2e-3, dt=1e-3)
    with pytest.raises(ValueError, match="not of an FEM region of this size"):
        kicked("bdf2").solver.restore(run.solver.snapshot())
