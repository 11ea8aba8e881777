"""Bodies that fill their cells partly, as hybrid: as FEM alone says, and without tearing at the seam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from softseam.variants import Model, with_model
from softseam_protocol.messages import StepReport
from softseam_protocol.scene_file import bundle_scene, load_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def run(name: str, model: Model) -> tuple[list[StepReport], float]:
    """All reports, and the least cell edge [m]."""
    loaded = load_scene(SCENES / f"{name}.yaml")
    simulation = Simulation(bundle_scene(with_model(loaded.scene, model), loaded.bundle.files), EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
    edge = float(simulation.body.edges.min())
    simulation.close()
    return reports, edge


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["sausage", "dumpling"])
def test_hybrid_lifts_as_fem_does(scene: str) -> None:
    """Force at the end within 5 % of FEM alone, lifted, slip below 2 mm, gap below 1e-3 of a cell."""
    hybrid, edge = run(scene, "hybrid")
    fem, _ = run(scene, "fem")
    force = hybrid[-1].quantities["grip_force"]
    assert force == pytest.approx(fem[-1].quantities["grip_force"], rel=0.05)
    assert hybrid[-1].quantities["lift_height"] > 0.045
    assert max(report.quantities["slip"] for report in hybrid) < 2e-3
    assert max(report.seam.gap for report in hybrid) < 1e-3 * edge
    assert np.mean([report.seam.exchanges for report in hybrid]) <= 4.0
    assert any(len(report.regions) == 2 for report in hybrid)
