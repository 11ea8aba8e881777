"""Coulomb's friction in both models: a slope, a grip, the cone, and what the tools' wrenches add up to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

Floats = NDArray[np.float64]

MODELS = pytest.mark.parametrize("model", ["fem", "pbd"])
G, STEP, DENSITY = 9.81, 0.005, 1000.0
NEAR = {"default": "pbd", "near": {"model": "fem", "within": 0.008, "tools": ["left", "right"]}}


def simulate(
    size: Sequence[float],
    young: float,
    tools: dict[str, Any],
    motion: Sequence[Any],
    regions: Any,
    gravity: Sequence[float] = (0.0, 0.0, -G),
    tolerance: float = 1e-9,
) -> tuple[list[StepReport], Simulation]:
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "friction",
            "step": STEP,
            "gravity": gravity,
            "body": {
                "shape": {"kind": "block", "size": size},
                "cell": 0.02,
                "material": {"young": young, "poisson": 0.3, "density": DENSITY},
            },
            "tools": tools,
            "motion": motion,
            "regions": regions,
            # forces balance as well as Newton's method is finished, and the cube weighs 0.6 N only
            "models": {"fem": {"tolerance": tolerance}},
        }
    )
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    reports = [simulation.step()]
    while not reports[-1].done:
        reports.append(simulation.step())
    return reports, simulation


# ---- the slope ------------------------------------------------------------------------------------------------

SLAB = (0.06, 0.04, 0.02)
MU = 0.5


def speeds(model: str, slope: float, young: float = 2e4, tolerance: float = 1e-9) -> Floats:
    """Speed down the slope [m/s] at the end of every step: a slab comes to rest on the ground, which is tilted then."""
    ground = {"ground": {"kind": "plane", "friction": MU}}
    motion = [{"hold": 0.3}, {"tools": ["ground"], "turn": [0, slope, 0], "speed": 0.5}, {"hold": 0.6}]
    reports, _ = simulate(SLAB, young, ground, motion, {"default": model}, tolerance=tolerance)
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    return np.array([r.momentum @ down for r in reports]) / (DENSITY * float(np.prod(SLAB)))


def test_a_slab_sticks_below_the_friction_angle_and_slides_above() -> None:
    """FEM, half a degree from atan(mu) = 26.57: below it rests, above it gets faster by g (sin - mu cos) = 0.096."""
    for degrees in (-0.5, 0.5):
        slope = np.arctan(MU) + np.radians(degrees)
        v = speeds("fem", slope)
        pull = G * (np.sin(slope) - MU * np.cos(slope))
        if degrees < 0.0:
            assert np.abs(v[-20:]).max() < 1e-5
        else:
            assert (v[-1] - v[-61]) / (60 * STEP) == pytest.approx(pull, rel=1e-3)


def test_a_light_stiff_slab_slides_as_well() -> None:
    """With the default tolerance of Newton's method, at 1 MPa and half a newton."""
    slope = np.arctan(MU) + np.radians(0.5)
    v = speeds("fem", slope, young=1e6, tolerance=3e-5)
    pull = G * (np.sin(slope) - MU * np.cos(slope))
    assert (v[-1] - v[-61]) / (60 * STEP) == pytest.approx(pull, rel=0.02)


@pytest.mark.parametrize(("young", "degrees"), [(2e4, 0.5), (2e5, 1.0)])
def test_a_slab_of_pbd_sticks_below_the_friction_angle_and_slides_above(young: float, degrees: float) -> None:
    """Half a degree apart, and one where the slab is ten times as stiff: what trembles slides more easily."""
    angle = np.arctan(MU)
    assert np.abs(speeds("pbd", angle - np.radians(degrees), young)[-20:]).max() < 1e-4
    slope = angle + np.radians(0.5)
    v = speeds("pbd", slope, young)
    pull = G * (np.sin(slope) - MU * np.cos(slope))
    assert (v[-1] - v[-61]) / (60 * STEP) == pytest.approx(pull, rel=0.1)


@pytest.mark.parametrize(("model", "within"), [("fem", 1e-5), ("pbd", 0.002)])
def test_a_slab_slides_with_the_acceleration_of_the_slope(model: str, within: float) -> None:
    """35 degrees: g (sin - mu cos)."""
    slope = np.radians(35.0)
    v = speeds(model, slope)
    pull = G * (np.sin(slope) - MU * np.cos(slope))
    assert (v[-1] - v[-61]) / (60 * STEP) == pytest.approx(pull, rel=within)


# ---- the grip -------------------------------------------------------------------------------------------------

