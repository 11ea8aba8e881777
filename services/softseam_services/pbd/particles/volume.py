"""Volume of a tetrahedron: C = V - V_0 with V = (x_1 - x_0) x (x_2 - x_0) . (x_3 - x_0)/6.

Gradients: grad_1 = (x_2 - x_0) x (x_3 - x_0)/6 and so on in turn, grad_0 = -(grad_1 + grad_2 + grad_3). For a bulk
modulus K the energy is 1/2 K V_0 (V/V_0 - 1)^2 = 1/2 C^2/alpha with alpha = V_0/K [m^3/Pa].
"""

import numpy as np

from softseam_protocol.scene.particles import VolumeSpec
from softseam_services.body.particles import ParticleBody

from .constraint import Constraint, Joins


def joins(spec: VolumeSpec, body: ParticleBody) -> Joins:
    """Corners and volume at rest of every tetrahedron."""
    if body.solid is None:
        return Joins(np.zeros((0, 4), dtype=np.int32), np.zeros((0, 1)), np.zeros(0))
    corners = body.x_rest[body.solid.nodes]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    return Joins(body.solid.nodes, volume[:, None], volume / spec.bulk)


def value(x, parameters, gradient):  # type: ignore[no-untyped-def]
    """C of four corners x (4, 3), parameters V_0."""
    for k in range(3):
        for axis in range(3):
            p, q = (axis + 1) % 3, (axis + 2) % 3
            i, j = 1 + (k + 1) % 3, 1 + (k + 2) % 3
            ip, iq, jp, jq = x[i, p] - x[0, p], x[i, q] - x[0, q], x[j, p] - x[0, p], x[j, q] - x[0, q]
            gradient[1 + k, axis] = (ip * jq - iq * jp) / 6.0
    volume = 0.0
    for axis in range(3):
        gradient[0, axis] = -(gradient[1, axis] + gradient[2, axis] + gradient[3, axis])
        volume += (x[1, axis] - x[0, axis]) * gradient[1, axis]
    return volume - parameters[0]


VOLUME = Constraint(joins, value)
