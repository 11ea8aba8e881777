"""Stress of octants that a body hardly fills: right under a known load, and no peak of its own."""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import numpy as np
import pytest
import solids
from element_statics import Statics, lattice
from numpy.typing import NDArray
from test_cut_cells import AXIS, Deflection, embedded
from test_embedded_contact import simulate

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.session import Frame
from softseam_services.body import embed
from softseam_services.body.body import Body
from softseam_services.body.hardly_filled import HardlyFilled
from softseam_services.body.recover import von_mises
from softseam_services.body.slivers import THIN
from softseam_services.fem.kernels.elements import cauchy_stress
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.quantities import MEASUREMENTS, Look, RestingBody
from softseam_services.orchestrator.simulation import Simulation

Floats = NDArray[np.float64]


def turned_cube() -> tuple[Floats, solids.Triangles]:
    vertices, triangles = solids.box((0.04, 0.04, 0.04), (-0.02, -0.02, -0.02))
    u = np.cross([0.3, 1.0, 0.2], AXIS)
    u /= np.linalg.norm(u)
    return vertices @ np.stack([u, np.cross(AXIS, u), AXIS]), triangles


def star() -> tuple[Floats, solids.Triangles]:
    """Flat, with five rounded arms of 9 mm, one of which points along x."""
    vertices, triangles = solids.sphere(0.03, 4)
    angle, out = np.arctan2(vertices[:, 1], vertices[:, 0]), np.hypot(vertices[:, 0], vertices[:, 1]) / 0.03
    arms = 1.0 + 0.3 * out**2 * np.cos(5.0 * angle)
    return vertices * np.stack([arms, arms, np.full(len(arms), 0.5)], axis=1), triangles


def pulled(body: Body) -> Floats:
    """Stress of the octants (C, 8, 6), over that of the tractions of a uniform tension along AXIS on the surface."""
    case = Deflection(body, "hex27")
    corners = body.surface.triangles
    a, b, c = (case.points[corners[:, i]] for i in range(3))
    traction = np.outer(0.5 * np.cross(b - a, c - a) @ AXIS, AXIS) / 3.0
    force = np.zeros_like(case.points)
    for corner in corners.T:
        np.add.at(force, corner, traction)
    statics, stress = Statics(body, "hex27"), np.zeros((body.n_cells, 8, 6))
    moved = body.x_rest + case.moved(case.follow.T @ force)
    cauchy_stress(moved, statics.model, statics.parameters, statics.work, stress)
    return stress


