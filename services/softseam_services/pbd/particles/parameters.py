"""The numbers of a body of particles: masses, lengths and compliances of its constraints, contact, tools."""

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
from .kernels.tetrahedron import rest_shapes
from .model import ParticleModel, lay_out
from .records import ParameterArrays

SLACK = 0.005
"""strain of a body that hangs by its edge from sweeps that are not finished, which the automatic substeps allow"""
COURANT = 0.25
"""wave times of a tetrahedron that a substep with one sweep lasts; strains, whose multipliers begin at zero, are then
1 % too soft"""
FEWEST = 4
"""automatic substeps a step, at least"""
APART = 1.5
"""particles closer than this many spacings at rest are neighbours: layers that touch are farther apart"""
MARGIN = 0.8
"""spacings that a particle may move before contacts are searched anew"""


@dataclass(frozen=True)
class ParticleParameters:
    """Of a body of n particles."""

    body: ParticleBody
    tools: ToolSet
    spec: PbdSpec
    joined: Joined
    """by constraints that the scene adds: whom these join may depend on numbers"""
    arrays: ParameterArrays
    """for the kernels"""

    @property
    def classic(self) -> bool:
        """Whether stiffnesses are classic PBD's shares."""
        return self.spec.method == "pbd"

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
        if body.solid is not None and not self.classic:
            return max(FEWEST, int(np.ceil(dt / (COURANT * np.sqrt(self.spec.sweeps) * body.solid.wave_time) - 1e-9)))
        gravity = float(np.linalg.norm(body.gravity))
        count = body.reach / body.spacing
        h = np.sqrt(SLACK * body.spacing / (2.0 * count * max(gravity, 1e-12))) * np.sqrt(self.spec.sweeps)
        return max(FEWEST, int(np.ceil(dt / h - 1e-9)))


def projection_shares(spec: PbdSpec) -> tuple[float, float, float]:
    """Stiffness of a projection of springs, of bends and of volumes in classic PBD; 0 for XPBD.

    Independent of the number n of sweeps, as far as sweeps are linear: k' = 1 - (1 - k)^(1/n) (Mueller, Heidelberger,
    Hennix and Ratcliff, Position based dynamics, 2007, section 3.3).
    """
    if spec.method != "pbd":
        return 0.0, 0.0, 0.0
    given = spec.classic
    n = spec.sweeps if given.per_substep else 1
    stretch, bending, volume = (1.0 - (1.0 - k) ** (1.0 / n) for k in (given.stretch, given.bending, given.volume))
    return stretch, bending, volume


def build_parameters(
    model: ParticleModel, body: ParticleBody, tools: ToolSet, spec: PbdSpec, constraints: Sequence[ConstraintSpec] = ()
) -> ParticleParameters:
    """The numbers of a body of the model's structure. Raises as `build_constraints`."""
    layout = lay_out(body, spec)
    m = len(layout.bends)
    strains = build_tetrahedra(body.x_rest, layout.tetrahedra, model.tetrahedra)
    pairs = build_tetrahedra(body.x_rest, layout.paired, model.paired)
    elastic = ElasticConstants(1.0, 1.0) if body.solid is None else body.solid.elastic
    pair_compliance, pair_gamma = pairs.pair(elastic)
    stretch, bending, volume = projection_shares(spec)
    joined = build_constraints(body, constraints)
    arrays = ParameterArrays(
        x_rest=body.x_rest,
        mass=body.mass,
        weight=np.where(body.fixed, 0.0, 1.0 / body.mass),
        gravity=body.gravity,
        drag=float(body.damping),
        spring_rest=model.springs.lanes(body.springs.rest, 1.0),
        spring_compliance=model.springs.lanes(1.0 / body.springs.stiffness, 1.0),
        stretch_share=float(stretch),
        bend_coefficient=model.bends.lanes(body.bends.coefficient[:m]),
        bend_compliance=model.bends.lanes(1.0 / body.bends.stiffness[:m], 1.0),
        bending_share=float(bending),
        strain_inverse=strains.inverse,
        strain_compliance=strains.strains(elastic),
        pair_inverse=pairs.inverse,
        pair_compliance=pair_compliance,
        pair_gamma=pair_gamma,
        volume_rest=model.volumes.lanes(build_tetrahedra(body.x_rest, layout.volumes, model.volumes).volume, 1.0),
        volume_share=float(volume),
        families=joined.families,
        particle=joined.particle,
        parameter=joined.parameter,
        compliance=joined.compliance,
        kind=tools.kind,
        shape=tools.shape,
        reach=tools.reach,
        friction=tools.friction,
        friction_factor=body.friction_field.factor(body.x_rest),
        radius=float(body.radius),
        restitution=float(body.restitution),
        apart=APART * float(body.spacing) if body.self_contact else 0.0,
        self_friction=float(body.self_friction),
        margin=MARGIN * float(body.spacing),
        hold=float(body.radius + body.spacing),
    )
    return ParticleParameters(body=body, tools=tools, spec=spec, joined=joined, arrays=arrays)


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
