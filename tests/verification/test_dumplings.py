"""The shipped bowl of dumplings: they come to rest in it, the bowl bears them all, and none is deep in another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from softseam_protocol.scene.file import load_scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

SCENE = Path(__file__).parents[2] / "scenes" / "dumplings.yaml"
FALLS = 80
"""steps in which they meet one another"""


@pytest.mark.slow
def test_twelve_dumplings_rest_in_their_bowl() -> None:
    """Surfaces give way by 1/r, .9 mm of 33 under what eleven others weigh, 4.9 mm in knocks of the fall."""
    simulation = Simulation(load_scene(SCENE).bundle, EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
    frames = simulation.frames()
    names = simulation.tools.names
    simulation.close()
    inside = np.array(
        [max([report.penetration, *(each.gap for each in report.interfaces.values())]) for report in reports]
    )
    assert inside.max() < 6e-3
    assert inside[FALLS:].max() < 1.5e-3
    bodies = [each.body for each in simulation.bodies.values()]
    weight = 9.81 * sum(float(body.cell_mass.sum()) for body in bodies if isinstance(body, Body))
    last = reports[-1]
    assert len(frames) == 12
    assert -last.wrench[names.index("bowl"), 2] == pytest.approx(weight, rel=0.02)
    assert not last.wrench[names.index("table")].any()
    assert last.energy["kinetic"] < 5e-5  # 15 mm/s in the mean
