"""A new seam starts with the force that the cut laid bare."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

pytestmark = pytest.mark.kernels

SIZE, DENSITY = (0.08, 0.02, 0.02), 1000.0


def hanging(near: str, far: str) -> Simulation:
    """A bar clamped at its left end, at rest under its weight, all of it far."""
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "bar",
            "step": 0.02,
            "duration": 10.0,
            "body": {
                "shape": {"kind": "block", "size": SIZE},
                "cell": 0.02,
                "material": {"young": 1e6, "poisson": 0.4, "density": DENSITY},
                "fixed": [{"min": [-0.04, -1.0, -1.0], "max": [-0.04, 1.0, 1.0]}],
            },
            "regions": {"default": far, "near": {"model": near, "boxes": [{"min": [9, 9, 9], "max": [9, 9, 9]}]}},
        }
    )
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    for _ in range(150):
        simulation.step()
    return simulation


@pytest.mark.parametrize("near, far", [("fem", "fem"), ("pbd", "pbd"), ("fem", "pbd"), ("pbd", "fem")])
def test_a_cut_lays_bare_what_the_seam_settles_to(near: str, far: str) -> None:
    """Stress in the middle of octants leaves out what bends an octant, and a PBD bar still swings a little."""
    simulation = hanging(near, far)
    assert isinstance(simulation.body, Body)
    simulation.set_near(simulation.body.cell_grid[:, 0] < 2)
    first = simulation.frame().multiplier
    for _ in range(100):
        simulation.step()
    # What is left of the swing after a cut is as large as the bound on the sum: its mean over 50 steps is not.
    sums = []
    for _ in range(50):
        simulation.step()
        frame = simulation.frame()
        sums.append(frame.multiplier.sum(axis=0))
    simulation.close()
    weight = 9.81 * DENSITY * 0.5 * float(np.prod(SIZE))
    arm = frame.x[frame.coupling_nodes] - [0.0, 0.0, 0.01]
    np.testing.assert_allclose(np.mean(sums, axis=0), [0.0, 0.0, -weight], atol=2e-3 * weight)
    assert np.cross(arm, frame.multiplier).sum(axis=0)[1] == pytest.approx(0.02 * weight, rel=5e-3)
    assert np.linalg.norm(first - frame.multiplier) < 0.5 * np.linalg.norm(frame.multiplier)
    assert np.cross(arm, first).sum(axis=0)[1] == pytest.approx(0.02 * weight, rel=0.2)
    if far == "fem":  # at rest
        np.testing.assert_allclose(first.sum(axis=0), [0.0, 0.0, -weight], atol=0.06 * weight)
