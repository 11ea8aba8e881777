"""Elements of tetrahedra: a cell as six quadratic ones, or each octant as six linear ones; and of cells that are
tetrahedra: one quadratic tetrahedron, or the eight linear ones of its parts.

Kuhn's division of a cube: the corners (0,0,0), e_p, e_p + e_q, (1,1,1) for every order (p, q, r) of the axes. Its edges
join corners whose differences are 0 or 1 in each axis, so the middles of a cell's edges are lattice nodes, and the
diagonals of opposite faces are parallel, so neighbours fit. Octants are divided with the diagonal through the centre
of the cell: the faces of a cell are alike on opposite sides, and no direction is preferred.

Of cells that are tetrahedra, with one volume ratio for all eight, the linear ones are F-bar-Patch (see `tet4_fbar`) on
patches that every mesh has: a cell then has one constraint on volume for some four freedoms of its own, without that
cure it has eight.

Builders take nodes of t cells x (t, 27, 3) [m], and of a lattice's cells Poisson's ratio.
"""

from collections.abc import Callable
from itertools import permutations

import numpy as np

from softseam_protocol.table import Table as Rows
from softseam_services.body.body import Floats, Ints
from softseam_services.body.lattice import OCTANT_NODES
from softseam_services.body.tetrahedron import NODES, OF_PARTS, PARTS

from .table import Reference, Table, corrected, full, grouped

_STRIDE = np.array([1, 3, 9])
_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_BARYCENTRIC_SLOPE = np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def kuhn() -> Ints:
    """Corners of the six tetrahedra of a unit cube, with positive volume (6, 4, 3)."""
    tets = []
    for order in permutations(range(3)):
        corners = np.zeros((4, 3), dtype=np.int32)
        corners[1:] = np.cumsum(np.eye(3, dtype=np.int32)[list(order)], axis=0)
        if np.linalg.det(np.diff(corners, axis=0)) < 0.0:
            corners[[1, 2]] = corners[[2, 1]]
        tets.append(corners)
    return np.array(tets, dtype=np.int32)


def linear() -> Reference:
    """48 elements of 4 nodes with one point each, six an octant, octant by octant."""
    nodes = []
    for octant in range(8):
        side = np.array([octant & 1, octant >> 1 & 1, octant >> 2])
        away = 2 * side - 1
        for corners in kuhn():
            tet = (1 + away * corners) @ _STRIDE
            nodes.append(tet if away.prod() > 0 else tet[[0, 2, 1, 3]])
    slope = np.broadcast_to(_BARYCENTRIC_SLOPE, (48, 1, 4, 3))
    share = np.repeat(np.eye(8), 6, axis=0)[:, None]
    return Reference(np.array(nodes, dtype=np.int32), np.ascontiguousarray(slope), np.full((48, 1), 1.0 / 6.0), share)


def quadratic(fine: bool = False) -> Reference:
    """6 elements of 10 nodes with 4 points each, exact to degree 2, or with 5, exact to degree 3.

    One of 4 points takes half its fill from the octant of its corner, and a quarter from each of the two octants that
    hold the rest of the tetrahedron, which are those of its middle corners: so the volumes by octant are exact.
    """
    inner = 1.0 / 6.0 if fine else (5.0 - np.sqrt(5.0)) / 20.0
    barycentric = np.full((4, 4), inner) + (1.0 - 4.0 * inner) * np.eye(4)
    weight = np.full(4, 1.0 / 24.0)
    if fine:
        barycentric = np.concatenate([barycentric, np.full((1, 4), 0.25)])
        weight = np.append(np.full(4, 0.45), -0.8) / 6.0
    slope = np.empty((len(weight), 10, 3))
    for q, value in enumerate(barycentric):
        slope[q, :4] = (4.0 * value - 1.0)[:, None] * _BARYCENTRIC_SLOPE
        for e, (a, b) in enumerate(_EDGES):
            slope[q, 4 + e] = 4.0 * (value[a] * _BARYCENTRIC_SLOPE[b] + value[b] * _BARYCENTRIC_SLOPE[a])
    nodes, share = [], np.zeros((6, len(weight), 8))
    for tet, corners in enumerate(kuhn()):
        edges = [corners[a] + corners[b] for a, b in _EDGES]
        nodes.append(np.concatenate([2 * corners, edges]) @ _STRIDE)
        octant = corners @ np.array([1, 2, 4])
        middle = octant[(octant != 0) & (octant != 7)]
        for q in range(4):
            share[tet, q, octant[q]] += 0.5
            share[tet, q, middle] += 0.25
    return Reference(np.array(nodes, dtype=np.int32), np.tile(slope, (6, 1, 1, 1)), np.tile(weight, (6, 1)), share)


def tet10(x: Floats, poisson: float) -> Table:
    """Six quadratic tetrahedra a cell with four points each."""
    return corrected(quadratic(fine=True), quadratic(), x)


def tet4(x: Floats, poisson: float) -> Table:
    """48 linear tetrahedra a cell: the element of least order, which locks; for comparison."""
    return full(linear(), x)


def tet4_fbar(x: Floats, poisson: float) -> Table:
    """48 linear tetrahedra a cell with one volume ratio an octant: F-bar-Patch.

    de Souza Neto, Andrade Pires & Owen (Int. J. Numer. Meth. Eng. 62, 2005, eq. 12) with the six tetrahedra of an
    octant as the patch, here in the form of an energy, so that the tangent is symmetric. It cures volumetric locking;
    in bending it stays as stiff as linear tetrahedra are.
    """
    return grouped(tet4(x, poisson), OCTANT_NODES)


def _first(fine: bool = False) -> Reference:
    """The first of a cube's six quadratic ones."""
    all_six = quadratic(fine)
    return Reference(all_six.nodes[:1], all_six.slope[:1], all_six.weight[:1], all_six.share[:1])


def _parts() -> Reference:
    """One of four nodes with one point in each part of a cell."""
    slope = np.concatenate([-np.ones((1, 3)), np.eye(3)])
    return Reference(
        nodes=NODES[PARTS],
        slope=np.tile(slope, (8, 1, 1, 1)),
        weight=np.full((8, 1), 1.0 / 6.0),
        share=np.eye(8)[OF_PARTS][:, None],
    )


_FINE, _COARSE, _LINEAR = _first(fine=True), _first(), _parts()


def _tet10(x: Floats) -> Table:
    return corrected(_FINE, _COARSE, x)


def _tet4(x: Floats) -> Table:
    return full(_LINEAR, x)


def _tet4_fbar(x: Floats) -> Table:
    return grouped(_tet4(x), NODES[None])


OF_TETRAHEDRA: Rows[Callable[[Floats], Table]] = Rows(
    "builders of elements of tetrahedra", {"tet10": _tet10, "tet4": _tet4, "tet4_fbar": _tet4_fbar}
)
"""nodes of t cells (t, 27, 3) [m] -> table; raises MeshError where a cell is turned over"""
