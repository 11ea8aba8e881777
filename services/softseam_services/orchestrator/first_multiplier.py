"""The first multiplier of a new seam: the force that lets both sides start with the same acceleration.

A cut opens nothing yet, but each side then lacks the force that the other one's cells put on the shared nodes. With F
the sum of stress, contact and weight on the seam's nodes, m their masses, and x_near = P x_far + c the tie,

    (F_near + lambda)/m_near = P (F_far - P^T lambda)/m_far                                                    (1)

Stress counts with its value in the middle of each octant, in the trace of the side's own model.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.mortar import SeamTie
from softseam_protocol.messages import BodyState
from softseam_services.body.body import Body
from softseam_services.body.interpolate import Functions, point_weights
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.region import build_region
from softseam_services.orchestrator.sides import FAR, NEAR, Sides

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_MIDDLES = np.array([(o & 1, o >> 1 & 1, o >> 2) for o in range(8)]) - 0.5
"""middles of a cell's octants in local coordinates (8, 3)"""


def _quadratic_slopes() -> Floats:
    """Derivatives of the 27 functions of a cell at the octants' middles (8, 27, 3), local coordinates in [-1, 1]."""
    value = np.stack([0.5 * _MIDDLES * (_MIDDLES - 1.0), 1.0 - _MIDDLES**2, 0.5 * _MIDDLES * (_MIDDLES + 1.0)], axis=2)
    slope = np.stack([_MIDDLES - 0.5, -2.0 * _MIDDLES, _MIDDLES + 0.5], axis=2)
    out = np.ones((8, 27, 3))
    for axis in range(3):
        for along in range(3):
            out[:, :, along] *= (slope if axis == along else value)[:, axis, LOCAL[:, axis]]
    return out


def _block_slopes() -> Floats:
    """The same of the trilinear functions of each octant's corners, zero for the nodes of other octants (8, 27, 3)."""
    out = np.zeros((8, 27, 3))
    corners = 2.0 * LOCAL[OCTANT_NODES[0]] - 1.0
    for octant in range(8):
        out[octant, OCTANT_NODES[octant]] = corners / 4.0
    return out


_SLOPES = {"hex27": _quadratic_slopes(), "tet10": _quadratic_slopes(), "hex8": _block_slopes(), "tet4": _block_slopes()}
"""by the model's functions; those of tetrahedra are near enough to these for a first guess"""


def first_multiplier(
    body: Body, sides: Sides, state: BodyState, cauchy: Floats, tie: SeamTie, functions: Mapping[str, Functions]
) -> Floats:
    """Forces on the near side (s, 3) [N], eq. (1).

    functions  what each model interpolates with
    cauchy  (C, 8, 6)  stress of the merged body in each octant, xx yy zz yz xz xy [Pa]
    """
    mass, acceleration = {}, {}
    for name in (NEAR, FAR):
        mass[name], force = _seam_loads(body, sides, name, state, cauchy, functions[sides.models[name]])
        acceleration[name] = force / mass[name][:, None]
    difference = acceleration[FAR] if tie.p is None else tie.p @ acceleration[FAR]
    difference = difference - acceleration[NEAR]
    if tie.p is None:
        return difference / (1.0 / mass[NEAR] + 1.0 / mass[FAR])[:, None]
    return np.asarray(np.linalg.solve(np.diag(1.0 / mass[NEAR]) + (tie.p / mass[FAR]) @ tie.p.T, difference))


def _seam_loads(
    body: Body, sides: Sides, name: str, state: BodyState, cauchy: Floats, functions: Functions
) -> tuple[Floats, Floats]:
    """Mass (s,) [kg] of one side's seam nodes, and force (s, 3) [N] on them: stress, contact and weight."""
    region = build_region(body, sides.cells[name], sides.seam, name == NEAR)
    force = region.mass[:, None] * body.gravity
    indptr, node, weight = point_weights(body, region, functions)
    push = np.repeat(state.contact_force[region.points], np.diff(indptr), axis=0)
    np.add.at(force, node, weight[:, None] * push)

    beside = np.isin(region.cell_nodes, region.seam).any(axis=1)
    nodes, cells = region.cell_nodes[beside], region.cells[beside]
    slopes = _SLOPES[functions]
    jacobian = np.einsum("cai,oaj->coij", state.x[region.nodes[nodes]], slopes, optimize=True)
    volume = np.linalg.det(jacobian) * body.fill[cells]  # an octant is a unit cube of local coordinates
    xx, yy, zz, yz, xz, xy = np.moveaxis(cauchy[cells], 2, 0)
    stress = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=2).reshape(-1, 8, 3, 3)
    pull = volume[:, :, None, None] * stress @ np.linalg.inv(jacobian).transpose(0, 1, 3, 2)
    np.add.at(force, nodes, -np.einsum("coij,oaj->cai", pull, slopes, optimize=True))
    return region.mass[region.seam], force[region.seam]
