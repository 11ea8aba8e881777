"""Blocks that are pressed, problems that independent codes have solved, on cells of any size by FEM alone.

Each function returns its quantities by the names of `reference_values`. Tests take the coarsest level that proves a
claim, `benchmarks/references.py` goes to the finest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from element_statics import Statics, lattice
from reference_values import Found

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.body.recover import FEM_SAMPLE, nodal_recovery, von_mises
from softseam_services.fem.kernels.elements import cauchy_stress
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation


def _simulated(scene: dict[str, Any]) -> list[tuple[float, Found]]:
    """Force along z on the last tool, and quantities, at the end of every second phase of a scene."""
    simulation = Simulation(
        Bundle(Scene.model_validate({"softseam": 1, "gravity": (0, 0, 0), **scene}).model_dump_json(), {}),
        EmbeddedTransport(),
    )
    ends: dict[int, tuple[float, Found]] = {}
    while not simulation.done:
        report = simulation.step()
        ends[report.phase] = abs(float(report.wrench[-1, 2])), dict(report.quantities)
    simulation.close()
    return [ends[phase] for phase in sorted(ends) if phase % 2 == 1]


def indentation(n: int) -> Found:
    """On n x n x 4n/5 cells."""
    ends = _simulated(
        {
            "name": "indentation",
            "symmetry": ["x", "y"],
            "step": 0.05,
            "body": {
                "shape": {"kind": "block", "size": (0.05, 0.05, 0.04)},
                "cell": (0.05 / n, 0.05 / n, 0.04 / round(0.8 * n)),
                "material": {"young": 20e3, "poisson": 0.45, "density": 1000.0},
                "fixed": [{"min": (-1, -1, -1), "max": (1, 1, 1e-6)}],
            },
            "tools": {"ball": {"kind": "sphere", "radius": 0.02, "position": (0, 0, 0.06), "friction": 0.0}},
            "motion": [{"tools": ["ball"], "move": (0, 0, -0.001), "speed": 0.005}, {"hold": 0.05}] * 4,
            "probes": {"middle": (0, 0, 0.02)},
            "regions": {"default": "fem"},
            "models": {"fem": {"integrator": "static"}},
        }
    )
    found = {f"force at {mm} mm": ends[mm - 1][0] for mm in (1, 2, 3, 4)}
    return found | {f"von Mises at {mm} mm": ends[mm - 1][1]["middle.von_mises"] for mm in (2, 4)}


_PLACES = {
    "centre": (0.0, 0.0, 0.0),
    "quarter of the axis": (0.0, 0.0, 0.5),
    "under the pad": (0.0, 0.0, 1.0),
    "middle of a side": (1.0, 0.0, 0.0),
    "half way aside": (0.5, 0.5, 0.0),
    "half way up": (0.5, 0.5, 0.5),
}
"""in half edges from a cube's centre"""


def pad(n: int) -> Found:
    """On n^3 cells, through contact, friction lets nothing slip; 5 divides n: pads end between cells. An even number is
    solved on a quarter."""
    tool = {"kind": "box", "size": (0.03, 0.03, 0.01), "friction": 20.0}
    ends = _simulated(
        {
            "name": "pad",
            "symmetry": ["x", "y"] if n % 2 == 0 else [],
            "step": 0.05,
            "body": {
                "shape": {"kind": "block", "size": (0.05, 0.05, 0.05)},
                "cell": 0.05 / n,
                "material": {"young": 20e3, "poisson": 0.45, "density": 1000.0},
            },
            "tools": {"low": {**tool, "position": (0, 0, -0.005)}, "high": {**tool, "position": (0, 0, 0.055)}},
            "motion": [
                {"tools": ["low", "high"], "close": 0.00125, "until": {"time": 1.0}},
                {"hold": 0.25},
            ] * 3,
            "probes": {
                name.replace(" ", "_"): (0.025 * x, 0.025 * y, 0.025 + 0.025 * z)
                for name, (x, y, z) in _PLACES.items()
            },
            "regions": {"default": "fem"},
        }
    )  # fmt: skip
    found = {f"force at {5 * (i + 1)} %": force for i, (force, _) in enumerate(ends)}
    last = ends[-1][1]
    return found | {f"von Mises, {name}": last[f"{name.replace(' ', '_')}.von_mises"] for name in _PLACES}


def bonded(n: int, element: str = "hex27") -> Found:
    """On an eighth of the cube with n^3 cells, n even; forces and stress as the product has them."""
    half = 0.02
    case = Statics(lattice((half, half, half), (n, n, n), young=50e3, poisson=0.45), element)
    x = case.x_rest
    held, top = x < 1e-9, x[:, 2] > half - 1e-9
    held[top] = True
    found: Found = {}
    for percent in (5, 10, 15):
        x = x * np.array([1.0, 1.0, (1.0 - 0.01 * percent) / (x[:, 2].max() / half)])
        x = case.solve(x, held)
        found[f"force at {percent} %"] = float(-4.0 * case.forces(x)[top, 2].sum())
    found["energy at 15 %"] = 8.0 * case.energy(x)
    stress = np.empty((case.body.n_cells, 8, 6))
    cauchy_stress(x, case.model, case.parameters, case.work, stress)
    sample = np.full(case.body.n_cells, FEM_SAMPLE)
    at_nodes = von_mises(nodal_recovery(case.body, sample) @ stress.reshape(-1, 6))
    for name in ("centre", "middle of a side", "half way up"):
        away = np.abs(case.x_rest - half * np.array(_PLACES[name])).sum(axis=1)
        found[f"von Mises, {name}"] = float(at_nodes[np.argmin(away)])
    return found
