"""Ropes and rods against closed forms: catenary, cantilever, wave, pendulum; what a gripper carries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from particle_run import G, ParticleRun, particle_scene
from scipy.optimize import brentq

from softseam_protocol.scene.file import load_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation


def test_the_rope_scene_hangs_in_a_catenary() -> None:
    """y = a cosh(x/a), L = 2 a sinh(d/2a): shape within 0.3 % of the length, horizontal tension w a within 2 %."""
    simulation = Simulation(load_scene(Path(__file__).parents[2] / "scenes" / "rope.yaml").bundle, EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step(fields=False))
    for _ in range(300):  # until it hangs still
        reports.append(simulation.step({}, fields=False))
    x = simulation.frame().x
    simulation.close()
    span, length, weight = float(x[-1, 0] - x[0, 0]), 1.0, 0.05 * G
    a = brentq(lambda a: 2.0 * a * np.sinh(0.5 * span / a) - length, 0.05, 10.0)
    middle = 0.5 * (x[0, 0] + x[-1, 0])
    catenary = a * np.cosh((x[:, 0] - middle) / a) - a * np.cosh(0.5 * span / a) + x[0, 2]
    assert np.abs(x[:, 2] - catenary).max() < 0.003 * length
    wrench = np.mean([report.wrench for report in reports[-50:]], axis=0)
    assert wrench[0, 0] == pytest.approx(weight * a, rel=0.02)
    assert wrench[1, 0] == pytest.approx(-weight * a, rel=0.02)
    assert wrench[:, 2].sum() == pytest.approx(-weight * length, rel=0.002)


@pytest.mark.parametrize(("divisions", "accuracy"), [(20, 0.005), (40, 0.06)])
def test_a_rod_bends_as_a_cantilever(divisions: int, accuracy: float) -> None:
    """Clamped at its first two particles and pulled by its weight: w = q L'^4/(8 E I), L' from the middle of the two.

    A deflection of 2 % of the length is as good as linear. With half the spacing a bend is eight times as stiff and its
    particles half as heavy: the same 2400 sweeps a step leave the rod 4 % too soft.
    """
    length, density, spacing = 1.0, 0.1, 1.0 / divisions
    bending = density * G * length**4 / (8.0 * 0.02 * length)
    rod = {
        "kind": "rope",
        "length": length,
        "divisions": divisions,
        "density": density,
        "stretch": 1e4,
        "bending": bending,
        "damping": 20.0,
        "fixed": [{"min": (-0.5, -1.0, -1.0), "max": (-0.5 + spacing, 1.0, 1.0)}],
    }
    run = ParticleRun(particle_scene(rod, gravity=(0.0, 0.0, -G), pbd={"substeps": 60, "sweeps": 40}))
    run.run(1.5)
    assert -run.x[-1, 2] == pytest.approx(0.02 * length * (1.0 - 0.5 / divisions) ** 4, rel=accuracy)
    assert np.abs(run.v).max() < 1e-4


def test_a_wave_runs_along_a_rope_at_its_speed() -> None:
    """A pull on the end arrives after L/c, c = sqrt(E A/rho): within 5 % of the time."""
    rope = {"kind": "rope", "length": 1.0, "divisions": 100, "density": 0.05, "stretch": 20.0}
    run = ParticleRun(particle_scene(rope, step=1e-3, pbd={"substeps": 10}))
    run.v[-1, 0] = 0.05
    speed = np.sqrt(20.0 / 0.05)
    arrival = 0.0
    while abs(run.v[0, 0]) < 1e-3 and arrival < 0.2:
        run.step()
        arrival += 1e-3
    assert arrival == pytest.approx(1.0 / speed, rel=0.06)


def test_a_weight_on_a_string_swings_as_a_pendulum() -> None:
    """One link, stiff: period 2 pi sqrt(L/g) (1 + t^2/16), t = 0.1 rad; within 0.5 %."""
    angle = 0.1
    rope = {
        "kind": "rope",
        "length": 0.5,
        "divisions": 1,
        "density": 0.2,
        "stretch": 1e5,
        "rotation": (0.0, np.pi / 2 - angle, 0.0),
        "radius": 0.01,
        "fixed": [{"min": (-1.0, -1.0, 0.0), "max": (1.0, 1.0, 1.0)}],
    }
    run = ParticleRun(particle_scene(rope, gravity=(0.0, 0.0, -G), pbd={"substeps": 20}))
    free = int(np.flatnonzero(~run.body.fixed)[0])
    pivot = run.x[1 - free, 0]
    side, crossings = np.sign(run.x[free, 0] - pivot), []
    for n in range(300):
        before = run.x[free, 0] - pivot
        run.step()
        after = run.x[free, 0] - pivot
        if np.sign(after) != side:
            crossings.append(0.01 * (n + before / (before - after)))
            side = np.sign(after)
    period = 2.0 * np.diff(crossings).mean()
    assert period == pytest.approx(2.0 * np.pi * np.sqrt(0.5 / G) * (1.0 + angle**2 / 16.0), rel=0.005)


def test_a_gripper_carries_what_hangs_from_it() -> None:
    """A rope that hangs still from a gripper weighs m g; lifting it takes weight, drag and speed."""
    rope = {
        "kind": "rope",
        "length": 0.5,
        "divisions": 25,
        "density": 0.1,
        "stretch": 1e3,
        "rotation": (0.0, np.pi / 2, 0.0),
        "damping": 4.0,
    }
    tools = {"hand": {"kind": "sphere", "radius": 0.02, "position": (0.0, 0.0, 0.276)}}
    run = ParticleRun(particle_scene(rope, gravity=(0.0, 0.0, -G), tools=tools))
    run.gripping[:] = 1
    run.run(2.0)
    reply = run.step()
    assert reply.extras["held"] >= 1
    weight = run.body.total_mass * G
    assert reply.wrench[0, 2] == pytest.approx(-weight, rel=1e-3)
    run.velocity[0, 2] = 0.1
    work = sum(run.step().tool_work for _ in range(100))
    mass, drag = run.body.total_mass, 4.0
    assert work == pytest.approx((weight + mass * drag * 0.1) * 0.1 + 0.5 * mass * 0.1**2, rel=0.01)
    run.gripping[:] = 0
    run.velocity[:] = 0.0
    height = run.x[:, 2].mean()
    run.run(0.1)
    last = G / drag  # speed of a long fall
    fall = last * 0.1 - (last + 0.1) * (1.0 - np.exp(-drag * 0.1)) / drag
    assert height - run.x[:, 2].mean() == pytest.approx(fall, rel=0.02)
