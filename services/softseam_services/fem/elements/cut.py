"""Elements in box cells that the body fills partly.

A uniform stress P leaves the force P sum_q w_q G_qa on node a of a cell. In equilibrium with the tractions P n of the
body's surface, which passes through the cell, it must be P int grad N_a dV over the filled part: by the divergence
theorem that is the integral of N_a P n over the surface in the cell and over the filled parts of its faces. Between
cells these cancel, so nodes that see no traction are in balance. The patch test asks that sum_q w_q G_q be exact, as on
distorted cells (`table.split`); the moments of the filled parts (body/filled.py) give the exact sums.

hex27 has one point an octant, which takes the octant's own mean, and its shear what a mean leaves out:
  G_o = mean of grad N over the filled part,  S = sum_o f_o mu_o (int_o |grad N|^2 - V_o |mean_o grad N|^2)          (1)
S is taken over whole octants, by their share f_o: it is never negative, vanishes on linear fields, and holds nodes that
the body hardly reaches as firmly as the rest of their cell; the true integral would let them go with a power of f_o.
Octants' sums are exact one by one, so that cells of two materials pass, too. Other elements keep their points, shifted:
  G_q <- G_q + (int grad N dV - sum_q w_q G_q)/sum_q w_q                                                          (2)
Either way gradients of linear fields are exact at every point. Tetrahedra are left as they are: what they have of an
octant's filled part is not known.
"""

import numpy as np

from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.filled import FULL_MOMENTS, mean_gradients, mean_trilinear_gradients
from softseam_services.body.interpolate import hex27
from softseam_services.fem.octants import Octants

from .hexahedra import SHARES, SIGNS
from .table import Table, gauss


def octant_stabilisation(edges: Floats) -> Floats:
    """int |grad N|^2 - V |mean grad N|^2 over each octant of a cell with these edges (3,) [m] (8, 27, 27) [m]."""
    points, weight = gauss(3)
    value, slope = np.empty(27), np.empty((27, 3))
    volume = float(edges.prod()) / 8.0
    mean = mean_gradients(np.tile(FULL_MOMENTS, (1, 8, 1)), edges)[0]
    out = -volume * np.einsum("oia,oib->oab", mean, mean)
    for octant in range(8):
        for point, share in zip(0.5 * (SIGNS[octant] + points), weight / 8.0, strict=True):
            hex27(point, value, slope)
            gradient = slope * (2.0 / edges)
            out[octant] += share * volume * gradient @ gradient.T
    return np.asarray(out)


def with_cut_cells(
    element: ElementKind,
    table: Table,
    shape: Ints,
    boxes: bool,
    body: Body,
    moments: Floats,
    mu: Floats,
    octants: Octants | None,
) -> tuple[Table, Ints]:
    """The table with a shape of its own for every box that is filled in part, and each cell's (c,).

    boxes: the cells have the one shape of the table, a box; others stay as they are. moments (c, 8, 27): of the filled
    parts; mu (c, 8): of the octants, relative; octants: how these count, where `element` is of hex27's kin.
    """
    part = np.flatnonzero((moments[:, :, 0] < 1.0).any(axis=1)) if octants is None else octants.cut
    if not boxes or FACTS[element].functions.startswith("tet") or not len(part):
        return table, shape
    own = _shared(element, table, body, mu, octants) if octants else _cut(element, table, body, moments[part])
    shape = shape.copy()
    shape[part] = 1 + np.arange(len(part))
    gradient = np.concatenate([table.gradient, own.gradient])
    stabilisation = np.concatenate([table.stabilisation, own.stabilisation])
    weight = np.repeat(table.weight, 1 + len(part), axis=0)
    return table._replace(gradient=gradient, weight=weight, stabilisation=stabilisation), shape


def _shared(element: ElementKind, table: Table, body: Body, mu: Floats, octants: Octants) -> Table:
    """The table on a box, (1, ...), of an element of hex27's kin as it is in cells that are cut, (u, ...)."""
    stiff = (octants.shear * mu)[octants.cut]
    mean = np.tensordot(stiff / stiff.sum(axis=1, keepdims=True), 8.0 * octant_stabilisation(body.edges), axes=1)
    mean *= SHARES[element]
    return table._replace(gradient=octants.gradient[:, None], stabilisation=mean[:, None])


def _cut(element: ElementKind, table: Table, body: Body, moments: Floats) -> Table:
    """Another element's table on a box, (1, ...), as it is in k cells with these moments (k, 8, 27), (k, ...)."""
    fill = moments[:, :, 0]
    weight = table.weight * np.einsum("bqo,co->cbq", table.share, fill)
    if FACTS[element].functions == "hex27":
        share = fill / fill.sum(axis=1, keepdims=True)
        exact = np.einsum("co,coia->cia", share, mean_gradients(moments, body.edges))[:, None]
    else:
        exact = mean_trilinear_gradients(moments, body.edges)
    exact = body.axes @ exact
    mean = np.einsum("cbq,bqia->cbia", weight, table.gradient[0]) / weight.sum(axis=2)[..., None, None]
    gradient = table.gradient + (exact - mean)[:, :, None]  # eq. (2)
    return table._replace(gradient=gradient, stabilisation=np.repeat(table.stabilisation, len(fill), axis=0))
