"""Runs of FEM beside XPBD at a seam: the cantilever of the scenes, and a bar of four cells."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from softseam.variants import with_settings
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_protocol.scene.kinds import IntegratorKind, SeamScheme
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

CANTILEVER = Path(__file__).parents[1] / "scenes" / "cantilever.yaml"
STEP, SUBSTEPS = 0.002, 20
"""of the bar [s], and of XPBD in it"""
CLAMPED = {"fixed": [{"min": [0.0799, -1.0, -1.0], "max": [0.081, 1.0, 1.0]}], "velocity": [0.0, 0.0, 0.05]}
FREE = {"spin": [0.0, 8.0, 0.0]}
"""what the bar's body may be"""


def cantilever(*settings: str) -> Simulation:
    """The scene's beam, clamped and released under its weight, FEM in the half at the wall."""
    loaded = load_scene(CANTILEVER)
    scene = with_settings(loaded.scene, settings)
    return Simulation(bundle_scene(scene, loaded.bundle.files), EmbeddedTransport())


@cache
def fall(*settings: str) -> list[StepReport]:
    """Its first 0.24 s, in which it reaches its lowest place."""
    simulation = cantilever(*settings)
    return [simulation.step() for _ in range(120)]


def bar(
    scheme: SeamScheme,
    integrator: IntegratorKind,
    body: dict[str, Any],
    density: float = 1000.0,
    young: float = 1e5,
    step: float = STEP,
    tolerance: float = 3e-4,
) -> Simulation:
    """Four cells in a row, free or clamped, the first two FEM's, with density [kg/m^3] and stiffness [Pa] of their own.

    The others have 1000 kg/m^3 and 100 kPa.
    """
    half = {"kind": "box", "size": [0.04, 1.0, 1.0], "position": [0.02, 0.0, 0.0]}
    material = {"young": 1e5, "poisson": 0.3, "density": 1000.0}
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "bar",
            "gravity": [0.0, 0.0, 0.0],
            "step": step,
            "duration": 1.0,
            "body": {
                "shape": {"kind": "block", "size": [0.08, 0.02, 0.02]},
                "cell": 0.02,
                "position": [0.04, 0.0, 0.0],
                "material": material,
                "inclusions": [{"shape": half, "material": {**material, "density": density, "young": young}}],
                **body,
            },
            "regions": {
                "default": "pbd",
                "near": {"model": "fem", "boxes": [{"min": [-1.0, -1.0, -1.0], "max": [0.04, 1.0, 1.0]}]},
            },
            "models": {"fem": {"integrator": integrator}, "pbd": {"substeps": SUBSTEPS}},
            "seam": {"scheme": scheme, "tolerance": tolerance},
        }
    )
    return Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())


def largest_energy(reports: list[StepReport]) -> float:
    return max(report.energy["kinetic"] + report.energy["strain"] for report in reports)
