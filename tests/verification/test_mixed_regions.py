"""Bodies cut into many regions of FEM and PBD, near patches that touch along edges and corners too, sag as FEM does.

How far PBD alone is off in statics is what it may cost: PBD's own positions at rest, by Newton on its blocks' forces.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from fem_run import FemRun
from numpy.typing import NDArray
from pbd_run import PbdRun, static_solution

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

Floats = NDArray[np.float64]
EVERYWHERE = {"min": [-1, -1, -1], "max": [1, 1, 1]}


def scene(body: dict[str, Any], gravity: list[float], static: bool = False) -> Scene:
    fem = {"integrator": "static", "tolerance": 1e-8} if static else {}
    regions = {"default": "fem"} if static else {"default": "pbd", "near": {"model": "fem", "boxes": [EVERYWHERE]}}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "cut",
            "gravity": gravity,
            "step": 0.01,
            "duration": 10.0,
            "body": body,
            "regions": regions,
            "models": {"fem": fem},
            "seam": {"tolerance": 1e-5},
        }
    )


def beam(static: bool = False) -> Scene:
    """A cantilever of 4 cells that sags by a fifth of its length."""
    body = {
        "shape": {"kind": "block", "size": [0.08, 0.02, 0.02]},
        "cell": 0.02,
        "position": [0.04, 0.0, 0.0],
        "material": {"young": 100e3, "poisson": 0.4, "density": 1000.0},
        "fixed": [{"min": [-0.001, -1, -1], "max": [1e-4, 1, 1]}],
    }
    return scene(body, [0.0, 0.0, -9.81], static)


def tofu(static: bool = False) -> Scene:
    """A block of 4 x 4 x 2 cells on a base that it sticks to, tilted."""
    body = {
        "shape": {"kind": "block", "size": [0.06, 0.06, 0.03]},
        "cell": 0.015,
        "material": {"young": 20e3, "poisson": 0.45, "density": 1050.0},
        "fixed": [{"min": [-1, -1, -0.001], "max": [1, 1, 1e-4]}],
    }
    return scene(body, [4.0, 0.0, -9.81], static)


def at_rest(spec: Scene, near: NDArray[np.bool_], n_steps: int) -> tuple[Floats, float, float]:
    """Displacements (N, 3) [m] once the cut body has come to rest, its kinetic over its strain energy, largest gap."""
    simulation = Simulation(Bundle(spec.model_dump_json(), {}), EmbeddedTransport())
    simulation.set_near(near)
    gap = 0.0
    for _ in range(n_steps):
        report = simulation.step()
        gap = max(gap, report.seam.gap)
    u = simulation.frame().x - simulation.body.x_rest
    simulation.close()
    return u, report.energy["kinetic"] / report.energy["strain"], gap


@cache
def references(build: Callable[[bool], Scene]) -> tuple[Floats, float, NDArray[np.int32]]:
    """FEM's displacements at rest (N, 3) [m], PBD's error against them, and the cells' places in the grid (C, 3)."""
    fem = FemRun(build(True))
    fem.step()
    pbd = PbdRun(build(False))
    x = static_solution(pbd, pbd.region.mass[:, None] * pbd.body.gravity)
    u = fem.x - fem.body.x_rest
    return u, difference(x - pbd.body.x_rest, u), fem.body.cell_grid


def difference(u: Floats, reference: Floats) -> float:
    """Root mean square, relative."""
    return float(np.sqrt(((u - reference) ** 2).sum() / (reference**2).sum()))


def test_a_cantilever_cut_at_any_place() -> None:
    """FEM from the clamp to 1/4, 1/2, 3/4: the more FEM there is where it bends, the less is left of PBD's error."""
    u, calibration, grid = references(beam)
    assert 0.02 < calibration < 0.1
    errors = []
    for n_near in (1, 2, 3):
        found, restless, gap = at_rest(beam(), grid[:, 0] < n_near, 200)
        assert restless < 1e-5 and gap < 1e-5 * 0.02
        errors.append(difference(found, u))
    print(f"PBD alone is off by {calibration:.3f}; cut at 1/4, 1/2, 3/4:", [f"{error:.4f}" for error in errors])
    assert errors[0] < 0.7 * calibration
    assert errors[2] < errors[1] < errors[0]


@pytest.mark.parametrize("n_regions", [2, 4, 8])
def test_tofu_in_a_chequered_pattern(n_regions: int) -> None:
    """Halves, quarters and eighths by turns of FEM and PBD; near patches meet at an edge in the middle, or a corner."""
    u, calibration, grid = references(tofu)
    i, j, k = grid[:, 0] // 2, grid[:, 1] // 2, grid[:, 2]
    near = {2: i, 4: i + j, 8: i + j + k}[n_regions] % 2 == 0
    found, restless, gap = at_rest(tofu(), near, 60)
    assert restless < 1e-5 and gap < 1e-5 * 0.015
    error = difference(found, u)
    print(f"{n_regions} regions: off by {error:.4f}, PBD alone by {calibration:.4f}")
    assert error < calibration
