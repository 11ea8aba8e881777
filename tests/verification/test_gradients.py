"""Gradients of runs of FEM against central differences of whole runs, and backward against forward.

Differences over a share h of a number are off by what the runs' Newton's method leaves, over h, and by h^2: 1e-6 of the
derivative here. Young's modulus is changed with the whole scene, a tool's way in one step alone.
"""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from gradient_cases import (
    SMALL_PADS,
    Commands,
    difference,
    difference_by_way,
    grasp,
    run_of,
    scene,
    squeeze,
)

import softseam
from softseam.embedded import simulate
from softseam.losses import displacement, tool_force, total
from softseam.scenes import bundle_of
from softseam_services.fem.differential import no_differential
from softseam_services.fem.solver import FemSolver
from softseam_services.orchestrator.rollout import roll_out
from softseam_services.orchestrator.simulation import Simulation

LOSS = total(
    tool_force("left", [1.0, 0.3, 0.7]),
    tool_force("ground", [0.2, 0.1, 1.0]),
    displacement([10.0, -20.0, 30.0], at=(0.01, 0.02, 0.05)),
)
YOUNG = "body.material.young"
ALL = "tools.ground.friction,tools.left.friction,tools.right.friction"
CLAMP = {"fixed": [{"min": [-0.026, -0.03, -0.01], "max": [-0.024, 0.03, 0.06]}]}
ROUND: dict[str, Any] = {
    "ground": {"kind": "plane", "friction": 0.5},
    "left": {"kind": "sphere", "radius": 0.012, "position": [0.004, 0.003, 0.0628], "friction": 0.4},
    "right": {
        "kind": "capsule",
        "radius": 0.006,
        "length": 0.02,
        "axis": [0, 1, 0],
        "position": [0.0317, 0, 0.03],
        "friction": 0.3,
    },
}
FLAT: dict[str, Any] = {
    **ROUND,
    "left": {"kind": "cylinder", "radius": 0.012, "length": 0.02, "position": [0.004, 0.003, 0.0605], "friction": 0.4},
}
"""the end of the cylinder presses patches in part"""
ROUGH = {"at edges": 1e-4, "flat": 5e-3}
"""tolerances where parts of patches begin to touch between the two ends of a difference"""
PRESS: Commands = [{"left": [0.005, 0.0, -0.02], "right": [-0.015, 0.005, 0.0]}] * 30


@pytest.mark.parametrize(
    ("case", "commands", "key", "value", "tolerance"),
    [
        ("clamped", [{}] * 20, YOUNG, 20e3, 1e-7),
        ("sticking", squeeze(36, 0.03, 25), YOUNG, 20e3, 1e-6),
        ("sliding", squeeze(36, 0.05, 25), YOUNG, 20e3, 1e-6),
        ("uneven", squeeze(36, 0.05, 25), YOUNG, 20e3, 1e-6),
        ("at edges", squeeze(30, 0.03, 22), YOUNG, 20e3, 1e-5),
        ("round", PRESS, YOUNG, 20e3, 1e-5),
        ("flat", PRESS[:16], YOUNG, 20e3, 1e-3),
        ("corotated", squeeze(20), YOUNG, 20e3, 3e-6),
        ("sticking", squeeze(36, 0.03, 25), ALL, 0.8, 1e-3),
        ("sliding", squeeze(36, 0.05, 25), ALL, 0.05, 1e-3),
        ("uneven", squeeze(36, 0.05, 25), ALL, 0.05, 1e-3),
        ("at edges", squeeze(30, 0.03, 22), ALL, 0.5, 1e-3),
        ("round", PRESS, "tools.left.friction", 0.4, 1e-3),
    ],
)
def test_a_gradient_is_the_central_difference(
    case: str, commands: Commands, key: str, value: float, tolerance: float
) -> None:
    name = "young" if key == YOUNG else ("friction" if key == ALL else "friction.left")
    loss = displacement([0.0, 0.0, 1.0], at=(0.025, 0.0, 0.05)) if case == "clamped" else LOSS
    with softseam.open(_scene(case)) as sim:
        gradient = sim.gradient(loss, [name], commands=commands)
        assert gradient.value == loss(run_of(sim, commands))[0]  # the run is the session's own
        expected = difference(sim, loss, commands, key, value, 3e-4 if case == "round" else 1e-5)
    assert gradient.crossed == ()
    assert gradient[name] == pytest.approx(expected, rel=tolerance)


