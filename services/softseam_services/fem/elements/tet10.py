"""Six quadratic tetrahedra a cell with four points each."""

from softseam_services.body.body import Floats
from softseam_services.fem.elements import table
from softseam_services.fem.elements.tetrahedra import quadratic


def build(x: Floats, poisson: float) -> table.Table:
    """x (t, 27, 3) [m]."""
    return table.corrected(quadratic(fine=True), quadratic(), x)
