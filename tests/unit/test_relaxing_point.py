"""Branches that relax, at a point: derivatives, invariants, closed forms and an ordinary differential equation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from relaxing import ALL, BULK, CASES, MU, POISSON, TWO, YOUNG, Floats, Point

from softseam_services.body.elastic_constants import ElasticConstants

pytestmark = pytest.mark.kernels


def some(seed: int, size: float) -> Floats:
    return np.eye(3) + size * np.random.default_rng(seed).normal(size=(3, 3))


def begun(branches: Sequence[tuple[float, float]], kind: str = "neo_hookean", **own: Any) -> Point:
    """Somewhere on its way."""
    point = Point(branches, kind, **own)
    for seed in range(3):
        point.go(some(seed, 0.15), 0.05)
    return point


@pytest.mark.parametrize("kind", ["neo_hookean", "mooney_rivlin", "corotated"])
@pytest.mark.parametrize("dt", [1e-3, 0.05, 5.0])
def test_the_tangent_is_the_derivative_of_the_stress_and_symmetric(kind: str, dt: float) -> None:
    """Central differences, h = 1e-6: rounding 1e-16/h, truncation h^2 of terms up to 1e3 A: 1e-9 both."""
    point = begun(TWO, kind, **({"ratio": 0.3} if kind == "mooney_rivlin" else {}))
    for seed in (3, 4):
        F = some(seed, 0.2)
        A, of_differences, h = point.respond(F, dt)[3], np.empty((9, 9)), 1e-6
        for m in range(9):
            d = np.zeros((3, 3))
            d.flat[m] = h
            of_differences[:, m] = ((point.respond(F + d, dt)[2] - point.respond(F - d, dt)[2]) / (2.0 * h)).ravel()
        scale = np.abs(A).max()
        np.testing.assert_allclose(A, of_differences, atol=1e-7 * scale)
        np.testing.assert_allclose(A, A.T, atol=1e-12 * scale)
        assert np.linalg.eigvalsh(point.respond(F, dt, True)[3]).min() > -1e-9 * scale


def test_a_turn_changes_nothing() -> None:
    """Of the body, however fast: the state is of the frame at rest."""
    point, turned = begun(TWO), begun(TWO)
    for seed in range(5):
        F = some(10 + seed, 0.1)
        Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
        Q *= np.sign(np.linalg.det(Q))
        P, T = point.go(F, 0.02), turned.go(Q @ F, 0.02)
        np.testing.assert_allclose(T, Q @ P, atol=1e-10 * MU)
        np.testing.assert_allclose(turned.state, point.state, atol=1e-12)
    assert turned.dissipated == pytest.approx(point.dissipated, rel=1e-10)


def test_nothing_changes_where_the_state_is_looked_at() -> None:
    point = begun(TWO)
    before, stored = point.state.copy(), point.stored
    point.go(some(2, 0.15), 0.0)
    np.testing.assert_array_equal(point.state, before)
    assert point.stored == pytest.approx(stored, rel=1e-12)


@pytest.mark.parametrize("dt", [1e-4, 1e-2, 1.0])
def test_small_strains_follow_the_prony_series(dt: float) -> None:
    """Sheared by 1e-6 in one step, then held: G(t) = G (g_inf + sum g m e^-(t - dt)/tau), exact of a straight way."""
    point, shear = Point(TWO), np.eye(3)
    shear[0, 1] = 1e-6
    for n in range(20):
        stress = point.go(shear, dt)[0, 1] / (1e-6 * MU)
        fades = sum(g * t / dt * -np.expm1(-dt / t) * np.exp(-n * dt / t) for g, t in TWO)
        assert stress == pytest.approx(0.25 + fades, abs=1e-6)


def test_what_is_held_loses_what_it_stored() -> None:
    """Stored + dissipated stays as it is, whatever the step, as does the stress where strain is held for long."""
    for dt in (1e-3, 0.05, 3.0):
        point, shear = Point(TWO), np.eye(3)
        shear[0, 1] = 1e-3
        point.go(shear, 1e-9)
        before = point.stored + point.dissipated
        for _ in range(50):
            point.go(shear, dt)
            assert point.stored + point.dissipated == pytest.approx(before, rel=1e-6)


@pytest.mark.parametrize(("dt", "within"), [(1e-3, 1e-4), (0.01, 1e-4), (0.1, 5e-3)])
def test_a_bar_creeps_as_the_standard_linear_solid(dt: float, within: float) -> None:
    """Under a small stress that comes at once, within a step, so in its middle: strain is stress (1/(9 K) + J(t)/3),
    J = (1 + g/(1 - g) (1 - e^-(1 - g) t/tau))/G."""
    share, tau, stress = 0.6, 0.2, 1e-4 * MU
    point = Point([(share, tau)])
    for n in range(int(2.0 / dt)):
        stretch, time = point.carry(stress, dt), (n + 0.5) * dt
        compliance = (1.0 + share / (1.0 - share) * -np.expm1(-(1.0 - share) * time / tau)) / MU
        assert stretch - 1.0 == pytest.approx(stress * (1.0 / (9.0 * BULK) + compliance / 3.0), rel=within)


@pytest.mark.parametrize("omega", [0.3, 3.0, 12.0, 60.0])
def test_the_loss_tangent_over_frequency(omega: float) -> None:
    """Small oscillations lose pi G'' gamma^2 a period, and tan delta is G''/G', in a hundred steps a period."""
    steps, size = 100, 1e-4
    point, dt, tau = Point(TWO), 2.0 * np.pi / omega / steps, np.array(TWO)[:, 1]
    x, g = omega * tau, np.array(TWO)[:, 0]
    storage, loss = MU * (0.25 + np.sum(g * x**2 / (1 + x**2))), MU * np.sum(g * x / (1 + x**2))
    stress: list[float] = []
    lost = 0.0
    periods = 2 + int(np.ceil(8.0 * tau.max() * omega / (2.0 * np.pi)))
    for n in range(periods * steps):
        if n == (periods - 1) * steps:
            stress, lost = [], point.dissipated
        shear = np.eye(3)
        shear[0, 1] = size * np.sin(omega * (n + 1) * dt)
        stress.append(point.go(shear, dt)[0, 1])
    phase = omega * dt * (1 + np.arange(steps))
    along, across = 2.0 * np.mean(stress * np.sin(phase)), 2.0 * np.mean(stress * np.cos(phase))
    assert across / along == pytest.approx(loss / storage, rel=2e-3)
    assert point.dissipated - lost == pytest.approx(np.pi * loss * size**2, rel=2e-3)


