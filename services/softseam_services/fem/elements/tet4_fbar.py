"""48 linear tetrahedra a cell with one volume ratio an octant: F-bar-Patch.

de Souza Neto, Andrade Pires & Owen (Int. J. Numer. Meth. Eng. 62, 2005, eq. 12) with the six tetrahedra of an octant as
the patch, here in the form of an energy, so that the tangent is symmetric. It cures volumetric locking; in bending it
stays as stiff as linear tetrahedra are.
"""

from softseam_services.body.body import Floats
from softseam_services.body.lattice import OCTANT_NODES

from . import table
from .tetrahedra import linear


def build(x: Floats, poisson: float) -> table.Table:
    """x (t, 27, 3) [m]."""
    return table.grouped(table.full(linear(), x), OCTANT_NODES)
