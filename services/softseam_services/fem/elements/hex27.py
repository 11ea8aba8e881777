"""Quadratic hexahedron, mu/2 I1 with 3^3 Gauss points and the rest with 2^3: no locking, no spurious modes."""

from softseam_protocol.scene.kinds import ElementKind
from softseam_services.body.body import Floats

from .hexahedra import quadratic
from .table import Table, split

SHARES: dict[ElementKind, float] = {"hex27": 1.0, "hex27_reduced": 2.0 / 3.0}
"""how much of mu/2 I1 that 3^3 points see and 2^3 do not an element takes up: the ones that kernels/cells.py knows"""


def build(x: Floats, poisson: float, share: float = SHARES["hex27"]) -> Table:
    """x (t, 27, 3) [m]."""
    table = split(quadratic(3), quadratic(2), x)
    return table._replace(stabilisation=share * table.stabilisation)
