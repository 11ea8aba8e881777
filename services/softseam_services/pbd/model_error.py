"""How far PBD's answer is from that of quadratic finite elements on the same nodes: the error of the model, as a field.

At the positions x that PBD has found, the cells pull their nodes with other forces than hex27 with full quadrature:

    r = f_int^FEM(x) - f_int^PBD(x)                                                                                (1)

f^PBD is what the blocks do apply, so that (1) holds the blocks' own error and the lag of their stress. Under the same
loads, finite elements would move the nodes by u with K u = r, K their stiffness at rest, turned with each cell: so

    eta_e = 1/2 u_e . K_e u_e,     sum_e eta_e = 1/2 r . K^-1 r                                                    (2)

is the energy of the error, cell by cell. Nodes at the seam keep their place, for what happens beyond is the other
side's, and so do those of points that touch a tool, which says where they are and answers with the force that it takes.
Ten to a hundred products with K, cell by cell, give u well enough.

A bound without a solve, sum_e r_e . K_e^+ r_e with each cell's own r_e, was tried: it is four times too large, because
the two models share out the same traction otherwise over the nodes of a face, which only cancels between neighbours.
"""

import numpy as np

from softseam_services.body.body import Body, Floats, Material, Region
from softseam_services.body.interpolate import hex27
from softseam_services.body.kernels.cell_loads import cell_forces
from softseam_services.body.materials.point import LINEAR
from softseam_services.body.point_materials import point_parameters

from .block_parameters import BlockParameters, build_block_parameters
from .blocks import Blocks, build_blocks, cell_layout
from .kernels.block import new_workspace
from .kernels.block_rows import N_STRESS
from .kernels.correction import correct
from .kernels.sweep import block_forces, exact_stress

_TOLERANCE, _MOST = 3e-3, 300
"""share of the energy that ten more products may add, and most products"""
_BOUNDED = 10
"""products where the cost is bounded: a microsecond a cell each"""


class ModelError:
    """The indicator of one region of box cells, built once; blocks are built where none are given."""

    def __init__(
        self, body: Body, region: Region, hourglass: str, known: tuple[Blocks, BlockParameters] | None = None
    ) -> None:
        if known is None:
            laid_out = build_blocks(cell_layout(body, region))
            known = laid_out, build_block_parameters(laid_out, body, region, hourglass)
        self._blocks, self._numbers = known
        self._cell_nodes, self._law = region.cell_nodes, body.material.number
        local, share, weight = _points()
        self._gradient = np.ascontiguousarray(local * (2.0 / body.edges)[:, None])
        self._weight = body.edges.prod() * weight * (body.fill[region.cells] @ share.T)
        volume = body.edges.prod() * weight
        self._parameters = point_parameters(body, region.cells, share)
        self._stiffness = np.array([_stiffness(material, self._gradient, volume) for material in body.materials])
        octant = body.octant_material[region.cells]
        filled = [(body.fill[region.cells] * (octant == number)).mean(axis=1) for number in range(len(body.materials))]
        self._filled = np.ascontiguousarray(np.array(filled).T)
        self._held = region.fixed.copy()
        self._held[region.seam] = True
        place = np.rint(np.clip(region.point_local, -1.0, 1.0) + 1.0).astype(np.int64) @ np.array([1, 3, 9])
        self._point_node = region.cell_nodes[region.point_cell, place]
        self._xw = np.zeros((len(region.nodes) + 8, 4))
        self._xw[len(region.nodes) :, :3] = self._numbers.padding_x
        self._ws = new_workspace()

    def pull(self, x: Floats, stress: Floats | None = None) -> Floats:
        """-f_int^PBD of eq. (1) (n, 3) [N] at x (n, 3) [m], what the blocks pull their nodes with.

        stress  (b, N_STRESS)  that the blocks apply; None for that of their shapes, in equilibrium with x
        """
        blocks, numbers = self._blocks, self._numbers
        if stress is None:
            self._xw[: len(x), :3] = x
            stress = np.zeros((blocks.n_batches, N_STRESS))
            exact_stress(self._ws, self._xw, blocks.nodes, numbers.volume, stress, numbers.constants, numbers.law)
        pull = np.zeros((len(x) + 8, 4))
        block_forces(self._ws, blocks.nodes, stress, numbers.constants, pull, 0, blocks.n_batches)
        return pull[: len(x), :3].copy()

    def residual(self, x: Floats, stress: Floats | None = None) -> Floats:
        """r of eq. (1) (n, 3) [N] at x (n, 3) [m]; see `pull`."""
        force = np.empty((*self._cell_nodes.shape, 3))
        cell_forces(x, self._cell_nodes, self._gradient, self._weight, self._law, self._parameters, force)
        r = self.pull(x, stress)
        np.add.at(r, self._cell_nodes, force)
        return r

    def measure(self, x: Floats, contact_force: Floats, stress: Floats | None = None, bounded: bool = False) -> Floats:
        """eta_e of eq. (2) (c,) [J]; contact_force (p, 3) of the region's points; see `pull`.

        bounded  stop after `_BOUNDED` products, with an energy that is a little too small: it grows towards (2)
        """
        r = self.residual(x, stress)
        held = self._held.copy()
        held[self._point_node[contact_force.any(axis=1)]] = True
        turn = np.tile(np.eye(3), (len(self._cell_nodes), 1, 1))
        if self._law != LINEAR:
            middle = self._gradient[len(self._gradient) // 2]
            u, _, vt = np.linalg.svd(np.einsum("cai,ja->cij", x[self._cell_nodes], middle))
            turn = u @ vt
        energy = np.empty(len(self._cell_nodes))
        most = _BOUNDED if bounded else _MOST
        correct(
            r, self._cell_nodes, turn, self._filled, self._stiffness, held, _TOLERANCE, most, np.empty_like(r), energy,
        )  # fmt: skip
        return energy


def _points() -> tuple[Floats, Floats, Floats]:
    """Slopes of hex27 at 3^3 Gauss points (27, 3, 27), their share of each octant (27, 8) and weights, sum 1 (27,)."""
    at, weight = np.polynomial.legendre.leggauss(3)
    place = np.array([(i, j, k) for k in range(3) for j in range(3) for i in range(3)])
    value, slope = np.empty(27), np.empty((27, 3))
    slopes = np.empty((27, 3, 27))
    for point, out in zip(at[place], slopes, strict=True):
        hex27(point, value, slope)
        out[:] = slope.T
    sign = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)]) * 2 - 1
    share = np.prod(0.5 * (1.0 + sign[None] * (place - 1)[:, None]), axis=2)
    return slopes, share, weight[place].prod(axis=1) / 8.0


def _stiffness(material: Material, gradient: Floats, volume: Floats) -> Floats:
    """K_e of a full cell at rest by Hooke's law (81, 81) [N/m]."""
    mu, lambda_ = material.mu, material.lambda_
    pairs = np.einsum("q,qia,qjb->aibj", volume, gradient, gradient, optimize=True)
    trace = np.einsum("aibi->ab", pairs)
    k = lambda_ * pairs + mu * pairs.transpose(0, 3, 2, 1) + mu * np.einsum("ab,ij->aibj", trace, np.eye(3))
    return np.asarray(k.reshape(81, 81))
