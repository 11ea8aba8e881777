"""A particle constraint from outside: tethers, by which particles stay as near to where the body is clamped as at rest.

C = |x - a| - (1 + slack) L <= 0, one-sided ("long range attachments", Kim et al., SCA 2012, with compliance).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, Literal

import numpy as np
import pytest
from particle_run import G, ParticleRun, particle_scene
from pydantic import Field

import softseam
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.particles import CONSTRAINTS as SAID
from softseam_protocol.scene.particles import ConstraintSpec
from softseam_protocol.scene.spec import NonNegative, Positive
from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.particles.constraints import CONSTRAINTS, Constraint, Joins


class Tethers(ConstraintSpec):
    kind: Literal["tethers"] = "tethers"
    stiffness: Positive = Field(description="[N/m]")
    slack: NonNegative = Field(default=0.0, description="strain at which they pull [1]")


def joins(spec: Tethers, body: ParticleBody) -> Joins:
    """Each free particle with the nearest clamped one, or with the first where none is clamped."""
    fixed = np.flatnonzero(body.fixed) if body.fixed.any() else np.array([0])
    free = np.setdiff1d(np.arange(body.n_nodes), fixed)
    away = np.linalg.norm(body.x_rest[free, None] - body.x_rest[fixed], axis=2)
    ends = np.stack([free, fixed[away.argmin(axis=1)]], axis=1)
    longest = (1.0 + spec.slack) * away.min(axis=1)
    return Joins(ends, longest[:, None], np.full(len(ends), 1.0 / spec.stiffness))


def value(x, parameters, gradient):  # type: ignore[no-untyped-def]
    dx, dy, dz = x[0, 0] - x[1, 0], x[0, 1] - x[1, 1], x[0, 2] - x[1, 2]
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    gradient[0, 0], gradient[0, 1], gradient[0, 2] = dx / length, dy / length, dz / length
    gradient[1, 0], gradient[1, 1], gradient[1, 2] = -dx / length, -dy / length, -dz / length
    return length - parameters[0]


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    SAID.add("tethers", Tethers)
    CONSTRAINTS.add("tethers", Constraint(joins, value, one_sided=True))
    yield
    SAID.remove("tethers")
    CONSTRAINTS.remove("tethers")


LENGTH, LINKS, STRETCH, DENSITY, PULL = 0.5, 5, 2.0, 0.1, 3.0
ROPE = {
    "kind": "rope",
    "length": LENGTH,
    "divisions": LINKS,
    "density": DENSITY,
    "stretch": STRETCH,
    "rotation": (0.0, np.pi / 2, 0.0),  # hangs along z, its first end uppermost
    "damping": 20.0,
    "fixed": [{"min": (-1.0, -1.0, 0.249), "max": (1.0, 1.0, 1.0)}],
}
TETHERS = {"kind": "tethers", "stiffness": PULL}
PBD = {"substeps": 20, "sweeps": 40}


def hung(seconds: float = 4.0, **changes: Any) -> ParticleRun:
    run = ParticleRun(particle_scene({**ROPE, **changes}, gravity=(0.0, 0.0, -G), pbd=PBD))
    run.run(seconds)
    return run


def sunk(pull: float) -> np.ndarray:
    """How far the free particles of the hanging rope sink [m], each on a tether of this stiffness [N/m]."""
    k, m = STRETCH * LINKS / LENGTH, np.full(LINKS, DENSITY * LENGTH / LINKS)
    m[-1] *= 0.5
    stiffness = np.diag(np.r_[np.full(LINKS - 1, 2.0 * k), k] + pull)
    stiffness -= k * (np.eye(LINKS, k=1) + np.eye(LINKS, k=-1))
    return np.asarray(np.linalg.solve(stiffness, m * G))


def test_a_constraint_from_outside_carries_its_share() -> None:
    """A rope that hangs by its end, springs and tethers side by side: places and energy of the linear equations."""
    run = hung(constraints=[TETHERS])
    below = (run.body.x_rest - run.x)[1:, 2]
    np.testing.assert_allclose(below, sunk(PULL), rtol=1e-9)
    assert sunk(0.0)[-1] > 1.2 * below[-1]
    k, between = STRETCH * LINKS / LENGTH, np.diff(below, prepend=0.0)
    assert run.solver.strain == pytest.approx(0.5 * k * (between**2).sum() + 0.5 * PULL * (below**2).sum(), rel=1e-6)


def test_a_one_sided_constraint_lets_go() -> None:
    """Tethers longer than the rope ever gets, and a rope without them: the same to the last bit."""
    slack, without = hung(0.5, constraints=[TETHERS | {"slack": 1.0}]), hung(0.5)
    np.testing.assert_array_equal(slack.x, without.x)
    assert not np.array_equal(hung(0.5, constraints=[TETHERS]).x, without.x)


def test_a_gripper_feels_what_a_constraint_from_outside_carries() -> None:
    """A rope that hangs from a gripper at its first end weighs m g, most of which the tethers carry."""
    rope = ROPE | {"fixed": [], "constraints": [TETHERS | {"stiffness": 1e3}], "radius": 0.005}
    hand = {"hand": {"kind": "sphere", "radius": 0.01, "position": (0.0, 0.0, 0.265)}}
    run = ParticleRun(particle_scene(rope, gravity=(0.0, 0.0, -G), tools=hand, pbd=PBD))
    run.gripping[0] = 1
    for _ in range(300):
        reply = run.step()
    assert reply.extras["held"] == 1
    assert reply.wrench[0, 2] == pytest.approx(-DENSITY * LENGTH * G, rel=1e-6)


def test_what_a_scene_says_of_constraints_is_checked() -> None:
    scene = particle_scene(ROPE | {"constraints": [TETHERS]})
    assert parse_scene(scene.model_dump_json(), "scene") == scene
    for wrong, right, key, words in (
        ('"tethers"', '"tether"', "body.constraints.0.kind", "did you mean 'tethers'"),
        ('"slack"', '"slak"', "body.constraints.0.slak", "unknown key"),
        ('"method":"xpbd"', '"method":"pbd"', "models.pbd.method", "constraints need xpbd"),
    ):
        with pytest.raises(SceneError, match=words) as caught:
            parse_scene(scene.model_dump_json().replace(wrong, right), "scene")
        assert caught.value.key == key


def test_a_kind_without_a_constraint_fails_at_start() -> None:
    SAID.add("forgotten", Tethers)
    try:
        with pytest.raises(softseam.BadInput, match="table of particle constraints: no row 'forgotten'"):
            softseam.open(particle_scene(ROPE))
    finally:
        SAID.remove("forgotten")


def test_a_row_that_does_not_fit_is_told_of() -> None:
    """It joins a particle with itself, one that there is not, or has parameters for others."""
    ends, one = np.array([[0, 1]]), np.ones(1)
    for joined, words in (
        (Joins(np.array([[1, 1]]), np.ones((1, 1)), one), "with itself"),
        (Joins(np.array([[0, 99]]), np.ones((1, 1)), one), "there are 6"),
        (Joins(ends, np.ones((2, 1)), one), r"\(m, k\), \(m, n\) and \(m,\) are taken"),
        (Joins(ends, np.ones((1, 1)), -one), "a compliance below 0"),
    ):
        CONSTRAINTS.remove("tethers")
        CONSTRAINTS.add("tethers", Constraint(partial(_given, joined), value))
        with pytest.raises(softseam.SceneRefused, match=words):
            softseam.open(particle_scene(ROPE | {"constraints": [TETHERS]}))


def _given(joined: Joins, spec: Any, body: Any) -> Joins:
    return joined
