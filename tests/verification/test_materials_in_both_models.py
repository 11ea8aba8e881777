"""Every material that finite strains allow, in FEM and PBD at once: the grasp of tofu, hybrid against FEM alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from softseam.variants import Model, with_model, with_settings
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_protocol.scene.materials import MATERIALS, material_spec
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

GRASP = Path(__file__).parents[2] / "scenes" / "tofu_grasp.yaml"


def forces(scene: Scene, model: Model) -> tuple[float, float]:
    """Greatest grip force and that after the lift [N]."""
    simulation = Simulation(bundle_scene(with_model(scene, model)), EmbeddedTransport())
    grip = []
    while not simulation.done:
        grip.append(simulation.step().quantities["grip_force"])
    simulation.close()
    return max(grip), grip[-1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(set(MATERIALS) - {"linear", "neo_hookean"}))
def test_hybrid_grips_as_fem_does(kind: str) -> None:
    """The laws differ by 40 % in force; the two models of one law by less than 1 %.

    Squeezed by a tenth: at 15 % St. Venant-Kirchhoff, which softens in compression, may fold below the plates' edges.
    """
    scene = with_settings(load_scene(GRASP).scene, ["motion.1.until.compression=0.1"])
    ratio = {"ratio": 0.2} if kind == "mooney_rivlin" else {}
    assert isinstance(scene.body, BodySpec)
    material = material_spec({**scene.body.material.model_dump(), "kind": kind, **ratio})
    scene = scene.with_body(scene.body.model_copy(update={"material": material}))
    assert forces(scene, "hybrid") == pytest.approx(forces(scene, "fem"), rel=0.01)
