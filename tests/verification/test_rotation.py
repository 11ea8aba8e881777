"""Angular momentum changes by the torques of contact alone: bodies that spin, in every model, and how far they turn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from particle_run import ParticleRun, particle_scene
from pbd_run import PbdRun

import softseam
from softseam_protocol.scene.kinds import IntegratorKind
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body

Floats = NDArray[np.float64]
SIZE = (0.1, 0.05, 0.025)


def bar(spin: tuple[float, float, float], step: float, height: float = 0.5, fall: float = 0.0, **keys: Any) -> Scene:
    """A bar of gel that nothing draws, so high above a floor [m], to which it flies [m/s]."""
    body = {"spin": spin, "position": (0.0, 0.0, height), "velocity": (0.0, 0.0, -fall)}
    return block(SIZE, 0.025, 2e5, 0.4, 1e3, gravity=(0.0, 0.0, 0.0), step=step, body=body, **keys)


def by_integrator(scene: Scene, integrator: IntegratorKind) -> Scene:
    fem = scene.models.fem.model_copy(update={"integrator": integrator})
    return scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})


class Spin:
    """What of a rotation is seen step by step: momentum about the centre, and how far the body turned about z."""

    def __init__(self, mass: Floats, x: Floats, v: Floats) -> None:
        self._mass, self._rest = mass, x - mass @ x / mass.sum()
        self.angle, self._last = 0.0, 0.0
        self.start = self.momentum(x, v)

    def momentum(self, x: Floats, v: Floats) -> Floats:
        arms = x - self._mass @ x / self._mass.sum()
        return self._mass @ np.cross(arms, v)

    def inertia(self, x: Floats) -> float:
        """About z [kg m^2]."""
        arms = x - self._mass @ x / self._mass.sum()
        return float(self._mass @ (arms[:, :2] ** 2).sum(axis=1))

    def see(self, x: Floats) -> None:
        """Add what it turned by since it was seen last, by less than half a turn."""
        arms, rest = x - self._mass @ x / self._mass.sum(), self._rest
        sine = self._mass @ (arms[:, 1] * rest[:, 0] - arms[:, 0] * rest[:, 1])
        cosine = self._mass @ (arms[:, :2] * rest[:, :2]).sum(axis=1)
        angle = float(np.arctan2(sine, cosine))
        self.angle += (angle - self._last + np.pi) % (2.0 * np.pi) - np.pi
        self._last = angle

    def lost(self, x: Floats, v: Floats) -> float:
        """Of the momentum [1]."""
        return float(np.linalg.norm(self.momentum(x, v) - self.start) / np.linalg.norm(self.start))


@pytest.mark.parametrize("step", [0.002, 0.01, 0.02])
@pytest.mark.parametrize("rate", [3.0, 12.0, 40.0])
def test_a_free_bar_keeps_its_spin_by_fem(rate: float, step: float) -> None:
    """Momentum to 1e-6 a second, and the angle to .2 % of that of its spin over its inertia, as stretched as it is."""
    run = FemRun(bar((0.0, 0.0, rate), step))
    spin = Spin(run.parameters.mass, run.x, run.solver.state.v)
    time, expected = 0.4 if step < 0.01 else 2.0, 0.0
    for _ in range(round(time / step)):
        before = spin.inertia(run.x)
        run.step()
        spin.see(run.x)
        expected += step * float(spin.start[2]) * 0.5 * (1.0 / before + 1.0 / spin.inertia(run.x))
    assert spin.lost(run.x, run.solver.state.v) < 1e-6 * time
    assert spin.angle == pytest.approx(expected, rel=2e-3)
    assert spin.angle == pytest.approx(rate * time, rel=2e-2)


@pytest.mark.parametrize(("integrator", "rate"), [("bdf2", 15.0), ("generalised_alpha", 15.0), ("newmark", 5.0)])
def test_integrators_with_a_history_keep_a_spin(integrator: IntegratorKind, rate: float) -> None:
    """They kept 95 % of it in two seconds; the rate of their angle is 1 % slow at 15 rad/s."""
    scene = by_integrator(bar((0.0, 0.0, rate), 0.01), integrator)
    run = FemRun(scene)
    spin = Spin(run.parameters.mass, run.x, run.solver.state.v)
    for _ in range(200):
        run.step()
        spin.see(run.x)
    assert spin.lost(run.x, run.solver.state.v) < 2e-6
    assert spin.angle == pytest.approx(2.0 * rate, rel=0.02)


@pytest.mark.parametrize("integrator", ["bdf2", "generalised_alpha"])
def test_a_bar_that_bounced_keeps_its_spin(integrator: IntegratorKind) -> None:
    """It lands on a corner; once in flight its spin goes on as its momentum does, which follows forces late."""
    scene = bar((0.0, 3.0, 0.0), 0.005, 0.012, 0.3, tools={"floor": {"kind": "plane"}})
    run = FemRun(by_integrator(scene, integrator))
    spin = Spin(run.parameters.mass, run.x, run.solver.state.v)
    flown, pushed, kept = 0, False, []
    for _ in range(120):
        reply = run.step()
        touches = bool(np.abs(reply.wrench).max() > 0.0)
        pushed, flown = pushed or touches, 0 if touches else flown + 1
        if pushed and flown > 12:
            kept.append(spin.momentum(run.x, run.solver.state.v))
    assert len(kept) > 20
    assert np.abs(kept - kept[-1]).max() < 1e-4 * np.abs(kept[-1]).max()


@pytest.mark.parametrize(("rate", "step"), [(3.0, 0.01), (12.0, 0.02), (40.0, 0.01), (40.0, 0.02)])
def test_a_free_bar_keeps_its_spin_by_xpbd(rate: float, step: float) -> None:
    """As by FEM; the angle is that of substeps, which lose .7 % of the rate within a step at worst."""
    scene = bar((0.0, 0.0, rate), step)
    run = PbdRun(scene)
    spin, time, expected = Spin(run.solver.parameters.arrays.mass, run.x, run.fields().v), 1.0, 0.0
    for _ in range(round(time / step)):
        before = spin.inertia(run.x)
        run.step()
        spin.see(run.x)
        expected += step * float(spin.start[2]) * 0.5 * (1.0 / before + 1.0 / spin.inertia(run.x))
    assert spin.lost(run.x, run.fields().v) < 1e-6 * time
    assert spin.angle == pytest.approx(expected, rel=5e-3)


def test_a_free_mesh_of_particles_keeps_its_spin() -> None:
    body = {
        "kind": "tet_mesh",
        "size": (0.1, 0.05, 0.025),
        "divisions": (8, 4, 2),
        "position": (0.0, 0.0, 0.5),
        "young": 2e5,
        "poisson": 0.3,
        "density": 1000.0,
    }
    run = ParticleRun(particle_scene(body))
    run.v[:] = np.cross((2.0, 0.0, 12.0), run.x - run.x.mean(axis=0))
    spin = Spin(run.body.mass, run.x, run.v)
    run.run(1.0)
    assert spin.lost(run.x, run.v) < 1e-6


def cut_bar(rate: float, step: float, **keys: Any) -> Scene:
    """A bar whose left end is FEM's."""
    boxes = [{"min": (-1.0, -1.0, -1.0), "max": (-0.01, 1.0, 1.0)}]
    regions = {"default": "pbd", "near": {"model": "fem", "split": "always", "boxes": boxes}}
    return bar((1.0, 0.0, rate), step, regions=regions, **keys)


