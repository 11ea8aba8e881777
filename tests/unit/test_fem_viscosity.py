"""A step's viscous forces alone: their limits, balance, power and derivative, for every kind of element and law."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from element_statics import Floats, Statics, lattice

from softseam_protocol.scene.kinds import ElementKind

pytestmark = pytest.mark.kernels

TIME, DT = 0.5, 0.01
KINDS: list[tuple[str, ElementKind]] = [
    ("neo_hookean", "hex27"),
    ("neo_hookean", "hex27_reduced"),
    ("corotated", "hex27"),
    ("neo_hookean", "hex8_bbar"),
    ("neo_hookean", "hex8_reduced"),
    ("neo_hookean", "tet10"),
    ("linear", "hex27"),
    ("linear", "hex8_bbar"),
]
OBJECTIVE = [pair for pair in KINDS if pair[0] != "linear"]


def bodies(kind: str, element: ElementKind, slant: float = 0.0) -> Statics:
    """Two cells, 3 by 3 by 6 cm, boxes or slanting."""
    shift = (lambda x: slant * x[:, [2, 0, 0]] * x[:, [0, 2, 1]] / 0.03) if slant else None
    body = lattice((0.03, 0.03, 0.06), (1, 1, 2), shift, kind=kind, poisson=0.4)
    material = dataclasses.replace(body.material, retardation_time=TIME)
    return Statics(dataclasses.replace(body, materials=(material,)), element)


def squeezed(statics: Statics, size: float = 0.02) -> Floats:
    """Held at 60 % of its height, uneven by some per cent of a cell's edge."""
    noise = np.random.default_rng(2).uniform(-1.0, 1.0, statics.x_rest.shape)
    return statics.x_rest * (1.2, 1.2, 0.6) + 0.03 * size * noise


def moved(statics: Statics, size: float, seed: int) -> Floats:
    """A smooth motion of gradients up to about `size`, with a finer one on top."""
    random = np.random.default_rng(seed)
    x = statics.x_rest
    smooth = size * x @ random.uniform(-1.0, 1.0, (3, 3))
    return np.asarray(smooth + 0.1 * size * 0.03 * random.uniform(-1.0, 1.0, x.shape))


@pytest.mark.parametrize("slant", [0.0, 0.1])
@pytest.mark.parametrize(("kind", "element"), KINDS)
def test_small_strains_are_resisted_by_tau_times_stiffness(kind: str, element: ElementKind, slant: float) -> None:
    """c times the elastic forces, c = tau'/dt and tau' = tau - dt; what is left falls with the strain.

    Of the linear law nothing is left, nor of neo-Hooke's from rest.
    """
    statics = bodies(kind, element, slant)
    x0, motion = statics.x_rest, moved(statics, 1.0, 3)
    c = statics.start(x0, DT)
    assert c == pytest.approx((TIME - DT) / DT)
    off = []
    for size in (1e-4, 1e-5):
        wanted = c * statics.forces(x0 + size * motion)
        off.append(np.abs(statics.viscous_forces(x0, x0 + size * motion) - wanted).max() / np.abs(wanted).max())
    assert off[0] < 3e-3 and off[1] < max(1e-8, 0.12 * off[0])


@pytest.mark.parametrize(("kind", "element"), OBJECTIVE)
def test_a_turn_of_a_squeezed_body_is_free(kind: str, element: ElementKind) -> None:
    """By 1 rad in a step, and a shift: no force; and none without a motion."""
    statics = bodies(kind, element)
    x0 = squeezed(statics)
    c = statics.start(x0, DT)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    W = np.cross(np.eye(3), -axis)
    turn = np.eye(3) + np.sin(1.0) * W + (1.0 - np.cos(1.0)) * W @ W
    scale = c * np.abs(statics.forces(x0)).max()
    for x in (x0, x0 @ turn.T + (0.3, -0.2, 0.1)):
        assert np.abs(statics.viscous_forces(x0, x)).max() < 1e-11 * scale


@pytest.mark.parametrize(("kind", "element"), KINDS)
@pytest.mark.parametrize("size", [1e-3, 0.1, 0.3])
def test_every_motion_loses_and_momenta_balance(kind: str, element: ElementKind, size: float) -> None:
    """From a squeezed and uneven state: power below zero, no sum of forces, no moment about the origin."""
    statics = bodies(kind, element)
    x0 = squeezed(statics)
    statics.start(x0, DT)
    for seed in range(20):
        x = x0 + moved(statics, size, seed)
        force = statics.viscous_forces(x0, x)
        assert np.sum(force * (x - x0)) > 0.0
        assert np.abs(force.sum(axis=0)).max() < 1e-10 * np.abs(force).sum()
        if kind != "linear":
            assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-10 * np.abs(force).sum() * 0.06


