"""Friction that varies over a body: fields are what they say whatever the cells, and bodies slide by Coulomb's law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from particle_run import ParticleRun, particle_scene

import softseam
from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.friction_field import draw_field, draw_fields
from softseam_services.body.region import build_region
from softseam_services.fem.structures import build_tables
from softseam_services.pbd.model import build_model
from softseam_services.pbd.parameters import build_parameters
from softseam_services.tools.build import build_tools

G, MU, DENSITY, STEP = 9.81, 0.5, 1000.0, 0.005
SLAB = (0.06, 0.06, 0.002)
ORIGIN = np.zeros(3)


def specs(count: int, spread: float, length: float) -> list[FrictionFieldSpec]:
    return [FrictionFieldSpec(spread=spread, length=length, seed=seed) for seed in range(count)]


# ---- what a field promises --------------------------------------------------------------------------------------


@pytest.mark.parametrize("spread", [0.1, 0.3, 1.0])
def test_a_field_has_its_mean_and_spread_on_a_large_surface_whatever_the_seed(spread: float) -> None:
    """30,000 places in a cube of 300 lengths: 1 % of a mean and a spread that sampling leaves, of each of ten seeds."""
    x = np.random.default_rng(1).uniform(-1.5, 1.5, (30_000, 3))
    for factor in draw_fields(specs(10, spread, 0.01), ORIGIN).factor(np.broadcast_to(x, (10, *x.shape))):
        assert factor.mean() == pytest.approx(1.0, abs=0.015 * spread)
        assert factor.std() == pytest.approx(spread, rel=0.1 if spread == 1.0 else 0.03)
        assert factor.min() > 0.0


def test_places_are_correlated_as_the_length_says() -> None:
    """exp(-d^2/(2 length^2)) of the logarithm, over 4,000 seeds: three standard errors are 0.05."""
    fields = draw_fields(specs(4000, 0.3, 0.01), np.array([0.3, 0.1, -0.2]))
    direction = np.array([0.6, 0.0, 0.8])
    x = np.array([0.0, 0.005, 0.01, 0.02, 0.04])[:, None] * direction
    logarithm = np.log(fields.factor(np.broadcast_to(x, (4000, 5, 3))))
    found = np.corrcoef(logarithm.T)[0]
    np.testing.assert_allclose(found, np.exp(-((x @ direction / 0.01) ** 2) / 2.0), atol=0.05)


def test_a_field_is_one_of_place_in_the_body_whatever_the_cells_and_the_model() -> None:
    """Points of FEM and XPBD, of two cells, have the field's value where they are, wherever the body stands."""
    spec: dict[str, Any] = {"spread": 0.4, "length": 0.02, "seed": 5}
    alone = draw_field(FrictionFieldSpec(**spec), ORIGIN)
    for cell in (0.02, 0.01):
        scene = slab("fem", 0.3, spec, cell=(cell, cell, 0.002), position=(0.01, 0.02, 0.03))
        body, tools = build_body(scene, {}), build_tools(scene)
        region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
        at = body.x_rest - [0.01, 0.02, 0.03]
        _, fem = build_tables(body, region, tools, scene.models.fem)
        model = build_model(body, region, tools, scene.models.pbd)
        pbd = build_parameters(model, body, region, tools, scene.models.pbd)
        assert len(pbd.arrays.friction_factor) == len(fem.friction_factor) > 50
        np.testing.assert_allclose(pbd.arrays.friction_factor, alone.factor(at[model.node]), rtol=1e-12)
        np.testing.assert_allclose(fem.friction_factor, pbd.arrays.friction_factor, rtol=1e-12)
        assert np.ptp(fem.friction_factor) > 0.5


def test_a_field_turns_with_a_sheet() -> None:
    spec = {"spread": 0.4, "length": 0.05, "seed": 5}
    flat, turned = (
        ParticleRun(particle_scene({**SHEET, "friction_field": spec, "rotation": rotation, "position": place})).body
        for rotation, place in (((0, 0, 0), (0, 0, 0)), ((0.3, -1.0, 0.4), (0.1, 0.2, 0.3)))
    )
    factors = [body.friction_field.factor(body.x_rest) for body in (flat, turned)]
    np.testing.assert_allclose(factors[1], factors[0], rtol=1e-12)
    assert np.ptp(factors[0]) > 0.5


def test_a_field_without_spread_is_even() -> None:
    even = draw_fields([None, FrictionFieldSpec(spread=0.0, length=0.01), *specs(1, 0.2, 0.01)], ORIGIN)
    factor = even.factor(np.random.default_rng(0).uniform(0.0, 1.0, (3, 40, 3)))
    assert (factor[:2] == 1.0).all() and (factor[2] != 1.0).all()


# ---- what slides ------------------------------------------------------------------------------------------------


