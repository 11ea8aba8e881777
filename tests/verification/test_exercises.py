"""The textbook chapter's exercises 9.1, 9.3, 9.5 and 9.6, with its own numbers; 9.2 and 9.4 are in
test_particle_methods.py, and 9.7 is what softseam is."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_protocol.scene.materials import material_spec
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.materials import build_material, point


def test_exercise_9_1() -> None:
    """N_i = ((x_j y_k - x_k y_j) + (y_j - y_k) x + (x_k - x_j) y)/(2 A): 1 at its corner, 0 at the others, 1 in sum,
    and linear fields are reproduced."""
    corners = np.array([[0.3, 0.1], [2.0, 0.4], [0.9, 1.7]])

    def shape(at: np.ndarray) -> np.ndarray:
        doubled = np.linalg.det(np.column_stack([np.ones(3), corners]))
        found = np.empty(3)
        for i in range(3):
            (xj, yj), (xk, yk) = corners[(i + 1) % 3], corners[(i + 2) % 3]
            found[i] = ((xj * yk - xk * yj) + (yj - yk) * at[0] + (xk - xj) * at[1]) / doubled
        return found

    np.testing.assert_allclose([shape(corner) for corner in corners], np.eye(3), atol=1e-14)
    for at in np.random.default_rng(0).uniform(-1.0, 2.0, (5, 2)):
        assert shape(at).sum() == pytest.approx(1.0, abs=1e-13)
        np.testing.assert_allclose(shape(at) @ corners, at, atol=1e-13)


def test_exercise_9_3() -> None:
    """E 100 MPa, nu 0.3, 1000 kg/m^3: 38.46, 57.69 and 83.33 MPa, 367 and 196 m/s."""
    found = ElasticConstants.from_young_poisson(100e6, 0.3)
    assert found.mu == found.shear == pytest.approx(38.46e6, abs=5e3)
    assert found.lambda_ == pytest.approx(57.69e6, abs=5e3)
    assert found.bulk == pytest.approx(83.33e6, abs=5e3)
    assert found.pressure_speed(1000.0) == pytest.approx(367.0, abs=0.5)
    assert found.shear_speed(1000.0) == pytest.approx(196.0, abs=0.5)


@pytest.mark.parametrize("stretch", [0.2, 0.5, 0.999, 1.001, 2.0, 5.0])
def test_exercise_9_5(stretch: float) -> None:
    """P = mu (a - 1/a^2) of the product's law as nu approaches 1/2, its sides free; for little stretch E (a - 1), for
    much of it mu a, pressed flat -mu/a^2."""
    material = build_material(material_spec({"kind": "neo_hookean", "young": 20e3, "poisson": 0.49999, "density": 1e3}))
    mu, across = material.mu, stretch**-0.5

    def stress(across: float) -> np.ndarray:
        out = np.empty((3, 3))
        point.stress(material.number, material.parameters, np.diag([stretch, across, across]), out)
        return out

    for _ in range(30):  # Newton's method for free sides
        slope = (stress(across + 1e-7)[1, 1] - stress(across - 1e-7)[1, 1]) / 2e-7
        across -= stress(across)[1, 1] / slope
    found = stress(across)[0, 0]
    assert found == pytest.approx(mu * (stretch - stretch**-2), rel=2e-3)
    if abs(stretch - 1.0) < 0.01:
        assert found == pytest.approx(3.0 * mu * (stretch - 1.0), rel=5e-3)
    if stretch == 5.0:
        assert found == pytest.approx(mu * stretch, rel=0.01)
    if stretch == 0.2:
        assert found == pytest.approx(-mu / stretch**2, rel=0.01)


def test_exercise_9_6() -> None:
    """Cells of 10 mm, E 1 MPa, nu 0.3, 1000 kg/m^3: 36.7 m/s, and half a cell takes a wave 1.36e-4 s."""
    speed = ElasticConstants.from_young_poisson(1e6, 0.3).pressure_speed(1000.0)
    assert speed == pytest.approx(36.7, abs=0.05)
    assert 0.5 * 0.01 / speed == pytest.approx(1.36e-4, abs=5e-7)
