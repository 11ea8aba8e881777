"""Quadratic hexahedron, mu/2 I1 with 3^3 Gauss points and the rest with 2^3: no locking, no spurious modes."""

from __future__ import annotations

from softseam_services.body.body import Floats
from softseam_services.fem.elements.hexahedra import quadratic
from softseam_services.fem.elements.table import Table, split


def build(x: Floats, poisson: float) -> Table:
    """x (t, 27, 3) [m]."""
    return split(quadratic(3), quadratic(2), x)
