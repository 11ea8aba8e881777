"""Strain energy of each cell: sums to the reported one, and is W V where the strain is uniform."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import FemRun, block
from pbd_run import PbdRun

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import BodyState, Fields
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.models import FemSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.materials.point import energy
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

HEADER = Header(1, "test", "near", 0, 0, 0, 0.0)
STRETCH = np.diag([1.1, 0.95, 0.9]) + 0.05 * np.eye(3, k=1)
STILL = (0.0, 0.0, 0.0)


def stretched(scene: Scene, gradient: np.ndarray) -> BodyState:
    body = FemRun(scene).body
    n_points = len(body.surface.cell)
    none = np.full(n_points, -1, dtype=np.int32)
    return BodyState(body.x_rest @ gradient.T, np.zeros_like(body.x_rest), np.zeros((n_points, 3)), none)


def with_element(scene: Scene, element: ElementKind) -> Scene:
    fem = FemSpec(element=element)
    return scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})


@pytest.mark.parametrize("element", ["hex27", "hex8_bbar", "tet4_fbar"])
def test_uniform_strain_gives_every_cell_its_share(element: ElementKind) -> None:
    """Cells of 2 x 1 x 3 in F = const: W(F) times the volume, in FEM by any element."""
    scene = with_element(block((0.04, 0.03, 0.06), (0.02, 0.03, 0.02), gravity=STILL), element)
    run = FemRun(scene, state=stretched(scene, STRETCH))
    material = run.body.material
    wanted = energy(material.number, material.parameters, STRETCH) * run.body.edges.prod()
    np.testing.assert_allclose(run.solver.fields(HEADER).cell_energy, wanted, rtol=1e-12)


def test_pbd_gives_every_cell_its_share() -> None:
    scene = block((0.04, 0.03, 0.06), (0.02, 0.03, 0.02), gravity=STILL, regions={"default": "pbd"})
    run = PbdRun(scene, state=stretched(scene, STRETCH))
    material = run.body.material
    wanted = energy(material.number, material.parameters, STRETCH) * run.body.edges.prod()
    np.testing.assert_allclose(run.solver.fields(HEADER).cell_energy, wanted, rtol=1e-12)


def test_crushed_cells_count_with_both_rules() -> None:
    """A cube squeezed to 0.5: part split, part full quadrature; the sum is the energy that the step reports."""
    scene = block(cell=0.025, gravity=STILL, body={"fixed": [{"min": (-1, -1, -1), "max": (1, 1, 1)}]})
    run = FemRun(scene, state=stretched(scene, np.diag([1.3, 1.3, 0.5])))
    reply = run.step(dt=1e-3)
    assert reply.extras["n_blended"] == 8
    fields: Fields = run.solver.fields(HEADER)
    assert fields.cell_energy.sum() == pytest.approx(reply.strain, rel=1e-13)


def test_both_sides_of_a_seam_sum_to_their_report() -> None:
    """A hanging bar, half FEM, half PBD: the frame's energies add up, side by side, to those of the regions.

    By midpoint, whose steps are taken again: where steps are corrected, regions tell estimates of what the frame has
    exactly.
    """
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "hang",
            "step": 0.005,
            "duration": 0.05,
            "body": {
                "shape": {"kind": "block", "size": (0.08, 0.02, 0.02)},
                "cell": 0.02,
                "material": {"young": 5e4, "poisson": 0.4, "density": 1000.0},
                "fixed": [{"min": (-0.0401, -1.0, -1.0), "max": (-0.0399, 1.0, 1.0)}],
            },
            "regions": {"default": "pbd", "near": {"boxes": [{"min": (-1, -1, -1), "max": (0, 1, 1)}]}},
            "models": {"fem": {"integrator": "midpoint"}},
        }
    )
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    for _ in range(6):
        report = simulation.step(fields=True)
    frame = simulation.frame()
    simulation.close()
    near = frame.cell_near == 1
    assert near.any() and not near.all()
    assert (frame.cell_energy > 0.0).all()
    assert frame.cell_energy[near].sum() == pytest.approx(report.parts["body.near"].strain, rel=1e-12)
    assert frame.cell_energy[~near].sum() == pytest.approx(report.parts["body.far"].strain, rel=1e-12)
