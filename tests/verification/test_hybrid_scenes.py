"""The headline scenes as hybrid against FEM alone, on the same cells and with the same step."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam.variants import Model, with_model, with_settings
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def simulate(scene: Scene) -> tuple[list[StepReport], float]:
    """All reports, and the least cell edge [m]."""
    simulation = Simulation(bundle_scene(scene, {}), EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
    edge = simulation.body.resolution
    simulation.close()
    return reports, edge


@cache
def run(name: str, model: Model) -> tuple[list[StepReport], float]:
    return simulate(with_model(load_scene(SCENES / f"{name}.yaml").scene, model))


def series(reports: list[StepReport], quantity: str) -> NDArray[np.float64]:
    return np.array([report.quantities[quantity] for report in reports if quantity in report.quantities])


def difference(one: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """L2 norm over time of the difference, relative to the reference."""
    return float(np.linalg.norm(one - reference) / np.linalg.norm(reference))


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene, quantities",
    [
        ("tofu_grasp", ("grip_force", "lift_height")),
        ("tofu_pads", ("grip_force", "lift_height")),
        ("tofu_slab", ("grip_force", "lift_height")),
        ("cantilever", ("tip_deflection",)),
    ],
)
def test_hybrid_agrees_with_fem(scene: str, quantities: tuple[str, ...]) -> None:
    """Forces and trajectories within 3 %, gap at commit below 1e-3 of a cell, at most 4 exchanges a step."""
    hybrid, edge = run(scene, "hybrid")
    fem, _ = run(scene, "fem")
    for quantity in quantities:
        assert difference(series(hybrid, quantity), series(fem, quantity)) < 0.03, quantity
    assert max(report.seam.gap for report in hybrid) < 1e-3 * edge
    assert np.mean([report.seam.exchanges for report in hybrid]) <= 4.0


def test_where_one_model_is_enough_the_scene_is_that_model() -> None:
    """tofu_grasp as it is and by FEM alone: the same numbers from the same requests, in every step."""
    scene = load_scene(SCENES / "tofu_grasp.yaml").scene
    as_is, _ = simulate(scene)
    fem, _ = run("tofu_grasp", "fem")
    assert len(as_is) == len(fem)
    for one, other in zip(as_is, fem, strict=True):
        (mine,), (alone,) = one.parts.values(), other.parts.values()
        assert replace(mine, seconds=0.0) == replace(alone, seconds=0.0)
        assert (one.quantities, one.energy, one.seam) == (other.quantities, other.energy, other.seam)
        assert np.array_equal(one.wrench, other.wrench)


@pytest.mark.slow
def test_a_scene_that_one_model_is_enough_for_costs_what_that_model_does() -> None:
    """tofu_grasp as it is against FEM alone, step by step in turns: processor time, the least of 20 runs, to 8 %.

    Of six runs the ratio was found from .86 to 1.13 on a machine whose speed changes, of 21 from 1.02 to 1.03 beside
    another job, and up to 1.09 beside several: of 600 us a step, to watch where the tools are takes 16.
    """
    scene = load_scene(SCENES / "tofu_grasp.yaml").scene
    both = [Simulation(bundle_scene(each, {}), EmbeddedTransport()) for each in (scene, with_model(scene, "fem"))]
    spent: list[list[list[float]]] = [[], []]
    for _ in range(21):
        for simulation, runs in zip(both, spent, strict=True):
            simulation.reset()
            runs.append([])
        while not both[0].done:
            for simulation, runs in zip(both, spent, strict=True):
                began = process_time()
                simulation.step()
                runs[-1].append(process_time() - began)
    as_is, alone = (np.min(runs[1:], axis=0).sum() for runs in spent)
    for simulation in both:
        simulation.close()
    assert as_is <= 1.08 * alone


def test_tofu_is_lifted() -> None:
    """Hold force within 5 % of 13.1 N and 10.15 N after the lift (three codes agree to 0.1 N), slip below 2 mm."""
    reports, _ = run("tofu_grasp", "hybrid")
    force = {report.phase: report.quantities["grip_force"] for report in reports}
    assert force[2] == pytest.approx(13.1, rel=0.05)
    assert force[4] == pytest.approx(10.15, rel=0.05)
    tools = reports[-1].tool_position[1, 2] - reports[0].tool_position[1, 2]
    assert tools == pytest.approx(0.05, abs=1e-9)
    assert (
        reports[-1].quantities["lift_height"] > 0.047
    )  # the centre of mass; the cube hangs 1.6 mm lower than it stood
    assert max(report.quantities["slip"] for report in reports) < 2e-3
    assert max(report.penetration for report in reports) < 1e-4
    assert np.isfinite(series(reports, "grip_force")).all()


def test_slippery_tofu_is_dropped() -> None:
    """With friction 0.05 at the plates 2 mu N = 1.3 N cannot carry 1.29 N and what the lift asks for besides."""
    scene = load_scene(SCENES / "tofu_grasp.yaml").scene
    slippery = with_settings(scene, ["tools.left.friction=0.05", "tools.right.friction=0.05"])
    reports, _ = simulate(slippery)
    assert reports[-1].quantities["lift_height"] < 0.02
    assert all(np.isfinite(report.wrench).all() for report in reports)
