"""What a wave along a bar loses at a border between cells of eight blocks, or of FEM, and cells of one block.

A bar of 200 cells in a row, nu = 0, so that one dimension is all; a pulse with so many coarse nodes a wavelength comes
from the left, and what is left of it there after it has passed the middle was reflected. Of the half with smaller
cells, where masses alternate, a smooth pulse leaves 0.3 % at once on a bar of one size, too; so within PBD it comes
from the coarse half.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pbd_run import PbdRun, block_scene

from softseam_protocol.messages.participant import BodyState, Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Floats
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

CELLS, EDGE, SPEED = 200, 0.01, 10.0
LEFT = {"min": (-9.0, -1.0, -1.0), "max": (0.0, 1.0, 1.0)}
PASSED = 0.08
"""by when the pulse is as far on the right as it was on the left [s]"""


def bar(**pbd: Any) -> Scene:
    size = (CELLS * EDGE, EDGE, EDGE)
    step = 0.25 * EDGE / SPEED
    return block_scene(size, EDGE, kind="linear", young=1e5, poisson=0.0, density=1000.0, step=step, pbd=pbd)


def pulse(x_rest: Floats, nodes: int) -> tuple[Floats, Floats]:
    """Places and velocities (n, 3) of a pulse to the right with so many cells a wavelength."""

    def height(along: Floats) -> Floats:
        apart = along + 0.4
        return 1e-5 * np.exp(-((apart / 0.15) ** 2)) * np.cos(2.0 * np.pi / (nodes * EDGE) * apart)

    x, v = x_rest.copy(), np.zeros_like(x_rest)
    x[:, 0] += height(x_rest[:, 0])
    v[:, 0] = -SPEED * (height(x_rest[:, 0] + 1e-6) - height(x_rest[:, 0] - 1e-6)) / 2e-6
    return x, v


def within_pbd(nodes: int) -> float:
    """Share of the energy that a border from coarse to fine blocks sends back, by leapfrog, which loses none."""
    scene = bar(method="leapfrog", coarse={"boxes": [LEFT]})
    x, v = pulse(PbdRun(scene).body.x_rest, nodes)
    run = PbdRun(scene, x=x, v=v)
    run.run(PASSED)
    along, fields, model = run.body.x_rest[:, 0], run.fields(), run.solver.model
    assert model.levels.coarse.sum() == CELLS // 2
    kinetic = 0.5 * run.solver.parameters.arrays.mass * (fields.v**2).sum(axis=1)
    strain, middles = fields.cell_energy, run.body.x_rest[run.body.cell_nodes[:, 13], 0]
    left = float(kinetic[along < -1e-9].sum() + strain[middles < 0.0].sum())
    right = float(kinetic[along > 1e-9].sum() + strain[middles > 0.0].sum())
    return left / (left + right)


def through_a_seam(nodes: int, coarse: bool) -> float:
    """The same from FEM into PBD; midpoint and eight substeps, so that little is damped."""
    said = bar(substeps=8, coarse={"beyond": 0.0} if coarse else None).model_dump()
    said["regions"] = {"default": "pbd", "near": {"model": "fem", "boxes": [LEFT]}}
    said["models"]["fem"] |= {"integrator": "midpoint", "radius": 1.0}
    said["seam"] = {"tolerance": 1e-6}
    simulation = Simulation(Bundle(Scene.model_validate(said).model_dump_json(), {}), EmbeddedTransport())
    body = simulation.body
    x, v = pulse(body.x_rest, nodes)
    none = np.full(body.n_points, -1, dtype=np.int32)
    simulation.regions.start(BodyState(x, v, np.zeros((body.n_points, 3)), none))
    for _ in range(round(PASSED * SPEED / EDGE / 0.25)):
        report = simulation.step()
    simulation.close()
    energy = {name: side.kinetic + side.strain for name, side in report.parts.items()}
    return energy["body.near"] / energy["body.far"]


@pytest.mark.parametrize(("nodes", "most"), [(10, 3e-3), (20, 1.5e-4)])
def test_a_wave_passes_from_coarse_to_fine_blocks(nodes: int, most: float) -> None:
    """Measured 2.0e-3 and 1.1e-4; impedances of lumped cells alone say 4e-4 and 2e-5."""
    reflected = within_pbd(nodes)
    assert 0.3 * most < reflected < most


def test_a_wave_passes_a_seam_into_coarse_blocks() -> None:
    """20 coarse nodes a wavelength: 1.0e-4, against 9e-6 into blocks of half the size, and 1e-2 that may be."""
    fine, coarse = through_a_seam(20, False), through_a_seam(20, True)
    assert fine < 2e-5
    assert 2.0 * fine < coarse < 2e-4
