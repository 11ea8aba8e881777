"""XPBD bodies whose stress relaxes: beside the point, its integrals and FEM, with every joule found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun
from held_blocks import Held
from hexahedra import lattice, vtk
from pbd_run import PbdRun, block_scene
from relaxing import CASES, MU, POISSON, TWO, YOUNG, Point, said

import softseam
from softseam_protocol.scene.scene import Scene
from softseam_services.pbd.kernels.block_rows import FOLD, HELD, LOST
from softseam_services.pbd.kernels.sweep import block_forces

EDGE = 0.05
RAMP, SQUEEZE = 0.4, 0.25

Branches = tuple[tuple[float, float], ...]


def material(branches: Branches = TWO, **own: Any) -> dict[str, Any]:
    return {"young": YOUNG, "poisson": POISSON, "density": 10.0, "relaxation": said(branches)} | own


def plates(friction: float) -> dict[str, Any]:
    plate = {"kind": "box", "size": (0.01, 0.2, 0.2), "friction": friction}
    left, right = ({"position": (side * (0.5 * EDGE + 0.005), 0.0, 0.025)} for side in (-1.0, 1.0))
    return {"left": plate | left, "right": plate | right}


def cube(friction: float = 0.0, step: float = 0.01, cell: float = EDGE, **own: Any) -> PbdRun:
    return PbdRun(block_scene(cell=cell, step=step, tools=plates(friction), body={"material": material(**own)}))


def squeezed(run: PbdRun, time: float) -> tuple[list[Any], list[float]]:
    """Replies of steps until this time, the ramp at first, and the stretch that the plates give the cube."""
    speed, replies, stretches, dt = 0.5 * SQUEEZE * EDGE / RAMP, [], [], run.scene.step
    for n in range(int(time / dt + 0.5)):
        closing = speed if (n + 0.5) * dt < RAMP else 0.0
        run.velocity[0, 0], run.velocity[1, 0] = closing, -closing
        replies.append(run.step())
        stretches.append(float(np.ptp(run.solver.committed.x[:, 0])) / EDGE)
        assert (run.solver.parameters.blocks.constants.fold[:, LOST - FOLD] >= 0.0).all()
    return replies, stretches


def force(reply: Any) -> float:
    """With which a plate presses, the mean of a step [N]."""
    return float(abs(reply.wrench[0, 0]))


def mean(values: Any) -> np.ndarray:
    """Of each step, of what is linear in it, from its ends."""
    values = np.asarray(values)
    return np.asarray(0.5 * (values + np.concatenate([[0.0], values[:-1]])))


@pytest.mark.parametrize("density", [10.0, 1000.0])
def test_a_cube_between_plates_is_the_bar_of_the_differential_equation(density: float) -> None:
    """Squeezed by 25 % in .4 s and held until 5 s, in steps of 10 ms: .2 % of the integral, and .05 % of the point, in
    66 substeps, sixteen of a fold, and in seven; the heavy one once it has rung out."""
    replies, stretches = squeezed(cube(density=density), 5.0)
    point, times = Point(TWO), 0.01 * (0.5 + np.arange(len(replies)))
    forces, case = np.array([force(reply) for reply in replies]), CASES["relaxation"]
    expected = -np.array(case["P"]) * EDGE**2
    found, held = np.interp(case["t"], times, forces), np.array(case["t"]) > RAMP + 0.1
    alone = mean([-point.pull(stretch, 0.01) * EDGE**2 for stretch in stretches])
    np.testing.assert_allclose(found[held], expected[held], rtol=2e-3)
    np.testing.assert_allclose(forces[60:], alone[60:], rtol=5e-4)


def ragged(**own: Any) -> PbdRun:
    """A block of hexahedra that are no boxes."""
    points, cells = lattice((2, 2, 2), (EDGE,) * 3)
    points += 0.15 * EDGE / 2 * np.random.default_rng(6).uniform(-1.0, 1.0, points.shape)
    body = {"shape": {"kind": "mesh", "path": "m.vtk", "cells": "own"}, "cell": None, "material": material(**own)}
    return PbdRun(block_scene(body=body), files={"m.vtk": vtk(points, cells)})


def blocks_of(branches: Branches = TWO, cell: float = EDGE, run: PbdRun | None = None, **own: Any) -> Held:
    """Blocks of a cube."""
    return Held(run or PbdRun(block_scene(cell=cell, body={"material": material(branches, **own)})))


def some(seed: int, size: float) -> np.ndarray:
    return np.eye(3) + size * np.random.default_rng(seed).normal(size=(3, 3))


@pytest.mark.parametrize("boxes", [True, False])
def test_a_block_is_the_point(boxes: bool) -> None:
    """Stress, stored energy and state on any way, also of hexahedra that are no boxes; what is dissipated to 3 %, by
    other weights of a way's ends."""
    held, point = blocks_of(run=None if boxes else ragged()), Point(TWO)
    volume = float(held.numbers.volume.sum())
    for seed in range(4):
        for n in range(1, 21):
            F = some(seed, 0.2) * n / 20.0 + (some(seed - 1, 0.2) if seed else np.eye(3)) * (1.0 - n / 20.0)
            held.go(held.rest @ F.T, 0.002)
            P = point.go(F, 0.002)
            if boxes:
                np.testing.assert_allclose(held.P, P, atol=1e-9 * MU)
            assert held.stored == pytest.approx(volume * point.stored, rel=1e-9)
            np.testing.assert_allclose(held.memory[0, :18, 0], point.state, atol=1e-12)
    assert held.dissipated == pytest.approx(volume * point.dissipated, rel=0.03)


