"""Eight linear hexahedra a cell, everything at the middle, and an hourglass stiffness.

Uniform gradient b and hourglass vectors gamma_m = h_m - b (h_m . x) of Flanagan & Belytschko (Int. J. Numer. Meth.
Eng. 17, 1981, eqs. 16, 39), h the four patterns of signs orthogonal to linear fields of a cube:
  S = c V |b|^2 sum_m gamma_m gamma_m^T,  c = 1/(36 (1 - nu))                                                    (1)
On a cube of edge l, where V |b|^2 = 3 l/2, that is the stiffness in bending of a plate, E/(1 - nu^2) (l/2)^3 ... of the
material itself; `COEFFICIENT` = 0 leaves an element with 12 modes that cost nothing.
"""

import numpy as np

from softseam_services.body.body import Floats

from .hexahedra import SIGNS, linear
from .table import Table, split

COEFFICIENT = 1.0 / 36.0
_HOURGLASS = np.stack(
    [SIGNS[:, 1] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 1], SIGNS.prod(axis=1)]
)


def build(x: Floats, poisson: float, coefficient: float = COEFFICIENT) -> Table:
    """x (t, 27, 3) [m]."""
    table = split(linear(2), linear(1), x)
    b, volume = table.gradient[:, :, 0], table.weight[:, :, 0]
    gamma = _HOURGLASS - np.einsum("tbin,hm,tbmi->tbhn", b, _HOURGLASS, x[:, table.nodes], optimize=True)
    size = coefficient / (1.0 - poisson) * volume * np.einsum("tbim,tbim->tb", b, b)
    return table._replace(stabilisation=np.einsum("tb,tbhm,tbhn->tbmn", size, gamma, gamma, optimize=True))
