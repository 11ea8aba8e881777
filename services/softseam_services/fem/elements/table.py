"""What an element is: points at which a cell's energy is integrated, and the gradients of its shape functions there.

Every element lives on the 27 lattice nodes of a cell, so dissection, contact, seam and hand-over know cells only. A
cell holds b elements of m nodes and q points each. With the deformation gradients F at the points, the energy density
psi, weights w that carry the octants' fill, and the elements' stabilisation S [m]:
  U = sum w psi(F) + fill mu/2 sum_ab S_ab x_a . x_b                                                             (1)
S vanishes on linear fields, so that it is free at rest and indifferent to rotations. Where points are grouped, a mean
volume ratio of the group takes the place of det F, see kernels/mean_volume.py.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.errors import MeshError

_ALONE = np.zeros((0, 0), dtype=np.int32)


class Reference(NamedTuple):
    """Elements of one kind in a cell, in coordinates of their own."""

    nodes: Ints
    """lattice nodes of each (b, m)"""
    slope: Floats
    """of the shape functions at the points (b, q, m, 3) [1]"""
    weight: Floats
    """of the points (b, q) [1]"""
    share: Floats
    """how much of each point lies in each octant, sum 1 (b, q, 8)"""


class Points(NamedTuple):
    """The same at rest in t cells of different shapes."""

    gradient: Floats
    """(t, b, q, 3, m) [1/m]"""
    weight: Floats
    """(t, b, q) [m^3]"""


class Table(NamedTuple):
    """An element in t cells of different shapes."""

    nodes: Ints
    """(b, m)"""
    gradient: Floats
    """(t, b, q, 3, m) [1/m]"""
    weight: Floats
    """volume that each point stands for in a full cell (t, b, q) [m^3]"""
    share: Floats
    """(b, q, 8)"""
    stabilisation: Floats
    """S of eq. (1), positive semi-definite (t, b, m, m) [m]"""
    group_nodes: Ints
    """nodes of each group of consecutive elements that have one mean volume ratio (g, n), (0, 0) for none"""

    @property
    def element_share(self) -> Floats:
        """How much of each element lies in each octant (b, 8)."""
        return np.asarray(self.share.mean(axis=1))


def place(reference: Reference, x: Floats) -> Points:
    """Isoparametric map of the reference elements into cells with nodes x (t, 27, 3) [m]; raises MeshError."""
    corners = x[:, reference.nodes]  # (t, b, m, 3)
    jacobian = np.einsum("tbmi,bqmj->tbqij", corners, reference.slope, optimize=True)
    volume = np.linalg.det(jacobian)
    if not np.all(volume > 0.0):
        cell, element, _ = np.unravel_index(int(np.argmin(volume)), volume.shape)
        centre = np.array2string(corners[cell, element].mean(axis=0), precision=4)
        raise MeshError(f"a cell is turned over or flat at rest, around {centre} m: mend the mesh there")
    gradient = np.einsum("bqmj,tbqji->tbqim", reference.slope, np.linalg.inv(jacobian), optimize=True)
    return Points(np.ascontiguousarray(gradient), np.ascontiguousarray(reference.weight * volume))


def full(reference: Reference, x: Floats) -> Table:
    """The whole energy at all points."""
    points = place(reference, x)
    return Table(reference.nodes, *points, reference.share, _none(points), _ALONE)


def split(fine: Reference, coarse: Reference, x: Floats) -> Table:
    """mu/2 I1 at the fine points, everything else at the coarse ones.

    With means g = int grad N over the element by the fine rule, and coarse weights w that sum to its volume V, coarse
    gradients are G + (g - sum w G)/V, whose sum is exact whatever the cell's shape (one point: the uniform gradient of
    Flanagan & Belytschko, Int. J. Numer. Meth. Eng. 17, 1981), and
      S_ab = sum_fine w grad N_a . grad N_b - sum_coarse w G_a . G_b                                             (2)
    """
    few, many = place(coarse, x), place(fine, x)
    points = _exact(few, many)
    value, vector = np.linalg.eigh(laplacian(many) - laplacian(points))
    # on strongly curved cells the difference is slightly indefinite; linear fields keep the eigenvalue 0
    stabilisation = np.einsum("tbmi,tbi,tbni->tbmn", vector, np.maximum(value, 0.0), vector, optimize=True)
    return Table(coarse.nodes, *points, coarse.share, stabilisation, _ALONE)


def corrected(fine: Reference, coarse: Reference, x: Floats) -> Table:
    """The whole energy at the coarse points, whose gradients have the right sum whatever the cell's shape."""
    points = _exact(place(coarse, x), place(fine, x))
    return Table(coarse.nodes, *points, coarse.share, _none(points), _ALONE)


def _exact(few: Points, many: Points) -> Points:
    volume = many.weight.sum(axis=2)
    weight = few.weight * (volume / few.weight.sum(axis=2))[..., None]
    total = np.einsum("tbq,tbqim->tbim", many.weight, many.gradient)
    missing = (total - np.einsum("tbq,tbqim->tbim", weight, few.gradient)) / volume[..., None, None]
    return Points(few.gradient + missing[:, :, None], weight)


def grouped(table: Table, group_nodes: Ints) -> Table:
    """The same with one mean volume ratio a group; group_nodes (g, n)."""
    return table._replace(group_nodes=group_nodes)


def laplacian(points: Points) -> Floats:
    """sum w grad N_a . grad N_b of each element (t, b, m, m) [m]."""
    return np.asarray(
        np.einsum("tbq,tbqia,tbqic->tbac", points.weight, points.gradient, points.gradient, optimize=True)
    )


def gauss(n: int) -> tuple[Floats, Floats]:
    """Points (n^3, 3) and weights (n^3,) of the product rule on [-1, 1]^3, x fastest."""
    at, weight = np.polynomial.legendre.leggauss(n)
    k, j, i = (index.ravel() for index in np.meshgrid(*[np.arange(n)] * 3, indexing="ij"))
    return np.stack([at[i], at[j], at[k]], axis=1), weight[i] * weight[j] * weight[k]


def _none(points: Points) -> Floats:
    t, b, _, _, m = points.gradient.shape
    return np.zeros((t, b, m, m))