def slab(model: str, slope: float, spec: dict[str, Any], **body: Any) -> Scene:
    """A thin slab on a plane, under a weight that pulls along x, too, as on a slope."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "slab",
            "step": STEP,
            "duration": 0.4,
            "gravity": [G * np.sin(slope), 0, -G * np.cos(slope)],
            "body": {
                "shape": {"kind": "block", "size": SLAB},
                "cell": (0.01, 0.01, 0.002),
                "material": {"young": 1e5, "poisson": 0.3, "density": DENSITY},
                "friction_field": spec,
                **body,
            },
            "tools": {"ground": {"kind": "plane", "friction": MU}},
            "regions": {"default": model},
            "models": {"fem": {"tolerance": 1e-7}},
        }
    )


def mean_below(spec: dict[str, Any], n: int = 200) -> float:
    """Of the factor over the slab's underside, by n x n points."""
    at = ((np.arange(n) + 0.5) / n - 0.5) * SLAB[0]
    x, y = np.meshgrid(at, at)
    below = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1)
    return float(draw_field(FrictionFieldSpec(**spec), ORIGIN).factor(below).mean())


@pytest.mark.parametrize("model", ["fem", "pbd"])
@pytest.mark.parametrize("seed", [2, 3])
def test_a_slab_slides_where_the_mean_of_friction_over_its_pressure_is_passed(model: str, seed: int) -> None:
    """A thin slab presses evenly, so it sticks up to tan(slope) = mu <f>, f the factor on its underside, and slides by
    g (sin - mu <f> cos) beyond. <f> is 1.18 and 0.76. Pressure shifts by the thickness over the edge: 1 % of mu."""
    spec = {"spread": 0.4, "length": 0.02, "seed": seed}
    mu = MU * mean_below(spec)
    assert abs(mu / MU - 1.0) > 0.15
    for part in (0.96, 1.04):
        slope = np.arctan(part * mu)
        with softseam.open(slab(model, slope, spec)) as sim:
            sim.reset()
            speed = [sim.step(fields=False).report.momentum[0] / (DENSITY * np.prod(SLAB)) for _ in range(80)]
        if part < 1.0:
            assert np.abs(speed[20:]).max() < 1e-6
        else:
            found = np.tan(slope) - (speed[-1] - speed[39]) / (40 * STEP) / (G * np.cos(slope))
            assert found == pytest.approx(mu, rel=0.012)


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_every_point_slides_by_its_own_coefficient(model: str) -> None:
    """At 45 degrees the tangential force of each point is mu f of its normal one, with the field of its place.

    XPBD's friction goes by a mean of the pressure over 20 ms: there forces are means over 0.2 s.
    """
    spec: dict[str, Any] = {"spread": 0.4, "length": 0.02, "seed": 2}
    with softseam.open(slab(model, np.pi / 4, spec)) as sim:
        start = sim.reset()
        sim.step(count=40)
        force = np.mean([sim.step().contact_force for _ in range(1 if model == "fem" else 40)], axis=0)
    touching = np.flatnonzero(force[:, 2] > 0.1 * force[:, 2].max())
    factor = draw_field(FrictionFieldSpec(**spec), ORIGIN).factor(start.surface[touching])
    across = np.linalg.norm(force[touching, :2], axis=1)
    assert len(touching) > 100 and np.ptp(factor) > 0.8
    np.testing.assert_allclose(across / (MU * force[touching, 2]), factor, rtol=1e-6 if model == "fem" else 0.02)


SHEET: dict[str, Any] = {
    "kind": "sheet",
    "size": (0.2, 0.2),
    "divisions": (8, 8),
    "density": 0.2,
    "stretch": 1e4,
    "thickness": 0.01,
    "self_contact": False,
}


def test_a_sheet_slides_by_the_mean_of_its_particles() -> None:
    """Each particle presses with its own weight: a stiff sheet slides with g (sin - mu sum f m / sum m cos).

    As it slides it turns a little and trembles, and not all friction points back: 0.5 % of mu.
    """
    body = {**SHEET, "position": (0.0, 0.0, 0.005), "friction_field": {"spread": 0.4, "length": 0.05, "seed": 1}}
    still = ParticleRun(particle_scene(body)).body
    mean = float(still.friction_field.factor(still.x_rest) @ still.mass) / still.total_mass
    slope = np.arctan(1.2 * MU * mean)
    gravity = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    tools = {"ground": {"kind": "plane", "friction": MU}}
    run = ParticleRun(particle_scene(body, gravity=gravity, tools=tools, pbd={"substeps": 40}))
    run.run(0.2)
    moved = float((run.body.mass @ (run.x - run.body.x_rest))[0]) / run.body.total_mass
    pull = 2.0 * moved / (0.2 * (0.2 + 0.01 / 40))
    assert mean > 1.1
    assert (np.tan(slope) - pull / (G * np.cos(slope))) == pytest.approx(MU * mean, rel=5e-3)
