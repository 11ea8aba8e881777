"""Six quadratic tetrahedra a cell with four points each."""

from softseam_services.body.body import Floats

from . import table
from .tetrahedra import quadratic


def build(x: Floats, poisson: float) -> table.Table:
    """x (t, 27, 3) [m]."""
    return table.corrected(quadratic(fine=True), quadratic(), x)
