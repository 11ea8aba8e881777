"""What PBD needs of a body of particles, built once: constraints in batches, compliances, substeps a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softseam_protocol.scene.models import PbdSpec
from softseam_protocol.scene.particles import ConstraintSpec
from softseam_services.body.body import Floats, Ints
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.particles import ParticleBody
from softseam_services.tools.tool_set import ToolSet

from .batches import Batches, batches
from .constraints import Joined, build_constraints
from .tetrahedra import Tetrahedra, build_tetrahedra

SLACK = 0.005
"""strain of a body that hangs by its edge from sweeps that are not finished, which the automatic substeps allow"""
COURANT = 0.25
"""wave times of a tetrahedron that a substep with one sweep lasts; strains, whose multipliers begin at zero, are then
1 % too soft"""
FEWEST = 4
"""automatic substeps a step, at least"""
APART = 1.5
"""particles closer than this many spacings at rest are neighbours: layers that touch are farther apart"""


@dataclass(frozen=True)
class ParticleModel:
    """n particles, t tools."""

    body: ParticleBody
    tools: ToolSet
    spec: PbdSpec
    weight: Floats
    """inverse masses, 0 for clamped particles (n,) [1/kg]"""
    springs: Batches
    spring_rest: Floats
    """(b, 8) [m]; 1 in empty lanes"""
    spring_compliance: Floats
    """(b, 8) [m/N]"""
    bends: Batches
    bend_coefficient: Floats
    """(c, 4, 8)"""
    bend_compliance: Floats
    """(c, 8) [m/N]"""
    tetrahedra: Tetrahedra
    """held by strains"""
    strain_compliance: Floats
    """of stretches, shears and the trace (d, 3, 8) [1/J]"""
    paired: Tetrahedra
    """held by neo-Hookean pairs"""
    pair_compliance: Floats
    """of C_D and C_H (e, 2, 8) [1/J]"""
    pair_gamma: Floats
    """(e, 8) [1]"""
    joined: Joined
    """by constraints that the scene adds"""

    @property
    def classic(self) -> bool:
        """Whether stiffnesses are classic PBD's shares."""
        return self.spec.method == "pbd"

    def shares(self) -> tuple[float, float]:
        """Stiffness of a projection of springs and of bends in classic PBD; 0 for XPBD."""
        if not self.classic:
            return 0.0, 0.0
        given = self.spec.classic
        if given.per_substep:
            n = self.spec.sweeps
            return 1.0 - (1.0 - given.stretch) ** (1.0 / n), 1.0 - (1.0 - given.bending) ** (1.0 / n)
        return given.stretch, given.bending

    def substeps(self, dt: float) -> int:
        """The scene's number, or so many that unfinished sweeps let a hanging body stretch by no more than `SLACK`.

        A sweep moves a particle by all that its neighbours ask, but news of the load travels one spacing a sweep. A
        line of N spacings s that hangs by its end wants h^2 g of correction at each particle in each substep; the
        uppermost spring passes N of them on, so it is stretched by up to 2 N h^2 g however stiff it is: h = sqrt(SLACK
        s/(2 N g)).
        """
        if self.spec.substeps != "auto":
            return self.spec.substeps
        body = self.body
        if body.solid is not None:
            return max(FEWEST, int(np.ceil(dt / (COURANT * np.sqrt(self.spec.sweeps) * body.solid.wave_time) - 1e-9)))
        gravity = float(np.linalg.norm(body.gravity))
        count = body.reach / body.spacing
        h = np.sqrt(SLACK * body.spacing / (2.0 * count * max(gravity, 1e-12))) * np.sqrt(self.spec.sweeps)
        return max(FEWEST, int(np.ceil(dt / h - 1e-9)))


def build_model(
    body: ParticleBody, tools: ToolSet, spec: PbdSpec, constraints: Sequence[ConstraintSpec] = ()
) -> ParticleModel:
    """Everything of a body that never changes. Raises as `build_constraints`."""
    weight = np.where(body.fixed, 0.0, 1.0 / body.mass)
    springs = batches(body.n_nodes, body.springs.nodes)
    keep = spec.method == "xpbd" or spec.classic.bending > 0.0
    nodes: Ints = body.bends.nodes if keep else body.bends.nodes[:0]
    coefficient, stiffness = body.bends.coefficient[: len(nodes)], body.bends.stiffness[: len(nodes)]
    bends = batches(body.n_nodes, nodes)
    none = np.zeros((0, 4), dtype=np.int32)
    solid = body.solid
    by_pairs = solid is not None and solid.law == "neo_hookean"
    tetrahedra = build_tetrahedra(body.x_rest, none if solid is None or by_pairs else solid.nodes)
    paired = build_tetrahedra(body.x_rest, solid.nodes if solid is not None and by_pairs else none)
    elastic = ElasticConstants(1.0, 1.0) if body.solid is None else body.solid.elastic
    pair_compliance, pair_gamma = paired.pair(elastic, 1.0)
    return ParticleModel(
        body=body,
        tools=tools,
        spec=spec,
        weight=weight,
        springs=springs,
        spring_rest=springs.lanes(body.springs.rest, 1.0),
        spring_compliance=springs.lanes(1.0 / body.springs.stiffness, 1.0),
        bends=bends,
        bend_coefficient=bends.lanes(coefficient),
        bend_compliance=bends.lanes(1.0 / stiffness, 1.0),
        tetrahedra=tetrahedra,
        strain_compliance=tetrahedra.strains(elastic, 1.0),
        paired=paired,
        pair_compliance=pair_compliance,
        pair_gamma=pair_gamma,
        joined=build_constraints(body, constraints),
    )