@pytest.mark.parametrize(
    "solid", [turned_cube(), solids.cylinder(0.02, 0.08, 24, AXIS), solids.sphere(0.02, 4)], ids=["cube", "bar", "ball"]
)
def test_a_uniform_stress_is_told_in_every_octant(
    solid: tuple[Floats, solids.Triangles], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To 4 %; as the cells have it, it is off by 14 to 40 % where octants are next to empty."""
    monkeypatch.setattr(embed, "DRAWN", 0.25)  # tractions are laid on the corners of what is drawn
    body = embedded(*solid, 0.014, "linear")
    stress = pulled(body)
    exact = np.outer(AXIS, AXIS)[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    told = HardlyFilled(body).replaced(stress)
    assert np.abs(told - exact).max() < 0.04
    assert np.abs(stress - exact).max() > 0.1


def test_well_filled_octants_keep_what_they_have() -> None:
    body = embedded(*star(), 0.009, "linear")
    stress = np.random.default_rng(1).normal(size=(body.n_cells, 8, 6))
    told = HardlyFilled(body).replaced(stress)
    kept = (told == stress).all(axis=2)
    assert kept[body.fill >= THIN].all() and not kept[body.fill < 0.01].any()
    assert von_mises(told).max() == von_mises(stress)[kept].max()


def test_full_cells_keep_their_array() -> None:
    body = lattice((0.02, 0.02, 0.02), (2, 2, 2))
    stress = np.zeros((8, 8, 6))
    assert HardlyFilled(body).replaced(stress) is stress


def test_thin_walls_keep_their_own() -> None:
    """What fills a twentieth of each octant has no better filled neighbours, but beside the bulk that it is part of."""
    body = lattice((0.04, 0.02, 0.02), (4, 2, 2))
    along = body.cell_grid[:, 0]
    body = dataclasses.replace(body, fill=np.where(along >= 2, 0.05, 1.0)[:, None] * np.ones(8))
    stress = np.random.default_rng(1).normal(size=(body.n_cells, 8, 6))
    kept = (HardlyFilled(body).replaced(stress) == stress).all(axis=2)
    assert kept[along != 2].all() and (kept[along == 2] == [False, True] * 4).all()


def test_each_material_keeps_its_own() -> None:
    half = {"kind": "box", "position": (0.0, 0.0, 0.0), "size": (1.0, 1.0, 0.07)}
    bar = solids.cylinder(0.02, 0.08, 24, AXIS)
    body = embedded(*bar, 0.014, "linear", inclusions=[{"shape": half, "material": {"young": 1e5, "poisson": 0.3}}])
    stress = np.repeat(1.0 + body.octant_material[..., None], 6, axis=2)
    np.testing.assert_allclose(HardlyFilled(body).replaced(stress), stress, rtol=1e-12)


def test_a_hundredth_of_the_volume_bears_more() -> None:
    """100 cells of which one half is filled by half: an octant there counts half of one elsewhere."""
    body = lattice((0.1, 0.04, 0.02), (10, 5, 2))
    half = body.cell_grid[:, 0] < 5
    body = dataclasses.replace(
        body,
        fill=np.where(half, 0.5, 1.0)[:, None] * np.ones(8),
        cell_mass=body.cell_mass * np.where(half, 0.5, 1.0)[:, None],
    )
    stress = np.zeros((100, 8, 6))
    stress[half, :, 0] = 1.0
    first, then = np.flatnonzero(half)[0], np.flatnonzero(~half)[:1]
    stress[first, :, 0], stress[then, :4, 0] = 5.0, 7.0  # 4 + 4 of 600
    rest = RestingBody(body)
    assert rest.octant_volume.sum() == pytest.approx(0.75 * 0.1 * 0.04 * 0.02)
    assert p99(rest, stress) == 5.0
    stress[then, 1:4, 0] = 0.0  # 4 + 1 of 600: less than a hundredth
    assert p99(rest, stress) == pytest.approx(1.0)


def p99(rest: RestingBody, cauchy: Floats) -> float:
    """Quantity of a frame with this stress."""
    none, ids = np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
    header, near, turned = Header(1, "s", "", 0, 0, 0, 0.0), np.ones(len(cauchy), dtype=np.int8), np.zeros((0, 4))
    frame = Frame(header, "body", rest.body.x_rest, cauchy, near, none, none, ids, ids, none, none, turned)
    look = Look(rest, cast(Program, None), {}, none, turned, frame)  # of no program is asked anything
    return MEASUREMENTS["von_mises_p99"].measure(look)


def squeezed(cell: float, model: str, **scene: Any) -> tuple[Simulation, float]:
    """A star squeezed by a sixth between plates, and its peak [Pa]."""
    solid = star()
    reach = float(solid[0][:, 0].max())
    plates = {
        name: {"kind": "box", "size": [0.01, 0.2, 0.2], "position": [side * (reach + 0.0055), 0, 0], "friction": 0.6}
        for name, side in (("left", -1), ("right", 1))
    }
    motion = [{"tools": list(plates), "close": 0.04, "until": {"time": reach / 6 / 0.02}}, {"hold": 0.1}]
    simulation, report = simulate(solid, cell, model, gravity=[0, 0, 0], tools=plates, motion=motion, **scene)
    return simulation, report.quantities["peak_von_mises"]


def raw_peak(simulation: Simulation) -> float:
    """As the cells have it [Pa]."""
    fields = simulation.bodies["body"].participants.observe(False)
    return max(float(von_mises(side.cauchy).max()) for side in fields.values())


def test_the_peak_of_a_star_is_the_same_in_all_models_and_settles() -> None:
    """Cells of 12, 9 and 7 mm: 9.2, 10.0 and 11.2 kPa by FEM, 8.7, 10.3 and 11.1 by XPBD, whose cells have 8.7, 13.8
    and 23 as they are."""
    _, coarse = squeezed(0.012, "fem")
    _, fem = squeezed(0.009, "fem")
    pbd_run, pbd = squeezed(0.009, "pbd")
    near = {"default": "pbd", "near": {"model": "fem", "within": 0.008, "tools": ["left", "right"]}}
    _, hybrid = squeezed(0.009, "pbd", regions=near)
    assert coarse == pytest.approx(fem, rel=0.15)
    assert pbd == pytest.approx(fem, rel=0.05) and hybrid == pytest.approx(fem, rel=0.1)
    assert raw_peak(pbd_run) > 1.2 * pbd
