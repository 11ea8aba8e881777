"""Hinges of a sheet by their angle: gradient, the plate's energy, sag, and a shape at rest that is not flat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from particle_run import G, ParticleRun, particle_scene

import softseam
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.particles import HingeSpec
from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.particles.hinge import HINGE, joins

Floats = NDArray[np.float64]
FLAT = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.7, 0.9, 0.0], [0.2, -0.6, 0.0]])
BENDING = 1e-3
HINGES = {"kind": "hinge", "bending": BENDING}


def angle(x: Floats, at_rest: float = 0.0) -> tuple[float, Floats]:
    gradient = np.zeros((4, 3))
    return HINGE.value(x, np.array([at_rest]), gradient), gradient


@pytest.mark.parametrize("bent", [0.0, 0.3, 1.5])
def test_the_gradient_is_the_slope_and_neither_pushes_nor_turns(bent: float) -> None:
    """Flat, bent, and thrown about; where it is flat, arccos would have none (`test_errata.py`)."""
    rng = np.random.default_rng(2)
    x, d = FLAT + bent * rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
    _, gradient = angle(x)
    slope = (angle(x + 1e-6 * d)[0] - angle(x - 1e-6 * d)[0]) / 2e-6
    assert (gradient * d).sum() == pytest.approx(slope, rel=1e-7)
    assert abs(slope) > 0.1
    assert gradient.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.cross(x, gradient).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("wanted", [-3.0, -0.5, 0.0, 2.0, 3.1])
def test_it_is_the_angle_by_which_a_wing_is_turned(wanted: float) -> None:
    turned = FLAT.copy()
    turned[2, 1:] = 0.9 * np.array([np.cos(wanted), np.sin(wanted)])
    assert angle(turned, 0.25)[0] == pytest.approx(wanted - 0.25, abs=1e-14)


def test_a_triangle_without_area_is_let_go() -> None:
    collapsed = FLAT.copy()
    collapsed[2] = 0.4 * collapsed[1]
    value, gradient = angle(collapsed, 0.5)
    assert value == 0.0 and not gradient.any()


def sheet(**other: Any) -> dict[str, Any]:
    return {"kind": "sheet", "size": (0.2, 0.2), "divisions": (20, 16), "density": 0.2, "stretch": 100.0, **other}


def bent_by(body: ParticleBody, x: Floats, spec: HingeSpec) -> float:
    """Energy of the hinges at x [J]."""
    found = joins(spec, body)
    pairs = zip(found.particles, found.parameters, found.compliance, strict=True)
    return float(sum(0.5 * angle(x[nodes], rest[0])[0] ** 2 / compliance for nodes, rest, compliance in pairs))


@pytest.mark.parametrize("divisions", [(20, 16), (5, 6), (2, 1), (1, 2)])
def test_small_deflections_have_the_energy_of_the_bends_without_an_angle(divisions: tuple[int, int]) -> None:
    """Whatever they are, on spacings that differ: alike to the square of the slopes."""
    size = 0.01 * divisions[0], 0.0125 * divisions[1]
    body = ParticleRun(particle_scene(sheet(bending=BENDING, size=size, divisions=divisions))).body
    x = body.x_rest.copy()
    x[:, 2] = 1e-6 * np.random.default_rng(3).normal(size=len(x))
    value = np.einsum("mi,mic->mc", body.bends.coefficient, x[body.bends.nodes])
    isometric = float(0.5 * body.bends.stiffness @ (value**2).sum(axis=1))
    assert len(body.bends.nodes) == len(joins(HingeSpec(bending=BENDING), body).particles)
    assert bent_by(body, x, HingeSpec(bending=BENDING)) == pytest.approx(isometric, rel=1e-6)


@pytest.mark.parametrize("curvature", [(0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3)])
def test_a_sheet_rolled_by_its_curvature_at_rest_has_no_energy(curvature: tuple[float, float]) -> None:
    """Along either side, ends up where it is positive, on spacings of 10 x 12.5 mm; rolled the other way four times
    that of a flat one."""
    body = ParticleRun(particle_scene(sheet())).body
    spec, energies = HingeSpec(bending=BENDING, curvature=curvature), []
    for share in (1.0, 0.0, -1.0):
        x = body.x_rest.copy()
        x[:, 2] = 0.5 * share * (body.x_rest[:, :2] ** 2 @ np.array(curvature))
        energies.append(bent_by(body, x, spec))
    assert energies[0] < 1e-5 * energies[1]
    assert energies[2] == pytest.approx(4.0 * energies[1], rel=1e-3)


def strip(**other: Any) -> ParticleRun:
    """20 x 2 spacings of 10 mm, that sags by 2 % of its length where it is clamped at its first two rows."""
    length = 0.2
    body = sheet(
        size=(length, 0.02), divisions=(20, 2), stretch=1e3, damping=20.0, self_contact=False,
        density=0.02 * length * 8.0 * BENDING / (G * length**4),
    ) | other  # fmt: skip
    gravity = -G if "fixed" in other else 0.0
    pbd = {"substeps": 80, "sweeps": 10 if "fixed" in other else 4}
    return ParticleRun(particle_scene(body, gravity=(0.0, 0.0, gravity), pbd=pbd))


def test_a_strip_of_hinges_hangs_over_an_edge_as_a_cantilever() -> None:
    """w = q L'^4/(8 D) per width, as a strip of bends without an angle does (`test_sheets.py`): both within 2 %,
    which is what sweeps leave open."""
    clamp = [{"min": (-0.1, -1.0, -1.0), "max": (-0.09, 1.0, 1.0)}]
    sags = []
    for how in ({"constraints": [HINGES]}, {"bending": BENDING}):
        run = strip(fixed=clamp, **how)
        run.run(0.7)
        sags.append(-run.x[np.isclose(run.body.x_rest[:, 0], 0.1), 2].mean())
    assert sags == pytest.approx([0.02 * 0.2 * 0.975**4] * 2, rel=0.02)


def curvature(run: ParticleRun) -> float:
    """Of the circle through the ends and the middle of the strip's middle row [1/m]."""
    row = run.x[np.isclose(run.body.x_rest[:, 1], 0.0)]
    half, rise = 0.5 * np.linalg.norm(row[-1] - row[0]), 0.5 * (row[0] + row[-1])[2] - row[10, 2]
    return float(2.0 * rise / (half**2 + rise**2))