CUBE = (0.04, 0.04, 0.04)
WEIGHT = DENSITY * 0.04**3 * G
GRIP_MU = 0.4


def gripped(force: float, regions: Any, hold: float = 0.1) -> tuple[list[StepReport], Simulation]:
    """A cube between two plates that hold a force; then the ground is taken away, 20 cm in 0.2 s."""
    plate = {"kind": "box", "size": [0.01, 0.06, 0.06], "friction": GRIP_MU}
    tools = {
        "ground": {"kind": "plane"},
        "left": {**plate, "position": [-0.0252, 0, 0.02]},
        "right": {**plate, "position": [0.0252, 0, 0.02]},
    }
    motion = [
        {"tools": ["left", "right"], "close": 0.01, "force": force, "until": {"time": 0.4}},
        {"tools": ["ground"], "move": [0, 0, -0.2], "speed": 1.0},
        {"hold": hold},
    ]
    return simulate(CUBE, 2e4, tools, motion, regions)


@MODELS
def test_a_grip_carries_exactly_what_friction_allows(model: str) -> None:
    """2 mu N = m g to 3 %: with 3 % more force the cube hangs, with 3 % less it slides down for good."""
    least = WEIGHT / (2.0 * GRIP_MU)
    held, _ = gripped(1.03 * least, {"default": model})
    lost, _ = gripped(0.97 * least, {"default": model})
    mass = WEIGHT / G
    assert abs(held[-1].momentum[2]) / mass < 5e-3
    assert lost[-1].momentum[2] / mass < -0.05


@MODELS
def test_no_force_leaves_the_friction_cone(model: str) -> None:
    """At every point that touches a plate, of a cube that hangs and of one that slides: |t| <= mu p to 1e-6 of p.

    XPBD lends friction for milliseconds: by a hundredth of p at most in the mean of a step.
    """
    for share in (1.2, 0.9):
        _, simulation = gripped(share * WEIGHT / (2.0 * GRIP_MU), {"default": model}, hold=0.0)
        frame = simulation.frame()
        touching = frame.contact_tool >= 1
        force = frame.contact_force[touching]
        pressure = np.abs(force[:, 0])
        friction = np.hypot(force[:, 1], force[:, 2])
        assert touching.sum() >= 8 and pressure.max() > 0.01
        assert (friction - GRIP_MU * pressure).max() < (1e-6 if model == "fem" else 1e-2) * pressure.max()
        inward = np.where(frame.contact_tool[touching] == 1, 1.0, -1.0)
        assert (force[:, 0] * inward).min() >= 0.0


@pytest.mark.parametrize("regions", [{"default": "fem"}, {"default": "pbd"}, NEAR], ids=["fem", "pbd", "hybrid"])
def test_wrenches_balance_weight_and_inertia(regions: Any) -> None:
    """In every step, of the squeeze and of the fall: sum of forces on the tools = m g - change of momentum/dt."""
    reports, _ = gripped(2.5, regions, hold=0.0)
    before = np.zeros(3)
    worst = 0.0
    for report in reports:
        told = report.wrench[:, :3].sum(axis=0)
        expected = np.array([0.0, 0.0, -WEIGHT]) - (report.momentum - before) / STEP
        worst = max(worst, float(np.abs(told - expected).max()))
        before = report.momentum
    assert worst < 1e-6 * WEIGHT


def test_torques_balance_the_weight_at_rest() -> None:
    """A cube that hangs still between plates that grip it off its middle: moments about the origin sum to zero."""
    plate = {"kind": "box", "size": [0.01, 0.06, 0.06], "friction": 0.9}
    tools = {
        "ground": {"kind": "plane"},
        "left": {**plate, "position": [-0.0252, 0.02, 0.025]},
        "right": {**plate, "position": [0.0252, 0.02, 0.025]},
    }
    motion = [
        {"tools": ["left", "right"], "close": 0.01, "until": {"compression": 0.1}},
        {"tools": ["ground"], "move": [0, 0, -0.02], "speed": 0.2},
        {"hold": 1.5},
    ]
    reports, simulation = simulate(CUBE, 2e4, tools, motion, {"default": "fem"})
    last = reports[-1]
    body = simulation.body
    assert isinstance(body, Body)
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    centre = mass @ simulation.frame().x / mass.sum()
    moment = last.wrench[:, 3:].sum(axis=0) + np.cross(last.tool_position, last.wrench[:, :3]).sum(axis=0)
    weight = np.cross(centre, [0.0, 0.0, -WEIGHT])
    assert np.abs(moment - weight).max() < 1e-6 * WEIGHT * CUBE[0]
