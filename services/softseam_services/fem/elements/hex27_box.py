"""Tables of the quadratic hexahedra with split quadrature: on box cells of equal edges, and on cells of any shape.

The constant part mu/2 I1 is integrated with 3^3 Gauss points, everything else with 2^3, one point an octant, each with
its octant's mu. The difference of the two rules is positive semi-definite and vanishes on linear fields; it has their
mean:
  L_ab = sum_q w_q mu_q grad N_a . grad N_b + mean(mu) S_ab,  S = int_{3^3} - int_{2^3} grad N_a . grad N_b        (1)
with w_q = V/8 on a box, so a full cell of one material has exactly the 3^3 rule; hex27_reduced has a part of S. Cells
that the body fills in part have gradients and S of their own, and the weights f_q V/8: see `cut`. So have cells that
are no boxes, as of `table.split`.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.interpolate import hex27
from softseam_services.fem.octants import Octants

from .cut import octant_stabilisation
from .table import Table

_TWO = np.array([-1.0, 1.0]) / np.sqrt(3.0)
_THREE = (np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6), np.array([5.0, 8.0, 5.0]) / 9.0)


class CellTables(NamedTuple):
    gradient: Floats
    """grad N_a at the octants' Gauss points, column 3 q + axis (27, 24) [1/m]"""
    gradient_t: Floats
    """its transpose (24, 27)"""
    stabilisation: Floats
    """the element's part of S of eq. (1) (27, 27) [m]"""
    volume: float
    """of a cell [m^3]"""


def cell_tables(edges: Floats, share: float = 1.0, axes: Floats | None = None) -> CellTables:
    """Tables for cells with these edges (3,) [m] along axes (3, 3), those of the scene where None, of an element that
    has this share of S."""
    volume = float(edges.prod())
    value, slope = np.empty(27), np.empty((27, 3))
    gradient = np.empty((27, 8, 3))
    two = np.zeros((27, 27))
    for q in range(8):
        hex27(np.array([_TWO[q % 2], _TWO[q // 2 % 2], _TWO[q // 4]]), value, slope)
        gradient[:, q] = slope * (2.0 / edges)
        two += volume / 8.0 * gradient[:, q] @ gradient[:, q].T
    three = np.zeros((27, 27))
    points, weights = _THREE
    for i in range(3):
        for j in range(3):
            for k in range(3):
                hex27(np.array([points[i], points[j], points[k]]), value, slope)
                g = slope * (2.0 / edges)
                three += volume / 8.0 * weights[i] * weights[j] * weights[k] * (g @ g.T)
    flat = (gradient if axes is None else gradient @ axes.T).reshape(27, 24)
    return CellTables(flat.copy(), flat.T.copy(), share * (three - two), volume)


class Patterns(NamedTuple):
    """What differs from cell to cell (k patterns, u of them of cells that are cut)."""

    laplacian: Floats
    """L of eq. (1) (k, 27, 27) [N/m]"""
    gradient_t: Floats
    """row 3 q + axis (u, 24, 27) [1/m]"""
    stabilisation: Floats
    """with the octants' fill and mu (u, 27, 27) [N/m]"""
    own_gradient: Floats
    """of each octant alone, as `CellTables.gradient` (u, 27, 24) [1/m]"""


NO_PATTERNS = Patterns(np.zeros((0, 27, 27)), np.zeros((0, 24, 27)), np.zeros((0, 27, 27)), np.zeros((0, 27, 24)))
"""of cells off the fast path"""


def number_patterns(material: Ints, part: Ints) -> tuple[Ints, Ints]:
    """Of boxes with the materials' numbers (c, 8) of octants, some of which are cut (u,).

    Returns the pattern of each cell (c,), boxes of like octants that are not cut having one, and the place of each cell
    among those that are, -1 for others (c,).
    """
    cut, pattern = np.full((2, len(material)), -1, dtype=np.int32)
    cut[part] = np.arange(len(part))
    kinds, found = np.unique(material[cut < 0], axis=0, return_inverse=True)
    pattern[cut < 0], pattern[part] = found.reshape(-1), len(kinds) + np.arange(len(part))
    return pattern, cut


def patterns(
    tables: CellTables,
    edges: Floats,
    moduli: tuple[Floats, Floats],
    octants: Octants,
    numbers: tuple[Ints, Ints],
    share: float = 1.0,
) -> Patterns:
    """Tables of boxes with shear moduli (c, 8) [Pa] of octants, which count as `octants` says: of their points, and of
    what steadies them.

    numbers: of `number_patterns`
    """
    (pattern, cut), (mu, steadying) = numbers, moduli
    full, part = np.flatnonzero(cut < 0), octants.cut
    first = full[np.unique(pattern[full], return_index=True)[1]]
    whole = tables.gradient.reshape(27, 8, 3)
    squares = np.einsum("aqi,bqi->qab", whole, whole) * (tables.volume / 8.0)
    laplacian = np.einsum("kq,qab->kab", mu[first], squares)
    laplacian += steadying[first].mean(axis=1)[:, None, None] * tables.stabilisation
    if not len(part):
        return Patterns(np.ascontiguousarray(laplacian), *NO_PATTERNS[1:])
    gradient = octants.gradient.reshape(-1, 24, 27)
    stabilisation = share * np.tensordot((octants.shear * steadying)[part], octant_stabilisation(edges), axes=1)
    stiff = (octants.fill * mu)[part]
    weighted = np.repeat(stiff * (tables.volume / 8.0), 3, axis=1)[:, :, None] * gradient
    own = np.swapaxes(gradient, 1, 2) @ weighted + stabilisation
    return Patterns(
        np.concatenate([laplacian, own]), gradient, stabilisation, octants.own.reshape(-1, 24, 27).swapaxes(1, 2)
    )


def own_patterns(table: Table, moduli: tuple[Floats, Floats], fill: Floats) -> Patterns:
    """The same of cells (c,) of any shape, each with a table of its own; fill (c, 8) of octants."""
    (mu, steadying), n_cells = moduli, len(fill)
    gradient = table.gradient[:, 0].reshape(n_cells, 24, 27)
    stabilisation = (fill * steadying).mean(axis=1)[:, None, None] * table.stabilisation[:, 0]
    weighted = np.repeat(table.weight[:, 0] * fill * mu, 3, axis=1)[:, :, None] * gradient
    gradient_t = np.swapaxes(gradient, 1, 2)
    return Patterns(gradient_t @ weighted + stabilisation, gradient, stabilisation, gradient_t)
