"""Elastic constants of an isotropic solid, converted between the pairs that books and tables give."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class ElasticConstants:
    """Lame's pair; everything else follows. Stable where mu > 0 and lambda > -2/3 mu, so -1 < nu < 1/2."""

    mu: float
    """shear modulus G [Pa]"""
    lambda_: float
    """first Lame constant [Pa]"""

    @classmethod
    def from_young_poisson(cls, young: float, poisson: float) -> ElasticConstants:
        """mu = E/(2(1 + nu)), lambda = E nu/((1 + nu)(1 - 2 nu)); E [Pa]."""
        return cls(young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)))

    @property
    def young(self) -> float:
        """Young's modulus E = mu (3 lambda + 2 mu)/(lambda + mu) [Pa]."""
        return self.mu * (3.0 * self.lambda_ + 2.0 * self.mu) / (self.lambda_ + self.mu)

    @property
    def poisson(self) -> float:
        """Poisson's ratio nu = lambda/(2 (lambda + mu)) [1]."""
        return self.lambda_ / (2.0 * (self.lambda_ + self.mu))

    @property
    def bulk(self) -> float:
        """Bulk modulus K = lambda + 2/3 mu [Pa]."""
        return self.lambda_ + 2.0 / 3.0 * self.mu

    @property
    def shear(self) -> float:
        """Shear modulus G = mu [Pa]."""
        return self.mu

    @property
    def p_wave(self) -> float:
        """P-wave modulus lambda + 2 mu [Pa]: stress over strain where the sides are held."""
        return self.lambda_ + 2.0 * self.mu

    def relaxed(self, share: float) -> ElasticConstants:
        """What is left where this share of mu has faded, and nothing of the bulk modulus."""
        if share == 0.0:
            return self
        mu = self.mu * max(0.0, 1.0 - share)
        return ElasticConstants(mu, self.bulk - 2.0 / 3.0 * mu)

    def pressure_speed(self, density: float) -> float:
        """c_p = sqrt((lambda + 2 mu)/rho) [m/s]; density [kg/m^3]."""
        return math.sqrt(self.p_wave / density)

    def shear_speed(self, density: float) -> float:
        """c_s = sqrt(mu/rho) [m/s]; density [kg/m^3]."""
        return math.sqrt(self.mu / density)
