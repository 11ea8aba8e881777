"""The first multiplier of a new seam: the force that lets both parts start with the same acceleration.

A cut opens nothing yet, but each part then lacks the force that the other one's cells put on the shared nodes. With F
the sum of stress, contact and weight on the seam's nodes, m their masses, and x_a = P x_b + c the tie,

    (F_a + lambda)/m_a = P (F_b - P^T lambda)/m_b                                                              (1)

Stress counts with its value in the middle of each octant, in the trace of the part's own model.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.mortar import SeamTie
from softseam_protocol.messages.participant import BodyState
from softseam_services.body.body import Body
from softseam_services.body.interpolate import Functions, hex27, point_weights
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.region import build_region
from softseam_services.orchestrator.parts import Parts

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_MIDDLES = np.array([(o & 1, o >> 1 & 1, o >> 2) for o in range(8)]) - 0.5
"""middles of a cell's octants in local coordinates (8, 3)"""


@cache
def _slopes(functions: Functions) -> Floats:
    """Derivatives of a cell's 27 functions at the octants' middles (8, 27, 3), local coordinates in [-1, 1].

    Of tetrahedra those of hexahedra, which are near enough for a first guess.
    """
    out = np.zeros((8, 27, 3))
    if functions in ("hex27", "tet10"):
        value = np.empty(27)
        for middle, slopes in zip(_MIDDLES, out, strict=True):
            hex27(middle, value, slopes)
    else:
        corners = 2.0 * LOCAL[OCTANT_NODES[0]] - 1.0
        for octant, nodes in enumerate(OCTANT_NODES):
            out[octant, nodes] = corners / 4.0
    return out


def first_multiplier(
    body: Body, parts: Parts, state: BodyState, cauchy: Floats, tie: SeamTie, functions: Mapping[str, Functions]
) -> Floats:
    """Forces on the first part (s, 3) [N], eq. (1).

    functions  what each model interpolates with
    cauchy  (C, 8, 6)  stress of the merged body in each octant, xx yy zz yz xz xy [Pa]
    """
    loads = [_seam_loads(body, parts, part, state, cauchy, functions[model]) for part, model in parts.models.items()]
    (m_a, force_a), (m_b, force_b) = loads
    beyond = force_b / m_b[:, None]
    difference = (beyond if tie.p is None else tie.p @ beyond) - force_a / m_a[:, None]
    if tie.p is None:
        return difference / (1.0 / m_a + 1.0 / m_b)[:, None]
    return np.asarray(np.linalg.solve(np.diag(1.0 / m_a) + (tie.p / m_b) @ tie.p.T, difference))


def _seam_loads(
    body: Body, parts: Parts, name: str, state: BodyState, cauchy: Floats, functions: Functions
) -> tuple[Floats, Floats]:
    """Mass (s,) [kg] of one part's seam nodes, and force (s, 3) [N] on them: stress, contact and weight."""
    region = build_region(body, parts.cells[name], parts.seam, parts.owns_points(name))
    force = region.mass[:, None] * body.gravity
    indptr, node, weight = point_weights(body, region, functions)
    push = np.repeat(state.contact_force[region.points], np.diff(indptr), axis=0)
    np.add.at(force, node, weight[:, None] * push)

    beside = np.isin(region.cell_nodes, region.seam).any(axis=1)
    nodes, cells = region.cell_nodes[beside], region.cells[beside]
    slopes = _slopes(functions)
    jacobian = np.einsum("cai,oaj->coij", state.x[region.nodes[nodes]], slopes, optimize=True)
    volume = np.linalg.det(jacobian) * body.fill[cells]  # an octant is a unit cube of local coordinates
    xx, yy, zz, yz, xz, xy = np.moveaxis(cauchy[cells], 2, 0)
    stress = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=2).reshape(-1, 8, 3, 3)
    pull = volume[:, :, None, None] * stress @ np.linalg.inv(jacobian).transpose(0, 1, 3, 2)
    np.add.at(force, nodes, -np.einsum("coij,oaj->cai", pull, slopes, optimize=True))
    return region.mass[region.seam], force[region.seam]