@pytest.mark.parametrize(("kind", "element"), KINDS)
def test_the_stiffness_is_the_forces_derivative_and_can_be_made_definite(kind: str, element: ElementKind) -> None:
    """By central differences of a random direction; the definite one has no negative eigenvalue, and is close by."""
    statics = bodies(kind, element)
    x0 = squeezed(statics)
    c = statics.start(x0, DT)
    x, direction = x0 + moved(statics, 0.2, 1), moved(statics, 1.0, 7)
    found = (statics.viscous_stiffness(x0, x) @ direction.ravel()).reshape(-1, 3)
    h = 1e-6
    wanted = (statics.viscous_forces(x0, x + h * direction) - statics.viscous_forces(x0, x - h * direction)) / (2.0 * h)
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())
    K = statics.viscous_stiffness(x0, x, definite=True).toarray()
    assert np.linalg.eigvalsh(K)[0] > -1e-9 * c * np.abs(K).max() / c
    near = statics.viscous_stiffness(x0, x0)
    if "bbar" not in element:  # whose points count less than nothing alone, which makes up for what the group counts
        difference = abs(statics.viscous_stiffness(x0, x0, definite=True) - near).max()
        assert difference < 1e-8 * abs(near).max()


@pytest.mark.parametrize(("kind", "element"), KINDS)
@pytest.mark.parametrize("flat", [-1.0, -0.1, 0.0, 0.1])
def test_a_step_that_begins_flat_or_mirrored_is_not_pulled(kind: str, element: ElementKind, flat: float) -> None:
    """One of two cells uneven, at a tenth of its height or none, or turned over: no force without a motion."""
    statics = bodies(kind, element)
    c, z = statics.start(statics.x_rest, DT), statics.x_rest[:, 2]
    scale = c * np.abs(statics.forces(squeezed(statics))).max()
    x0 = squeezed(statics) / (1.2, 1.2, 0.6)
    x0[:, 2] += (flat - 1.0) * np.minimum(z, 0.03)
    statics.start(x0, DT)
    assert np.abs(statics.viscous_forces(x0, x0)).max() < 1e-11 * scale


def test_the_stiffness_is_exact_beside_a_point_that_begins_flat() -> None:
    """A corner pushed in until its point is below a fifth of its volume, its group above: by central differences."""
    statics = bodies("neo_hookean", "hex8_bbar")
    x0 = squeezed(statics, 0.005)
    corner, inner = (
        int(np.argmin(np.abs(statics.x_rest - place).sum(axis=1)))
        for place in ((0.03, 0.03, 0.06), (0.015, 0.015, 0.045))
    )
    x0[corner] += 0.7 * (x0[inner] - x0[corner])
    statics.start(x0, DT)
    volume = statics.work.volume[1].reshape(8, 8)
    assert volume[7].min() < 0.0 and 0.2 < volume[7].mean() < 0.6
    direction, h = moved(statics, 1.0, 7), 1e-6
    for x in (x0 + moved(statics, 0.2, 1), 1.5 * x0):  # the second is where a mean ratio's curvature is negative
        found = (statics.viscous_stiffness(x0, x) @ direction.ravel()).reshape(-1, 3)
        upper, lower = (statics.viscous_forces(x0, x + way * direction) for way in (h, -h))
        wanted = (upper - lower) / (2.0 * h)
        np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())
        K = statics.viscous_stiffness(x0, x, definite=True).toarray()
        assert np.linalg.eigvalsh(K)[0] > -1e-9 * np.abs(K).max()


@pytest.mark.parametrize(("kind", "element"), OBJECTIVE)
def test_stretch_at_a_constant_rate(kind: str, element: ElementKind) -> None:
    """Laterally held at 60 %, squeezed on at 3 1/s: tau (2 mu + lambda) v/l^2 of the area, with the order of the step.

    Each step gives c (mu (r - 1/r) + lambda ln(r)/r)/l0, with r = l1/l0, exactly.
    """
    statics = bodies(kind, element)
    material, rate, start = statics.body.material, -3.0, 0.6
    area, top = 0.03 * 0.03, statics.x_rest[:, 2] > 0.06 - 1e-9
    off = []
    for dt in (1e-3, 5e-4):
        c = statics.start(statics.x_rest * (1.0, 1.0, start), dt)
        end = start + dt * rate
        found = statics.viscous_forces(statics.x_rest * (1.0, 1.0, start), statics.x_rest * (1.0, 1.0, end))[
            top, 2
        ].sum()
        r = end / start
        step = c * (material.mu * (r - 1.0 / r) + material.lambda_ * np.log(r) / r) / start
        assert found == pytest.approx(area * step, rel=1e-9)
        closed = (TIME - dt) * (2.0 * material.mu + material.lambda_) * rate / end**2
        off.append(found / (area * closed) - 1.0)
    assert abs(off[0]) < 1e-2 and off[1] / off[0] == pytest.approx(0.5, abs=0.05)
