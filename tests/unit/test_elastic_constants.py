"""Elastic constants: there and back, and the figures of a known material."""

from __future__ import annotations

import math

import pytest

from softseam_services.body.elastic_constants import ElasticConstants

PAIRS = [(20e3, 0.45), (1.0, 0.0), (210e9, 0.3), (5e4, -0.4), (1e6, 0.4999)]


@pytest.mark.parametrize(("young", "poisson"), PAIRS)
def test_conversion_there_and_back(young: float, poisson: float) -> None:
    """nu near 1/2 loses digits in 1 - 2 nu: 1e-16/(1 - 2 nu) of lambda."""
    c = ElasticConstants.from_young_poisson(young, poisson)
    assert c.young == pytest.approx(young, rel=1e-12)
    assert c.poisson == pytest.approx(poisson, rel=1e-11, abs=1e-14)


@pytest.mark.parametrize(("young", "poisson"), PAIRS)
def test_closed_forms(young: float, poisson: float) -> None:
    c = ElasticConstants.from_young_poisson(young, poisson)
    assert c.bulk == pytest.approx(young / (3 * (1 - 2 * poisson)), rel=1e-12)
    assert c.shear == pytest.approx(young / (2 * (1 + poisson)), rel=1e-14)
    # P-wave modulus E (1 - nu)/((1 + nu)(1 - 2 nu))
    assert c.p_wave == pytest.approx(young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson)), rel=1e-12)
    # the ratio of the speeds knows nothing but nu: (c_s/c_p)^2 = (1 - 2 nu)/(2 (1 - nu))
    ratio = c.shear_speed(7.0) / c.pressure_speed(7.0)
    assert ratio**2 == pytest.approx((1 - 2 * poisson) / (2 * (1 - poisson)), rel=1e-11)


def test_steel() -> None:
    """E 210 GPa, nu 0.3, 7850 kg/m^3: G 80.77 GPa, K 175 GPa, c_p 6001 m/s, c_s 3208 m/s."""
    steel = ElasticConstants.from_young_poisson(210e9, 0.3)
    assert steel.shear == pytest.approx(80.769e9, rel=1e-5)
    assert steel.bulk == pytest.approx(175e9, rel=1e-12)
    assert steel.pressure_speed(7850.0) == pytest.approx(6001.0, abs=1.0)
    assert steel.shear_speed(7850.0) == pytest.approx(math.sqrt(80.769e9 / 7850.0), rel=1e-5)