@pytest.mark.parametrize("boxes", [True, False])
def test_stress_is_the_derivative_of_what_a_block_stores(boxes: bool) -> None:
    """Of a fold for 8 ms to come, bent and sheared: by central differences, of all nodes."""
    held = blocks_of(cell=EDGE / 2, run=None if boxes else ragged())
    rng = np.random.default_rng(0)
    for n in range(4):
        held.go(held.rest @ some(n, 0.1).T + 1e-3 * rng.normal(size=held.rest.shape), 0.01, 8e-3, 4e-3)
    x, d, h = held.xw[: len(held.rest), :3].copy(), rng.normal(size=held.rest.shape), 1e-7
    _ = held.P
    pull = np.zeros((len(held.rest) + 8, 4))
    block_forces(held.ws, held.nodes, held.stress, held.numbers.constants, pull, 0, held.n)
    found = []
    for side in (-h, h):
        held.xw[: len(x), :3] = x + side * d
        found.append(held.stored)
    assert (found[1] - found[0]) / (2.0 * h) == pytest.approx(-np.vdot(pull[: len(x), :3], d), rel=1e-6)
    held.xw[: len(x), :3] = x
    now = held.stored
    held.go(x, 0.0)
    assert held.numbers.constants.fold[:, HELD - FOLD].any() and held.stored > 0.9 * now