def _scene(case: str) -> softseam.Scene:
    if case == "clamped":
        return scene({}, body=CLAMP)
    if case in ("round", "flat"):
        return scene(ROUND if case == "round" else FLAT)
    if case == "turning":
        return scene({"ground": {"kind": "plane", "friction": 0.4}}, body=SPINS)
    if case == "at edges":
        return grasp(0.5, SMALL_PADS)
    if case == "corotated":
        return grasp(0.3, kind="corotated")
    if case == "uneven":
        return grasp(0.05, body={"friction_field": {"spread": 0.4, "length": 0.02, "seed": 1}})
    return grasp(0.8 if case == "sticking" else 0.05)


@pytest.mark.parametrize(
    ("case", "commands", "tool", "step", "axis"),
    [
        ("sticking", squeeze(36, 0.03, 25), "left", 5, 0),
        ("sliding", squeeze(36, 0.05, 25), "left", 8, 0),
        ("at edges", squeeze(30, 0.03, 22), "left", 5, 0),
        ("round", PRESS, "left", 5, 2),
        ("flat", PRESS[:16], "left", 5, 0),
    ],
)
def test_a_gradient_by_the_way_of_a_tool_is_the_central_difference(
    case: str, commands: Commands, tool: str, step: int, axis: int
) -> None:
    """The way in one step moves the tool in all later ones; 1e-8 m either way leaves 5e-6 of rounding and Newton, and
    under what is round, where a step is no linear problem, more."""
    with softseam.open(_scene(case)) as sim:
        gradient = sim.gradient(LOSS, [f"way.{tool}"], commands=commands)
        expected = difference_by_way(sim, LOSS, commands, tool, step, axis, 1e-7 if case == "round" else 1e-8)
    found = gradient[f"way.{tool}"]
    assert isinstance(found, np.ndarray) and found.shape == (len(commands), 3)
    assert found[step, axis] == pytest.approx(expected, rel=ROUGH.get(case, 1e-5))


FALLING: dict[str, Any] = {"position": [0.0, 0.0, 5e-4], "velocity": [0.05, 0.0, 0.0]}
SPINS = {**FALLING, "position": [0.0, 0.0, 5e-3], "spin": [3.0, -5.0, 8.0]}


@pytest.mark.parametrize("falling", [FALLING, SPINS])
def test_gradients_by_the_start_are_central_differences(falling: dict[str, Any]) -> None:
    """A cube that falls onto the ground, sideways, and one that spins as well."""
    cube = scene({"ground": {"kind": "plane", "friction": 0.4}}, body=falling, tolerance=1e-12)
    commands: Commands = [{}] * 20
    loss = total(tool_force("ground", [1.0, 0.0, 1.0]), displacement([5.0, 0.0, 10.0]))
    with softseam.open(cube) as sim:
        gradient = sim.gradient(loss, ["velocity", "position", "young"], commands=commands)
        young = difference(sim, loss, commands, YOUNG, 20e3, 1e-5)
        assert gradient["young"] == pytest.approx(young, rel=1e-5)
        for name, axis, apart in (("velocity", 0, 1e-5), ("velocity", 2, 1e-5), ("position", 2, 1e-7)):
            found = []
            for side in (1.0, -1.0):
                start = list(falling[name])
                start[axis] += side * apart
                found.append(loss(run_of(sim, commands, [f"body.{name}={start}"]))[0])
            derivative = gradient[name]
            assert isinstance(derivative, np.ndarray)
            assert derivative[axis] == pytest.approx((found[0] - found[1]) / (2.0 * apart), rel=1e-4)