@pytest.mark.parametrize("at_rest", [8.0, -5.0])
def test_a_strip_with_a_curvature_at_rest_becomes_an_arc(at_rest: float) -> None:
    """Let go flat it ends on a circle of that radius, and nothing is bent. The control: bends without an angle, which
    hold what is flat alone, make the arc flat."""
    spec = HingeSpec(bending=BENDING, curvature=(at_rest, 0.0))
    run = strip(constraints=[spec.model_dump()])
    begun = bent_by(run.body, run.x, spec)
    run.run(1.0)
    assert curvature(run) == pytest.approx(at_rest, rel=1e-3)
    assert bent_by(run.body, run.x, spec) < 1e-3 * begun
    flat = strip(bending=BENDING)
    flat.x[:] = run.x
    flat.run(1.0)
    assert abs(curvature(flat)) < 0.01 * abs(at_rest)


def test_what_no_lattice_or_body_can_hold_is_refused_by_name() -> None:
    """A radius at rest below a spacing, by its line; a rope has no triangles."""
    scene = particle_scene(sheet(divisions=(20, 20), constraints=[HINGES | {"curvature": (0.0, 70.0)}]))
    text = scene.model_dump_json().replace("70.0", "170.0")
    with pytest.raises(SceneError, match=r"0\.59 spacings is less than one") as caught:
        parse_scene(text, "scene")
    assert caught.value.key == "body.constraints.0.curvature"
    rope = {"kind": "rope", "length": 0.5, "divisions": 5, "density": 0.1, "stretch": 2.0, "constraints": [HINGES]}
    with pytest.raises(softseam.SceneRefused, match="hinge joins nothing of this rope: leave it out"):
        softseam.open(particle_scene(rope))