@pytest.mark.parametrize("omega", [0.3, 3.0, 12.0, 60.0])
def test_the_loss_tangent_of_strain_and_of_bending(omega: float) -> None:
    """Small oscillations in a hundred renewals a period: a period loses pi G'' gamma^2, and tan delta is G''/G'; of an
    hourglass mode likewise, with as much of the stiffness K."""
    steps, dt, tau = 100, 2.0 * np.pi / omega / 100, np.array(TWO)[:, 1]
    x, g = omega * tau, np.array(TWO)[:, 0]
    storage, loss = 0.25 + np.sum(g * x**2 / (1 + x**2)), np.sum(g * x / (1 + x**2))
    periods = 2 + int(np.ceil(8.0 * tau.max() * omega / (2.0 * np.pi)))
    for way in ("shear", "bend"):
        held = blocks_of()
        amplitude = np.zeros_like(held.rest)
        middle = held.rest - held.rest.mean(axis=0)
        amplitude[:, 0] = middle[:, 1] if way == "shear" else 40.0 * middle[:, 1] * middle[:, 2]
        amplitude *= 1e-4
        felt: list[float] = []
        lost = 0.0
        for n in range(periods * steps):
            if n == (periods - 1) * steps:
                felt, lost = [], held.dissipated
            held.go(held.rest + np.sin(omega * (n + 1) * dt) * amplitude, dt)
            _ = held.P
            pull = np.zeros((len(held.rest) + 8, 4))
            block_forces(held.ws, held.nodes, held.stress, held.numbers.constants, pull, 0, held.n)
            felt.append(-float(np.vdot(pull[: len(held.rest), :3], amplitude)))
        phase = omega * dt * (1 + np.arange(steps))
        along, across = 2.0 * np.mean(felt * np.sin(phase)), 2.0 * np.mean(felt * np.cos(phase))
        assert across / along == pytest.approx(loss / storage, rel=3e-3)
        assert held.dissipated - lost == pytest.approx(np.pi * across, rel=3e-3)
        if way == "shear":
            assert along == pytest.approx(MU * storage * 1e-8 * EDGE**3, rel=1e-3)


def test_what_is_held_loses_what_it_stored() -> None:
    """Stored and dissipated add up whatever the step, bent and strained alike."""
    for dt in (1e-3, 0.05, 3.0):
        held = blocks_of(cell=EDGE / 2)
        x = held.rest @ some(1, 1e-3).T + 1e-5 * np.random.default_rng(1).normal(size=held.rest.shape)
        held.go(x, 1e-9, 0.0)
        stored = held.stored
        held.go(x, 1e-9, dt)
        for n in range(50):
            held.go(x, dt, dt if n < 49 else 0.0)
        assert held.stored + held.dissipated == pytest.approx(stored, rel=1e-3)
        assert held.stored < 0.99 * stored


def scene(step: float = 0.01, regions: dict[str, Any] | None = None, **own: Any) -> Scene:
    """The cube squeezed by 10 % between plates that stick, and held for half a second."""
    body = {"shape": {"kind": "block", "size": [EDGE] * 3}, "cell": EDGE / 2, "material": material(**own)}
    motion = [{"tools": ["left", "right"], "close": 0.05, "until": {"compression": 0.1}}, {"hold": 0.5}]
    data: dict[str, Any] = {"softseam": 1, "name": "held", "gravity": [0, 0, 0], "step": step, "body": body}
    data |= {"tools": plates(0.8), "motion": motion, "quantities": ["grip_force"]}
    return Scene.model_validate(data | {"regions": regions or {"default": "pbd"}})


def taken(sim: softseam.Session) -> list[softseam.Observation]:
    sim.reset(seed=0)
    seen = []
    while not sim.done:
        seen.append(sim.step())
    return seen


def test_every_joule_is_found() -> None:
    """What the plates put in is stored or was dissipated by the material; next to nothing is the integrator's."""
    with softseam.open(scene(density=100.0)) as sim:
        seen = taken(sim)
    work, lost, faded = (
        sum(one.energies[name] for one in seen[1:]) for name in ("tool_work", "dissipation", "material")
    )
    stored = [one.energies["strain"] + one.energies["kinetic"] for one in seen]
    assert work == pytest.approx(stored[-1] - stored[0] + faded + lost, rel=1e-9)
    assert all(one.energies["material"] >= 0.0 for one in seen) and faded > 0.3 * work
    still = seen[3 + int(np.argmax([one.quantities["grip_force"] for one in seen])) :]
    assert abs(lost) < 0.02 * work
    assert abs(sum(one.energies["dissipation"] for one in still)) < 2e-3 * work
    assert not [event for one in seen for event in one.events if event.kind == "warning"]


ALL_FADES: Branches = ((0.45, 0.03), (0.075, 0.3), (0.155, 1.0), (0.013, 3.0), (0.072, 10.0), (0.235, 30.0))


