"""How far FEM's stress is from a smoother one: the error of the cells' size, as a field.

O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337-357: with the stress sigma* recovered from the
points where it is most accurate (`body.patch_fit`), the energy of the error of cell e is about

    eta_e = 1/2 int_e (sigma* - sigma) : C^-1 : (sigma* - sigma) dV                                               (1)

over the cell at rest, C Hooke's law of the material. sigma* is fitted within the region, since neighbours beyond a seam
have another model, whose error is not the mesh's, and within each material, since stress jumps where another begins.
sigma is evaluated where (1) is integrated; but elements that take volume changes at fewer points than shape changes
have the pressure of those points, carried to the others by their own polynomial: elsewhere, a nearly incompressible
element's pressure is noise that it never feels. Tetrahedra have the stress that they report in each octant all over it.
"""

from __future__ import annotations

import numpy as np

from softseam_protocol.kinds import ElementKind
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.interpolate import FUNCTIONS, hex27
from softseam_services.body.kernels.cell_loads import stress_at_points
from softseam_services.body.patch_fit import N_TERMS, patch_fit, terms
from softseam_services.body.point_materials import point_parameters
from softseam_services.fem.elements.hexahedra import SIGNS, linear, quadratic
from softseam_services.fem.elements.table import Points, Reference, gauss, place
from softseam_services.fem.rule import cell_shapes

_FULL: frozenset[ElementKind] = frozenset({"hex27_full", "hex8_full"})
"""elements that feel their whole stress at all points"""
_TRILINEAR = (0.5 * (1.0 + np.sqrt(3.0) * gauss(3)[0][:, None] * SIGNS)).prod(axis=2)
"""polynomial through the 2^3 Gauss points, at the 3^3 ones (27, 8)"""


class MeshError:
    """The indicator of one region, built once."""

    def __init__(self, body: Body, region: Region, element: ElementKind) -> None:
        self._nodes, self._law = region.cell_nodes, body.material.number
        shapes, self._shape = cell_shapes(body, region)
        quadratic_cell = FUNCTIONS[element] == "hex27"
        samples, points = (quadratic(2), quadratic(3)) if quadratic_cell else (linear(1), linear(2))
        self._full, self._tetrahedra = element in _FULL, FUNCTIONS[element].startswith("tet")
        self._samples, self._points = place(samples, shapes), place(points, shapes)
        self._sample_nodes, self._point_nodes = samples.nodes, points.nodes
        fill = body.fill[region.cells]
        n_cells = len(fill)
        weight = self._points.weight[self._shape] * np.einsum("bqo,co->cbq", points.share, fill)
        self._weight = weight.reshape(n_cells, -1)
        # from the octants' samples to the points: trilinear in a quadratic cell, the octant's own in others
        self._carry = _TRILINEAR if quadratic_cell else points.share.reshape(-1, 8)
        middle = shapes[:, 13][self._shape]
        size = np.ptp(shapes, axis=1)[self._shape]
        centre = body.x_rest[region.nodes][region.cell_nodes[:, 13]]
        at = _positions(samples, quadratic_cell, shapes)[self._shape] - middle[:, None]
        self._terms = terms(
            (_positions(points, quadratic_cell, shapes) - shapes[:, 13:14]) / np.ptp(shapes, axis=1)[:, None]
        )
        octant = body.octant_material[region.cells]
        at_points = points.share.reshape(-1, 8)
        self._parameters = point_parameters(body, region.cells, at_points)
        self._sampled = point_parameters(body, region.cells, samples.share.reshape(-1, 8))
        self._of_point = octant[:, at_points.argmax(axis=1)]
        self._fits = [
            (
                number,
                patch_fit(
                    self._nodes, len(region.nodes), centre, size, centre[:, None] + at, fill * (octant == number)
                ),
            )
            for number in np.unique(octant)
        ]

    def measure(self, x: Floats, cauchy: Floats) -> Floats:
        """eta_e of eq. (1) (c,) [J] at positions x (n, 3) with the stress that the cells report, cauchy (c, 8, 6)."""
        n_cells = len(self._nodes)
        sampled = cauchy
        if self._full:
            sampled = self._stress(x, self._samples, self._sample_nodes, self._sampled)
        if self._tetrahedra:
            sigma = self._carry @ cauchy
        else:
            sigma = self._stress(x, self._points, self._point_nodes, self._parameters)
        if not (self._full or self._tetrahedra):
            mean = self._carry @ cauchy[..., :3].mean(axis=2)[..., None] - sigma[..., :3].mean(axis=2)[..., None]
            sigma[..., :3] += mean
        error = -sigma
        for number, fit in self._fits:
            coefficients = (fit @ sampled.reshape(-1, 6)).reshape(n_cells, N_TERMS, 6)
            smooth = np.einsum("cqp,cps->cqs", self._terms[self._shape], coefficients, optimize=True)
            error += np.where((self._of_point == number)[..., None], smooth, 0.0)
        return np.asarray(np.einsum("cq,cq->c", self._weight, self._density(error)))

    def _stress(self, x: Floats, table: Points, nodes: Ints, parameters: Floats) -> Floats:
        out = np.empty((*parameters.shape[:2], 6))
        stress_at_points(x, self._nodes, nodes, table.gradient, self._shape, self._law, parameters, out)
        return out

    def _density(self, error: Floats) -> Floats:
        """1/2 s : C^-1 : s [J/m^3] of stresses (c, b q, 6) by Hooke's law."""
        mu, lambda_ = self._parameters[..., 0], self._parameters[..., 1]
        trace = error[..., :3].sum(axis=-1)
        square = (error[..., :3] ** 2).sum(axis=-1) + 2.0 * (error[..., 3:] ** 2).sum(axis=-1)
        return np.asarray((square - lambda_ / (3.0 * lambda_ + 2.0 * mu) * trace * trace) / (4.0 * mu))


def _positions(reference: Reference, quadratic_cell: bool, shapes: Floats) -> Floats:
    """Where the points of an element are in cells with nodes (t, 27, 3): (t, b q, 3) [m]."""
    n = round(reference.weight.shape[1] ** (1.0 / 3.0))
    local = gauss(n)[0]
    if not quadratic_cell:
        octants = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)]) - 0.5
        local = (octants[:, None] + 0.5 * local[None]).reshape(-1, 3)
    value, slope = np.empty((len(local), 27)), np.empty((27, 3))
    for point, out in zip(local, value, strict=True):
        hex27(point, out, slope)
    return np.asarray(np.einsum("pa,tai->tpi", value, shapes))