@pytest.mark.parametrize(("dt", "within"), [(0.01, 1e-4), (0.05, 3e-4)])
def test_a_bar_that_is_squeezed_and_held(dt: float, within: float) -> None:
    """By 25 % in .4 s, and its stress until 5 s, beside the integral of eq. (1) of `relaxation`."""
    case, point, times, found = CASES["relaxation"], Point(TWO), [], []
    for n in range(1, int(5.0 / dt + 0.5) + 1):
        found.append(point.pull(1.0 - 0.25 * min(1.0, n * dt / 0.4), dt))
        times.append(n * dt)
    np.testing.assert_allclose(np.interp(case["t"], times, found), case["P"], rtol=within)


@pytest.mark.parametrize("number", range(5))
def test_a_bar_whose_modulus_fades_wholly_at_any_rate(number: int) -> None:
    """Squeezed by 20 % at .01 to 100 1/s in 200 steps, nothing lasts; beside the same integral."""
    rate, expected = CASES["rate"]["rate"][number], CASES["rate"]["P"][number]
    point = Point(ALL)
    assert point.material.lasting.mu == pytest.approx(0.0, abs=1e-9 * MU)
    stress = 0.0
    for n in range(200):
        stress = point.pull(1.0 - 0.2 * (n + 1) / 200, 0.2 / rate / 200)
    assert stress == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("dt", "within"), [(0.01, 5e-4), (0.5, 3e-3), (1.0, 0.03)])
def test_steady_shear_of_what_fades_wholly_is_that_of_a_liquid(dt: float, within: float) -> None:
    """To gamma = 5 at a rate of 1/tau: sigma_xy = .5893 mu (another integration), however long the steps."""
    point, shear, stress = Point([(1.0, 1.0)]), np.eye(3), 0.0
    for n in range(int(5.0 / dt + 0.5)):
        shear[0, 1] = (n + 1) * dt
        stress = float((point.go(shear, dt) @ shear.T)[0, 1])
    assert stress == pytest.approx(0.5893 * MU, rel=within)


def test_slow_and_quick_loads_feel_what_lasts_and_all() -> None:
    elastic = ElasticConstants.from_young_poisson(YOUNG, POISSON)
    lasting = Point(TWO).material.lasting
    assert lasting.bulk == pytest.approx(elastic.bulk, rel=1e-12)
    assert lasting.mu == pytest.approx(0.25 * elastic.mu, rel=1e-12)
    F = some(5, 0.1)
    quick, slow = Point(TWO), Point(TWO)
    quick_stress, slow_stress = quick.go(F, 1e-9), slow.go(F, 1e9)
    assert abs(slow_stress - quick_stress).max() > 0.1 * MU
    np.testing.assert_allclose(slow_stress, Point([(1e-9, 1.0)], **_constants(lasting)).go(F, 1e9), atol=1e-3 * MU)
    for one, other in pairwise([slow.go(F, 1.0) for _ in range(3)]):
        np.testing.assert_allclose(one, other, atol=1e-6 * MU)


def _constants(elastic: ElasticConstants) -> dict[str, Any]:
    return {"young": elastic.young, "poisson": elastic.poisson}
