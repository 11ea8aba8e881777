"""How far FEM's stress is from a smoother one: the error of the cells' size, as a field.

O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337-357: with the stress sigma* recovered from the
points where it is most accurate (`body.kernels.patch_error`), the energy of the error of cell e is about

    eta_e = 1/2 int_e (sigma* - sigma) : C^-1 : (sigma* - sigma) dV                                               (1)

over the cell at rest, C Hooke's law of the material. sigma* is fitted within the region, since neighbours beyond a seam
have another model, whose error is not the mesh's, and within each material, since stress jumps where another begins.
sigma is evaluated where (1) is integrated; but elements that take volume changes at fewer points than shape changes
have the pressure of those points, carried to the others by their own polynomial: elsewhere, a nearly incompressible
element's pressure is noise that it never feels. Tetrahedra have the stress that they report in each octant all over it.
"""

from functools import cache

import numpy as np

from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.filled import FILL_FLOOR, filled_centroids, filled_moments
from softseam_services.body.interpolate import hex27
from softseam_services.body.kernels.cell_loads import stress_at_points
from softseam_services.body.kernels.patch_error import patch_error
from softseam_services.body.point_materials import point_moduli, point_parameters

from .elements.hexahedra import SIGNS, linear, quadratic
from .elements.table import Reference, gauss, place
from .rule import cell_shapes

_FULL: frozenset[ElementKind] = frozenset({"hex27_full", "hex8_full"})
"""elements that feel their whole stress at all points"""
_TRILINEAR = (0.5 * (1.0 + np.sqrt(3.0) * gauss(3)[0][:, None] * SIGNS)).prod(axis=2)
"""polynomial through the 2^3 Gauss points, at the 3^3 ones (27, 8)"""


class MeshError:
    """The indicator of one region, built once."""

    def __init__(self, body: Body, region: Region, element: ElementKind) -> None:
        self._nodes, self._law, self._n_nodes = region.cell_nodes, body.material.number, len(region.nodes)
        shapes, self._shape, _ = cell_shapes(body, region)
        quadratic_cell = FACTS[element].functions == "hex27"
        (samples, at_samples), (points, at_points) = _rules(quadratic_cell)
        self._full, self._tetrahedra = element in _FULL, FACTS[element].functions.startswith("tet")
        placed = place(points, shapes)
        self._gradient, self._point_nodes = placed.gradient, points.nodes
        self._fill = np.ascontiguousarray(body.fill[region.cells])
        n_cells = len(self._fill)
        weight = placed.weight[self._shape] * np.einsum("bqo,co->cbq", points.share, self._fill)
        self._weight = np.ascontiguousarray(weight.reshape(n_cells, -1))
        # from the octants' samples to the points: trilinear in a quadratic cell, the octant's own in others
        share = points.share.reshape(-1, 8)
        self._carry = _TRILINEAR if quadratic_cell else share
        middle, size = shapes[:, 13:14], np.ptp(shapes, axis=1)
        self._size = size[self._shape]
        self._middle = body.x_rest[region.nodes][region.cell_nodes[:, 13]]
        self._at = self._middle[:, None] + (at_samples @ shapes - middle)[self._shape]
        if body.boxes and not (self._full or self._tetrahedra):  # means over the filled parts of octants
            cut = np.flatnonzero((self._fill < 1.0).any(axis=1))
            parts = filled_moments(body, region.cells[cut], np.maximum(self._fill[cut], FILL_FLOOR))
            self._at[cut] = self._middle[cut, None] + body.from_axes(0.5 * body.edges * filled_centroids(parts))
        self._local = (at_points @ shapes - middle) / size[:, None]
        self._octant = np.ascontiguousarray(body.octant_material[region.cells])
        self._of_point = np.ascontiguousarray(self._octant[:, share.argmax(axis=1)])
        self._parameters = point_parameters(body, region.cells, share)
        self._moduli = point_moduli(body, region.cells, share)
        if self._full:
            self._sample_gradient, self._sample_nodes = place(samples, shapes).gradient, samples.nodes
            self._sampled = point_parameters(body, region.cells, samples.share.reshape(-1, 8))

    def measure(self, x: Floats, cauchy: Floats) -> Floats:
        """eta_e of eq. (1) (c,) [J] at positions x (n, 3) with the stress that the cells report, cauchy (c, 8, 6)."""
        return self._energy(*self._stresses(x, cauchy))

    def product(self, x: Floats, cauchy: Floats, y: Floats, other: Floats) -> Floats:
        """int_e (sigma* - sigma)_x : C^-1 : (sigma* - sigma)_y dV (c,) [J] of the errors at positions x and at y, with
        the stresses that the cells report there, cauchy and other (c, 8, 6): what one error does to the other."""
        sampled, sigma = self._stresses(x, cauchy)
        more, further = self._stresses(y, other)
        mine, others = self._energy(sampled, sigma).sum(), self._energy(more, further).sum()
        if not (mine > 0.0 and others > 0.0):
            return np.zeros(len(self._nodes))
        scale = float(np.sqrt(mine / others))
        sums = (self._energy(sampled + sign * more, sigma + sign * further) for sign in (scale, -scale))
        return np.asarray(np.subtract(*sums) / (2.0 * scale))

    def _stresses(self, x: Floats, cauchy: Floats) -> tuple[Floats, Floats]:
        """Stress at the points where it is sampled (c, 8, 6), and where eq. (1) is integrated (c, q, 6) [Pa]."""
        sampled = cauchy
        if self._full:
            sampled = self._stress(x, self._sample_gradient, self._sample_nodes, self._sampled)
        if self._tetrahedra:
            return sampled, self._carry @ cauchy
        sigma = self._stress(x, self._gradient, self._point_nodes, self._parameters)
        if not self._full:
            mean = self._carry @ cauchy[..., :3].mean(axis=2)[..., None] - sigma[..., :3].mean(axis=2)[..., None]
            sigma[..., :3] += mean
        return sampled, sigma

    def _energy(self, sampled: Floats, sigma: Floats) -> Floats:
        energy = np.empty(len(self._nodes))
        patch_error(
            *(self._nodes, self._n_nodes, self._middle, self._size, self._at, sampled, self._fill, self._octant),
            *(self._local, self._shape, self._of_point, self._moduli, self._weight, sigma, energy),
        )
        return energy

    def _stress(self, x: Floats, gradient: Floats, nodes: Ints, parameters: Floats) -> Floats:
        out = np.empty((*parameters.shape[:2], 6))
        stress_at_points(x, self._nodes, nodes, gradient, self._shape, self._law, parameters, out)
        return out


@cache
def _rules(quadratic_cell: bool) -> tuple[tuple[Reference, Floats], tuple[Reference, Floats]]:
    """Samples and points of the integration in a cell, each with the shape functions (b q, 27) that say where it is."""
    samples, points = (quadratic(2), quadratic(3)) if quadratic_cell else (linear(1), linear(2))
    return (samples, _values(samples, quadratic_cell)), (points, _values(points, quadratic_cell))


def _values(reference: Reference, quadratic_cell: bool) -> Floats:
    n = round(reference.weight.shape[1] ** (1.0 / 3.0))
    local = gauss(n)[0]
    if not quadratic_cell:
        octants = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)]) - 0.5
        local = (octants[:, None] + 0.5 * local[None]).reshape(-1, 3)
    value, slope = np.empty((len(local), 27)), np.empty((27, 3))
    for point, out in zip(local, value, strict=True):
        hex27(point, out, slope)
    return value