@pytest.mark.parametrize("branches", [TWO, ALL_FADES, ((1.0, 1e-4),), ((0.6, 2e-3), (0.4, 50.0))])
def test_a_kicked_body_that_is_free_gains_nothing(branches: Branches) -> None:
    """Each node another way, so that it bends and rings, by a speed that strains it by a tenth: whatever lasts of it,
    nothing at all too, and with branches that fade within a substep."""
    run = PbdRun(block_scene(cell=EDGE / 4, step=0.005, body={"material": material(branches, density=1000.0)}))
    kick = 0.3 * np.random.default_rng(0).normal(size=run.body.x_rest.shape)
    run = PbdRun(run.scene, v=kick - kick.mean(axis=0))
    energies = [run.solver.moving[0] + run.solver.strain]
    for _ in range(100):
        reply = run.step()
        energies.append(reply.kinetic + reply.strain)
        assert reply.status == "converged" and reply.extras["dissipated"] >= 0.0
        assert energies[-1] <= energies[-2] * (1.0 + 1e-9)
    assert energies[-1] < 0.2 * energies[0]


def test_a_body_that_spins_relaxes_nothing() -> None:
    """Three turns a second, from rest on: what is lost is of the stretch that the spin brings, and no turn costs."""
    own = {"material": material(), "spin": (0.0, 0.0, 20.0)}
    run = PbdRun(block_scene(cell=EDGE / 2, step=0.005, body=own))
    replies = run.run(1.0)
    energy = replies[0].kinetic
    assert replies[-1].kinetic == pytest.approx(energy, rel=2e-3)
    stretch = 20.0**2 * EDGE**2 * 10.0 / (2.0 * 9e3)  # of the order rho (omega a)^2 over the modulus
    assert sum(reply.extras["dissipated"] for reply in replies) < stretch * energy


@pytest.mark.parametrize("cells", [1, 2])
def test_a_bar_that_bends_by_its_weight_creeps_as_fem_s(cells: int) -> None:
    """4 x 1 x 1 cells within 5 % in 4 s, 8 x 2 x 2 within 2 %, as of a body at rest: bending relaxes with strain."""
    own = {"material": material(density=1000.0, young=6e4, poisson=0.45)}
    held = ({"min": (-1, -1, -1), "max": (-0.04 + 1e-6, 1, 1)},)
    gravity = (0.0, 0.0, -9.81)
    scene = block_scene((0.08, 0.02, 0.02), 0.02 / cells, step=0.02, gravity=gravity, fixed=held, body=own)
    fem, pbd = FemRun(scene), PbdRun(scene)
    begun, sunk = pbd.solver.committed.x[:, 2].copy(), []
    fem.run(4.0)
    pbd.run(4.0)
    sunk = [float((begun - x[:, 2]).max()) for x in (fem.x, pbd.solver.committed.x)]
    assert sunk[1] == pytest.approx(sunk[0], rel=0.05 if cells == 1 else 0.02)
    assert sunk[0] > 0.05


@pytest.mark.parametrize(
    ("own", "pbd", "words"),
    [
        ({}, {"method": "leapfrog"}, r"leapfrog does not know body\.material\.relaxation: use xpbd"),
        ({}, {"damping": {"stiffness": 1e-3}}, r"do not know body\.material\.relaxation: leave them out"),
        ({"kind": "corotated"}, {}, r"beside neo_hookean, this is corotated: use that, or set regions\.default: fem"),
    ],
)
def test_what_blocks_that_relax_cannot_do_is_refused(own: dict[str, Any], pbd: dict[str, Any], words: str) -> None:
    body = {"shape": {"kind": "block", "size": [EDGE] * 3}, "cell": EDGE / 2, "material": material(**own)}
    data = {"softseam": 1, "name": "odd", "duration": 1.0, "body": body, "regions": {"default": "pbd"}}
    with pytest.raises(softseam.SceneRefused, match=words):
        softseam.open(Scene.model_validate(data | {"models": {"pbd": pbd}}))
