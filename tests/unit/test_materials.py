"""Materials: derivatives against finite differences, objectivity, small strains, the continuation below J_MIN."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from softseam_protocol.scene import MaterialSpec
from softseam_services.body.materials import MATERIALS, build_material, linear, neo_hookean

MU, LAM = 6.9e3, 62.1e3  # E 20 kPa, nu 0.45
PRINCIPAL = [(0.3, 1.2, 1.1), (0.6, 0.9, 1.4), (1.0, 1.0, 1.0), (1.7, 0.8, 1.0), (3.0, 0.6, 0.7), (3.0, 3.0, 3.0)]


def rotation(seed: int) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def deformations() -> list[np.ndarray]:
    return [rotation(2 * i) @ np.diag(s) @ rotation(2 * i + 1) for i, s in enumerate(PRINCIPAL)]


def test_every_kind_of_the_scene_has_a_row() -> None:
    assert set(MATERIALS) == set(get_args(MaterialSpec.model_fields["kind"].annotation))


def test_lame_constants_give_back_the_engineering_ones() -> None:
    material = build_material(MaterialSpec(young=20e3, poisson=0.45, density=1050))
    assert material.young == pytest.approx(20e3, rel=1e-14)
    assert material.lambda_ / (2 * (material.lambda_ + material.mu)) == pytest.approx(0.45, rel=1e-14)
    # P-wave modulus E (1 - nu) / ((1 + nu)(1 - 2 nu))
    assert material.wave_speed**2 * 1050 == pytest.approx(20e3 * 0.55 / (1.45 * 0.10), rel=1e-14)


@pytest.mark.parametrize("kind", sorted(MATERIALS))
@pytest.mark.parametrize("number", range(len(PRINCIPAL)))
def test_stress_and_tangent_are_derivatives(kind: str, number: int) -> None:
    """Central differences, step 1e-6: error about h^2 f''' + 1e-16/h, so 1e-8 of the largest entry is safe."""
    law, F, h = MATERIALS[kind], deformations()[number], 1e-6
    P, A = law.stress(F, MU, LAM), law.tangent(F, MU, LAM)
    P_fd, A_fd = np.empty((3, 3)), np.empty((3, 3, 3, 3))
    for k in range(3):
        for n in range(3):
            d = np.zeros((3, 3))
            d[k, n] = h
            P_fd[k, n] = (law.energy(F + d, MU, LAM) - law.energy(F - d, MU, LAM)) / (2 * h)
            A_fd[:, :, k, n] = (law.stress(F + d, MU, LAM) - law.stress(F - d, MU, LAM)) / (2 * h)
    np.testing.assert_allclose(P, P_fd, atol=1e-8 * np.abs(A).max())
    np.testing.assert_allclose(A, A_fd, atol=1e-8 * np.abs(A).max())
    np.testing.assert_allclose(A, A.transpose(2, 3, 0, 1), atol=1e-12 * np.abs(A).max())


@pytest.mark.parametrize("number", range(len(PRINCIPAL)))
def test_neo_hookean_is_objective_and_isotropic(number: int) -> None:
    F, Q = deformations()[number], rotation(99)
    psi = neo_hookean.energy(F, MU, LAM)
    assert neo_hookean.energy(Q @ F, MU, LAM) == pytest.approx(psi, rel=1e-11, abs=1e-9)
    assert neo_hookean.energy(F @ Q, MU, LAM) == pytest.approx(psi, rel=1e-11, abs=1e-9)
    P = neo_hookean.stress(F, MU, LAM)
    np.testing.assert_allclose(neo_hookean.stress(Q @ F, MU, LAM), Q @ P, rtol=0, atol=1e-10 * np.abs(P).max() + 1e-7)
    sigma = neo_hookean.cauchy(F, MU, LAM)
    np.testing.assert_allclose(sigma, P @ F.T / np.linalg.det(F), atol=1e-10 * np.abs(P).max() + 1e-7)
    np.testing.assert_allclose(sigma, sigma.T, atol=1e-10 * np.abs(P).max() + 1e-7)


def test_rest_is_free_of_energy_and_stress() -> None:
    for law in MATERIALS.values():
        assert law.energy(np.eye(3), MU, LAM) == pytest.approx(0.0, abs=1e-10)
        np.testing.assert_allclose(law.stress(np.eye(3), MU, LAM), 0.0, atol=1e-10)


def test_small_strain_limit_is_hooke_with_rate_two() -> None:
    """neo-Hookean energy minus Hooke's is third order in the strain: halving the strain divides it by 8."""
    H = np.random.default_rng(5).normal(size=(3, 3))
    H = 0.5 * (H + H.T)
    scales = 2.0 ** -np.arange(4, 9)
    gaps = []
    for scale in scales:
        F = np.eye(3) + scale * H
        gaps.append(np.abs(neo_hookean.stress(F, MU, LAM) - linear.stress(F, MU, LAM)).max())
    slope = np.polyfit(np.log(scales), np.log(gaps), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.1)
    np.testing.assert_allclose(neo_hookean.tangent(np.eye(3), MU, LAM), linear.tangent(np.eye(3), MU, LAM), atol=1e-9)


def test_uniaxial_stress_of_hooke() -> None:
    """sigma = E eps with free sides."""
    material = build_material(MaterialSpec(kind="linear", young=20e3, poisson=0.3, density=1000))
    F = np.diag([1.001, 1 - 0.3e-3, 1 - 0.3e-3])
    np.testing.assert_allclose(linear.stress(F, material.mu, material.lambda_), np.diag([20.0, 0, 0]), atol=1e-9)


def test_uniaxial_stress_of_neo_hookean_closed_form() -> None:
    """Nominal stress of a bar: mu (a - b^2/a) with mu (b^2 - 1) + lambda ln(a b^2) = 0 on the free sides."""
    a = 0.85
    low, high = 0.9, 1.3
    for _ in range(80):  # bisection
        b = 0.5 * (low + high)
        low, high = (b, high) if MU * (b * b - 1) + LAM * np.log(a * b * b) < 0 else (low, b)
    P = neo_hookean.stress(np.diag([a, b, b]), MU, LAM)
    np.testing.assert_allclose(P, np.diag([MU * (a - b * b / a), 0, 0]), atol=1e-8)


def test_volumetric_part_is_continued_twice_differentiably() -> None:
    """Value, slope and curvature agree from both sides of J_MIN; the third derivative jumps."""
    below, above = (neo_hookean.volumetric(neo_hookean.J_MIN + d, MU, LAM) for d in (-1e-9, 1e-9))
    np.testing.assert_allclose(below, above, rtol=1e-7)
    for J in (-1.0, 0.0, 0.1, 0.5, 2.0):
        h = 1e-6
        upper, middle, lower = (neo_hookean.volumetric(J + d, MU, LAM) for d in (h, 0.0, -h))
        assert (upper[0] - lower[0]) / (2 * h) == pytest.approx(middle[1], rel=1e-6, abs=1e-6 * MU)
        assert (upper[1] - lower[1]) / (2 * h) == pytest.approx(middle[2], rel=1e-6)


def test_inverted_states_are_finite_and_pushed_back() -> None:
    F = np.diag([-0.5, 1.0, 1.0])
    P = neo_hookean.stress(F, MU, LAM)
    assert np.isfinite(P).all()
    assert np.isfinite(neo_hookean.energy(F, MU, LAM))
    assert P[0, 0] < 0.0  # energy falls as F_xx grows back through zero


def test_remainder_and_constant_part_sum_to_the_linear_stress() -> None:
    for F in deformations():
        np.testing.assert_allclose(
            MU * F + linear.remainder_stress(F, MU, LAM), linear.stress(F, MU, LAM), rtol=1e-12, atol=1e-8
        )
