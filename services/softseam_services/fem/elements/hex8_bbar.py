"""Eight linear hexahedra a cell with 2^3 Gauss points and one volume ratio each: no volumetric locking.

In small strains this is B-bar (Hughes, Int. J. Numer. Meth. Eng. 15, 1980), in large ones the mean dilatation of
Nagtegaal, Parks & Rice (Comput. Meth. Appl. Mech. Eng. 4, 1974) in the form of an energy of F-bar; it still is too
stiff in bending.
"""

from softseam_services.body.body import Floats
from softseam_services.body.lattice import OCTANT_NODES

from . import table
from .hexahedra import linear


def build(x: Floats, poisson: float) -> table.Table:
    """x (t, 27, 3) [m]."""
    return table.grouped(table.full(linear(2), x), OCTANT_NODES)