def _rolled_out(simulation: Simulation, commands: Commands) -> tuple[Any, FemSolver, Any]:
    rollout = roll_out(simulation, commands, None)
    solver = simulation.solver
    assert isinstance(solver, FemSolver)
    return rollout, solver, simulation.tools


@pytest.mark.parametrize("case", ["sticking", "sliding", "uneven", "at edges", "round", "turning"])
def test_backward_is_the_transpose_of_forward(case: str) -> None:
    """<a, D b> = <D^T a, b> of each step, for random a and b: to what GMRES leaves, in steps solved again, too."""
    chosen: dict[str, Commands] = {"round": PRESS, "turning": [{}] * 20}
    commands = chosen.get(case, squeeze(30, 0.03, 22))
    random, augmented = np.random.default_rng(3), 0
    fields = ("x", "v", "force", "anchor", "tool_start", "tool_end", "friction", "young")
    simulation = simulate(bundle_of(_scene(case))[1], lambda message: None)
    with closing(simulation):
        rollout, solver, tools = _rolled_out(simulation, commands)
        derivative = rollout.tape.derivatives(1e-12)
        model, tape = solver.tables.whole.model, rollout.tape
        for step in range(0, rollout.n_steps, 2):
            change, owed = no_differential(model, len(tools.names)), no_differential(model, len(tools.names))
            touched = (tape.states[step].contact[:, :, :3] != 0.0).any(axis=2, keepdims=True)
            scales = {"force": touched, "anchor": 1e-3 * touched, "x": 1e-3, "tool_start": 1e-3, "tool_end": 1e-3}
            start = {}
            for name in fields:
                array = getattr(change, name)
                array[:] = random.standard_normal(array.shape) * scales.get(name, 1.0)
                start[name] = array.copy()
            derivative.look(step, 0.0)
            derivative.push(change)
            ends = {name: random.standard_normal(getattr(owed, name).shape) for name in ("x", "v", "force", "anchor")}
            ends["tool_force"] = random.standard_normal(owed.tool_force.shape)
            forward = sum(float(np.sum(ends[name] * getattr(change, name))) for name in ends)
            for name, array in ends.items():
                getattr(owed, name)[:] = array
            derivative.look(step, 0.0)
            derivative.pull(owed)
            backward = sum(float(np.sum(start[name] * getattr(owed, name))) for name in fields)
            size = sum(abs(float(np.sum(start[name] * getattr(owed, name)))) for name in fields)
            assert abs(forward - backward) < 1e-8 * size
            augmented += len(tape.augmented[step])
    assert augmented > 0 or case != "sticking"


def test_contacts_near_a_change_are_told() -> None:
    """With friction a hair above or below what a step asks for, a point is about to slip, and the run says so."""
    commands = squeeze(36, 0.03, 25)
    with softseam.open(grasp(0.8)) as sim:
        wide = sim.gradient(LOSS, ["young"], commands=commands, near=0.05)
        assert wide.crossed and all(one.margin < 0.05 for one in wide.crossed)
        assert {one.tool for one in wide.crossed} <= {"left", "right", "ground"}
        least = min(wide.crossed, key=lambda one: one.margin)
        narrow = sim.gradient(LOSS, ["young"], commands=commands, near=0.5 * least.margin)
    assert narrow.crossed == ()


def test_the_session_stands_at_the_end_of_the_run() -> None:
    commands = squeeze(6)
    with softseam.open(grasp(0.4)) as sim:
        gradient = sim.gradient(LOSS, ["young", "velocity"], commands=commands)
        assert sim.last.step == 6 and sim.last.time == pytest.approx(0.03)
        np.testing.assert_array_equal(sim.last.positions, gradient.run.positions[-1])
        sim.step({"left": [0.01, 0.0, 0.0]})
        assert sim.last.step == 7