@pytest.mark.parametrize(("rate", "step"), [(3.0, 0.01), (12.0, 0.01)])
def test_a_bar_in_two_models_keeps_its_spin(rate: float, step: float) -> None:
    """The correction is the body's: none of the parts keeps its own momentum, and both together do."""
    scene = cut_bar(rate, step)
    with softseam.open(scene) as sim:
        start = sim.reset()
        body = build_body(scene, {})
        mass = np.zeros(body.n_nodes)
        np.add.at(mass, body.cell_nodes, body.cell_mass)
        spin = Spin(mass, np.asarray(start.positions), body.v_initial)
        for _ in range(50):
            seen = sim.step()
            spin.see(np.asarray(seen.positions))
        centre = mass @ seen.positions / mass.sum()
        left = np.asarray(seen.angular_momentum) - np.cross(centre, seen.momentum)
        assert np.linalg.norm(left - spin.start) < 1e-6 * 50 * step * np.linalg.norm(spin.start)
        assert np.linalg.norm(seen.momentum) < 1e-12 * mass.sum()
        assert spin.angle == pytest.approx(rate * 50 * step, rel=2e-2)


def test_a_snapshot_keeps_how_a_body_in_two_models_turns() -> None:
    """The steps after it are the same to the last bit, in the same session and in another one."""
    scene = cut_bar(12.0, 0.01)
    with softseam.open(scene) as sim:
        sim.reset()
        for _ in range(5):
            sim.step()
        kept = sim.snapshot()
        ends = [[sim.step() for _ in range(5)][-1]]
        sim.restore(kept)
        ends.append([sim.step() for _ in range(5)][-1])
    with softseam.open(scene) as other:
        other.restore(kept)
        ends.append([other.step() for _ in range(5)][-1])
    for end in ends[1:]:
        np.testing.assert_array_equal(end.positions, ends[0].positions)
        np.testing.assert_array_equal(end.angular_momentum, ends[0].angular_momentum)
