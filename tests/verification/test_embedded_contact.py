"""Contact of embedded surfaces: both models touch at the same points, so dense that nothing passes between them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import solids
from test_thin_tools import PLACES, ROD

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene
from softseam_services.body import embed
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

Solid = tuple[solids.Floats, solids.Triangles]
SLAB = solids.box((0.06, 0.06, 0.03), (-0.03, -0.03, 0.0))
BALL = solids.sphere(0.03, 4)


def simulate(solid: Solid, cell: float, model: str, young: float = 20e3, **scene: Any) -> tuple[Simulation, StepReport]:
    """A run at its end, and its last report, with wrenches averaged over the second half."""
    shape = {"kind": "mesh", "path": "body.obj"}
    material = {"young": young, "poisson": 0.4, "density": 1000.0}
    body = {"shape": shape, "cell": cell, "material": material, **scene.pop("body", {})}
    text = {"softseam": 1, "name": "shape", "step": 0.01, "body": body, "regions": {"default": model}, **scene}
    files = {"body.obj": solids.obj(*solid)}
    simulation = Simulation(Bundle(Scene.model_validate(text).model_dump_json(), files), EmbeddedTransport())
    reports = [simulation.step()]
    while not reports[-1].done:
        reports.append(simulation.step(fields=True))
    wrench = np.mean([report.wrench for report in reports[len(reports) // 2 :]], axis=0)
    return simulation, replace(reports[-1], wrench=wrench)


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_rod_is_felt_alike_wherever_it_is_set_down(model: str) -> None:
    """A slab as a mesh on cells of 10 mm: it was felt at three of these places, in XPBD at two."""
    forces = []
    for x, y in PLACES:
        rod = {"kind": "capsule", "radius": 5e-3, "length": 0.04, "position": [x, y, 0.0555]}
        held = {"fixed": [{"min": [-1, -1, -1e-3], "max": [1, 1, 1e-3]}]}
        motion = [{"tools": ["rod"], "move": [0, 0, -5.5e-3], "speed": 0.02}, {"hold": 0.3}]
        _, report = simulate(SLAB, 0.01, model, body=held, gravity=[0, 0, 0], tools={"rod": rod}, motion=motion)
        forces.append(float(np.linalg.norm(report.wrench[0, :3])))
    assert np.allclose(forces, ROD, rtol=0.15), forces


def squeezed(solid: Solid, cell: float, model: str = "fem") -> float:
    """Force of two plates that squeeze a body by a sixth along x [N]."""
    reach = float(solid[0][:, 0].max())
    plates = {
        name: {"kind": "box", "size": [0.01, 0.2, 0.2], "position": [side * (reach + 0.0055), 0, 0], "friction": 0.6}
        for name, side in (("left", -1), ("right", 1))
    }
    motion = [{"tools": list(plates), "close": 0.04, "until": {"time": reach / 6 / 0.02}}, {"hold": 0.3}]
    _, report = simulate(solid, cell, model, gravity=[0, 0, 0], tools=plates, motion=motion)
    return float(np.abs(report.wrench[:, 0]).mean())


@pytest.mark.parametrize(("scale", "refinements"), [((1.0, 1.0, 1.0), 4), ((1.0, 1.6, 0.8), 3)])
def test_more_points_change_little(
    scale: tuple[float, float, float], refinements: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, triangles = solids.sphere(0.03, refinements)
    solid = vertices * scale, triangles
    force = squeezed(solid, 0.012)
    monkeypatch.setattr(embed, "SPACING", 0.125)
    assert squeezed(solid, 0.012) == pytest.approx(force, rel=0.01)


@pytest.fixture(scope="module")
def middle() -> float:
    """Of a ball on cells of 10 mm, in FEM [N]."""
    return squeezed(BALL, 0.01)


def test_smaller_cells_converge(middle: float) -> None:
    """By thinned points the force went up and down with the cells."""
    coarse, fine = (squeezed(BALL, cell) for cell in (0.015, 0.0075))
    assert coarse == pytest.approx(fine, rel=0.06) and middle == pytest.approx(fine, rel=0.03)


def test_both_models_press_alike(middle: float) -> None:
    assert squeezed(BALL, 0.01, "pbd") == pytest.approx(middle, rel=0.05)


@pytest.mark.parametrize("model", ["fem", "pbd"])
@pytest.mark.parametrize(("cell", "young"), [(0.02, 20e3), (0.012, 20e3), (0.012, 60e3)])
def test_penetration_is_that_of_the_surface(model: str, cell: float, young: float) -> None:
    """A ball rests on the ground: its lowest point was .5 to 4 mm below it, and the report said less than 1 um."""
    simulation, report = simulate(BALL, cell, model, young, tools={"ground": {"kind": "plane"}}, duration=1.0)
    height = simulation.frame().point_x[:, 2]
    body = simulation.only.body
    assert isinstance(body, Body)
    pressed = body.surface.area > 0.0
    lowest = float(height[pressed].min())
    assert -lowest == pytest.approx(report.penetration, rel=0.1)
    assert -1.5e-3 < lowest < 0.0
    assert lowest - height.min() < 1e-4  # vertices, which stick out of facets
    weight = 9.81 * 1000.0 * 4.0 / 3.0 * np.pi * 0.03**3
    assert report.wrench[0, 2] == pytest.approx(-weight, rel=0.02)
