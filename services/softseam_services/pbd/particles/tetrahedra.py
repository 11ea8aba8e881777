"""Constraints on the tetrahedra of a mesh: shapes at rest, and compliances from a material's constants.

The textbook's mapping, with units (docs/guide/sheets-and-ropes.md): a spring has 1/k [m/N]; volume, as V - V_0,
V_0/K [m^3/Pa]; a strain, which has no unit, 1/(modulus times volume) [1/J].
"""

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.elastic_constants import ElasticConstants

from .batches import Batches, batches
from .kernels.tetrahedron import rest_shapes


@dataclass(frozen=True)
class Tetrahedra:
    """m tetrahedra in b batches, ready for the kernels `neo_hookean` and `strain`."""

    batches: Batches
    volume: Floats
    """at rest (m,) [m^3]"""
    inverse: Floats
    """D_m^-1, row by row (b, 9, 8) [1/m]"""

    def pair(self, elastic: ElasticConstants) -> tuple[Floats, Floats]:
        """Compliances of the neo-Hookean pair (b, 2, 8) [1/J], and gamma (b, 8)."""
        bulk = elastic.lambda_ + elastic.mu
        alpha = np.stack([1.0 / (elastic.mu * self.volume), 1.0 / (bulk * self.volume)], axis=1)
        gamma = np.full(len(self.volume), 1.0 + elastic.mu / bulk)
        return self.batches.lanes(alpha), self.batches.lanes(gamma)

    def strains(self, elastic: ElasticConstants) -> Floats:
        """Compliances of stretches, shears and the trace (b, 3, 8) [1/J]; lambda must be positive."""
        moduli = np.array([2.0 * elastic.mu, elastic.mu, elastic.lambda_])
        return self.batches.lanes(1.0 / (self.volume[:, None] * moduli))


def build_tetrahedra(x_rest: Floats, nodes: Ints, laid_out: Batches | None = None) -> Tetrahedra:
    """From rest positions (n, 3) and corners (m, 4), in batches where these are known. Raises ValueError where a
    tetrahedron is flat or inside out."""
    nodes = np.ascontiguousarray(nodes, dtype=np.int32)
    inverse, volume = np.empty((len(nodes), 3, 3)), np.empty(len(nodes))
    rest_shapes(x_rest, nodes, inverse, volume)
    bad = np.flatnonzero(~(volume > 0.0))
    if len(bad):
        raise ValueError(f"tetrahedron {bad[0]} has the volume {volume[bad[0]]:.3g} m^3: order its corners outwards")
    made = batches(len(x_rest), nodes) if laid_out is None else laid_out
    return Tetrahedra(made, volume, made.lanes(inverse.reshape(-1, 9)))
