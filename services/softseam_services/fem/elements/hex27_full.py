"""Quadratic hexahedron with 3^3 Gauss points: definite at any strain that the material bears; locks for nu > 0.49."""

from softseam_services.body.body import Floats

from . import table
from .hexahedra import quadratic


def build(x: Floats, poisson: float) -> table.Table:
    """x (t, 27, 3) [m]."""
    return table.full(quadratic(3), x)
