"""Elements of hexahedra: the cell as one quadratic hexahedron, or as eight linear ones, one an octant.

Builders take nodes of t cells x (t, 27, 3) [m] and Poisson's ratio.
"""

import numpy as np

from softseam_protocol.scene.kinds import ElementKind
from softseam_services.body.body import Floats
from softseam_services.body.kernels.shape_functions import hex27 as shape_functions
from softseam_services.body.lattice import OCTANT_NODES

from .table import Reference, Table, full, gauss, grouped, split

SIGNS = np.array([(2 * (a & 1) - 1, (a & 2) - 1, (a & 4) // 2 - 1) for a in range(8)], dtype=np.float64)
"""local coordinates of a hexahedron's corners, and of the octants' centres times 2 (8, 3)"""
SHARES: dict[ElementKind, float] = {"hex27": 1.0, "hex27_reduced": 2.0 / 3.0}
"""how much of mu/2 I1 that 3^3 points see and 2^3 do not an element takes up: the ones that kernels/cells.py knows"""
COEFFICIENT = 1.0 / 36.0
"""of eq. (1) of `hex8_reduced`"""
_HOURGLASS = np.stack(
    [SIGNS[:, 1] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 1], SIGNS.prod(axis=1)]
)


def quadratic(n: int) -> Reference:
    """One element of 27 nodes with n^3 Gauss points; a point between octants belongs to all of them alike."""
    points, weight = gauss(n)
    slope, value = np.empty((len(points), 27, 3)), np.empty(27)
    for point, out in zip(points, slope, strict=True):
        shape_functions(point, value, out)
    share = np.prod(0.5 * (1.0 + SIGNS[None] * np.sign(np.where(np.abs(points) < 1e-9, 0.0, points))[:, None]), axis=2)
    return Reference(np.arange(27, dtype=np.int32)[None], slope[None], weight[None], share[None])


def linear(n: int) -> Reference:
    """Eight elements of 8 nodes with n^3 Gauss points each."""
    points, weight = gauss(n)
    slope = _trilinear_slope(points)
    share = np.repeat(np.eye(8)[:, None], len(points), axis=1)
    return Reference(OCTANT_NODES, np.tile(slope, (8, 1, 1, 1)), np.tile(weight, (8, 1)), share)


def _trilinear_slope(points: Floats) -> Floats:
    """(q, 8, 3) at points (q, 3)."""
    factor = 0.5 * (1.0 + points[:, None] * SIGNS)
    slope = np.empty_like(factor)
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        slope[..., axis] = 0.5 * SIGNS[:, axis] * factor[..., others].prod(axis=2)
    return slope


def hex27(x: Floats, poisson: float, share: float = SHARES["hex27"]) -> Table:
    """Quadratic hexahedron, mu/2 I1 with 3^3 Gauss points and the rest with 2^3: no locking, no spurious modes."""
    table = split(quadratic(3), quadratic(2), x)
    return table._replace(stabilisation=share * table.stabilisation)


def hex27_full(x: Floats, poisson: float) -> Table:
    """Quadratic hexahedron with 3^3 Gauss points: definite at any strain that the material bears; locks near nu 1/2."""
    return full(quadratic(3), x)


def hex27_reduced(x: Floats, poisson: float) -> Table:
    """Quadratic hexahedron, all energy with 2^3 Gauss points, and two thirds of what 3^3 would add to mu/2 I1.

    That part, x . S x of `table.split`, is all that separates 2^3 points from spurious modes: any share of it will do
    for these, and 2^3 points alone converge as fast (Ciarlet, The Finite Element Method for Elliptic Problems, 1978,
    sec. 4.1: exact on Q_3 in each variable). The whole of it makes displacements a minimum of the energy over quadratic
    functions, which is too stiff wherever the truth is none; the less of it, the softer, and the sooner a squeezed cell
    buckles.
    """
    return hex27(x, poisson, SHARES["hex27_reduced"])


def hex8(x: Floats, poisson: float) -> Table:
    """Eight linear hexahedra a cell, mu/2 I1 with 2^3 Gauss points and the rest at the middle.

    The coarse rule is the uniform gradient, and mu S its hourglass stiffness: that of the shear modulus alone, softer
    in bending than the element of theory. It needs three elements or more through a thickness that bends.
    """
    return split(linear(2), linear(1), x)


def hex8_full(x: Floats, poisson: float) -> Table:
    """Eight linear hexahedra a cell with 2^3 Gauss points: the textbook's, which lock in bending and near nu 1/2."""
    return full(linear(2), x)


def hex8_bbar(x: Floats, poisson: float) -> Table:
    """Eight linear hexahedra a cell with 2^3 Gauss points and one volume ratio each: no volumetric locking.

    In small strains this is B-bar (Hughes, Int. J. Numer. Meth. Eng. 15, 1980), in large ones the mean dilatation of
    Nagtegaal, Parks & Rice (Comput. Meth. Appl. Mech. Eng. 4, 1974) in the form of an energy of F-bar; it still is too
    stiff in bending.
    """
    return grouped(hex8_full(x, poisson), OCTANT_NODES)


def hex8_reduced(x: Floats, poisson: float, coefficient: float = COEFFICIENT) -> Table:
    """Eight linear hexahedra a cell, everything at the middle, and an hourglass stiffness.

    Uniform gradient b and hourglass vectors gamma_m = h_m - b (h_m . x) of Flanagan & Belytschko (Int. J. Numer. Meth.
    Eng. 17, 1981, eqs. 16, 39), h the four patterns of signs orthogonal to linear fields of a cube:
      S = c V |b|^2 sum_m gamma_m gamma_m^T,  c = 1/(36 (1 - nu))                                                (1)
    On a cube of edge l, where V |b|^2 = 3 l/2, that is the stiffness in bending of a plate, E/(1 - nu^2) (l/2)^3 ... of
    the material itself; a coefficient of 0 leaves an element with 12 modes that cost nothing.
    """
    table = hex8(x, poisson)
    b, volume = table.gradient[:, :, 0], table.weight[:, :, 0]
    gamma = _HOURGLASS - np.einsum("tbin,hm,tbmi->tbhn", b, _HOURGLASS, x[:, table.nodes], optimize=True)
    size = coefficient / (1.0 - poisson) * volume * np.einsum("tbim,tbim->tb", b, b)
    return table._replace(stabilisation=np.einsum("tb,tbhm,tbhn->tbmn", size, gamma, gamma, optimize=True))
