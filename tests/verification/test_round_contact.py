"""Contact of two round bodies of FEM, whose surfaces run through cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import solids

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

RADIUS, CELL = 0.02, 0.01
_VERTICES, _TRIANGLES = solids.sphere(RADIUS, 4)
BALL = solids.obj(_VERTICES + np.array([0.0, 0.0, RADIUS]), _TRIANGLES)

MODELS = pytest.mark.parametrize("models", [("fem", "fem")], ids="-".join)


def ball(model: str, height: float, **keys: Any) -> dict[str, Any]:
    material = {"young": 2e4, "poisson": 0.3, "density": 1000.0, "retardation_time": 0.02}
    about = {"shape": {"kind": "mesh", "path": "ball.obj"}, "cell": CELL, "material": material}
    return about | {"position": [0.0, 0.0, height], "regions": {"default": model}} | keys


def run(bodies: dict[str, Any], **keys: Any) -> list[StepReport]:
    """Of a scene without weight, step by step."""
    data = {"softseam": 1, "name": "round", "gravity": [0.0, 0.0, 0.0], "step": 0.01, "bodies": bodies} | keys
    if len(bodies) > 1:
        data["interfaces"] = {"touch": {"kind": "contact", "between": ["upper", "lower"], "friction": 0.5}}
    simulation = Simulation(
        Bundle(Scene.model_validate(data).model_dump_json(), {"ball.obj": BALL}), EmbeddedTransport()
    )
    reports = [simulation.step()]
    while not reports[-1].done:
        reports.append(simulation.step())
    return reports


def pressed(models: tuple[str, ...], by: float) -> float:
    """Force of a plane on a column of balls that it presses by so much each [N]."""
    tall, n = 2.0 * RADIUS * len(models), len(models)
    names = ("lower", "upper")[:n]
    bodies = {name: ball(models[k], 2.0 * RADIUS * k) for k, name in enumerate(names)}
    press = {"kind": "plane", "point": [0.0, 0.0, tall], "normal": [0.0, 0.0, -1.0], "friction": 0.5}
    motion = [{"tools": ["press"], "move": [0.0, 0.0, -n * by], "speed": 0.02 * n}, {"hold": 0.2}]
    tools = {"ground": {"kind": "plane", "friction": 0.5}, "press": press}
    return float(run(bodies, tools=tools, motion=motion)[-1].wrench[1, 2])


@MODELS
@pytest.mark.parametrize("by", [0.002, 0.004])
def test_a_ball_presses_another_as_it_presses_a_plane_by_half_as_much(models: tuple[str, str], by: float) -> None:
    """The same cells; by 5 and 10 % of its width: a contact smaller than a cell, and one that is larger."""
    assert pressed(models, by) == pytest.approx(pressed(models[:1], by), rel=0.01)


@MODELS
def test_two_balls_that_meet_askew_keep_their_momenta_and_make_no_energy(models: tuple[str, str]) -> None:
    lower = ball(models[0], 0.0, velocity=[0.0, 0.0, 0.3])
    upper = ball(models[1], 0.0, velocity=[0.0, 0.0, -0.3], position=[0.008, 0.003, 2.0 * RADIUS + 0.001])
    reports = run({"lower": lower, "upper": upper}, duration=0.08, step=0.005)
    brought = 0.3 * 1000.0 * 4.0 / 3.0 * np.pi * RADIUS**3
    momentum, spin = (np.array([getattr(each, key) for each in reports]) for key in ("momentum", "angular_momentum"))
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * brought
    assert np.abs(spin - spin[0]).max() < 1e-8 * brought * 2.0 * RADIUS
    energy = np.array([sum(each.energy[key] for key in ("kinetic", "strain")) for each in reports])
    assert energy.max() <= energy[0] * (1.0 + 1e-9)
    assert np.cumsum([each.interfaces["touch"].work for each in reports]).max() <= 1e-9 * energy[0]
    assert energy[-1] < 0.5 * energy[0]  # they met, and parted
