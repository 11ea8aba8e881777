"""The numbers of a PBD region: masses, elasticity, damping, gravity, places at rest, tools.

Another modulus, friction or size is another set of these on the same structure.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.models import PbdSpec
from softseam_services.body.body import Body, Floats, Region
from softseam_services.body.errors import SettingError
from softseam_services.body.materials.point import RELAXING
from softseam_services.tools.edged import PATCHES, with_round_edges
from softseam_services.tools.tool_set import ToolSet

from .block_parameters import BlockParameters, build_block_parameters, make_viscous, mean_lag
from .kernels.block import new_workspace
from .kernels.damping import LEAST_KAPPA
from .kernels.frequency import MARGIN as FREQUENCY_MARGIN
from .kernels.frequency import highest_frequency
from .model import PbdModel
from .points import find_points, with_bulges
from .records import ParameterArrays
from .stability import EXPLICIT, EXPLICIT_LIMIT, KAPPA, SHOWN, STABLE, TOUCHED, TWO_SWEEPS, shorter_by

SHORT = 0.25
"""of the thickness of walls: who goes no farther in a substep has not passed one [1]"""
RENEWED = 0.1
"""of the shortest time of a branch: how long what folds branches does [1]"""
MARGIN = 0.1
"""points within this many block edges of a tool, and what speeds add to it, are tried for contact"""


@dataclass(frozen=True)
class PbdParameters:
    """n nodes, b batches, p surface points, t tools."""

    spec: PbdSpec
    """with the damping that the material's viscosity asks for"""
    tools: ToolSet
    blocks: BlockParameters
    arrays: ParameterArrays
    """for the kernels"""
    own_mass: Floats
    """of nodes, each its own (n,) [kg]"""
    wave_speed: float
    """the fastest P wave's [m/s]"""
    least_mu: float
    """[Pa]"""
    frequency: float
    """highest angular frequency of the region at rest [rad/s]"""
    rate: float
    """one over the longest stable substep without damping [1/s]"""

    @property
    def explicit(self) -> bool:
        """Whether the region is stepped by leapfrog."""
        return self.spec.method == "leapfrog"

    @property
    def plans(self) -> bool:
        """Whether substeps are as many as are stable, and not the scene's number."""
        return self.spec.substeps == "auto"

    def substeps(self, dt: float) -> int:
        """`stable_substeps`, or the scene's number; SettingError where that is unstable for certain."""
        given = self.spec.substeps
        if given == "auto":
            return self.stable_substeps(dt)
        least = dt * self.frequency / (FREQUENCY_MARGIN * EXPLICIT_LIMIT)
        if self.explicit and given < least:
            raise SettingError(
                f"models.pbd.substeps: leapfrog is unstable with {given} substeps in {dt:g} s, the least is "
                f"{np.ceil(least):.0f}, and auto takes {self.stable_substeps(dt)}: leave it out, or use method: xpbd"
            )
        return given

    def stable_substeps(self, dt: float) -> int:
        """m = ceil(dt omega_max / limit)"""
        if self.explicit:
            return max(1, int(np.ceil(dt * self.frequency / EXPLICIT - 1e-9)))
        return max(1, int(np.ceil(dt * self.rate * shorter_by(self.rate, self.spec.damping.stiffness) - 1e-9)))

    @cached_property
    def slowly(self) -> float:
        """Way of a tool in a step below which it goes by slowly: a patch inside a block's face [m]."""
        return float(self.blocks.edges.min()) / PATCHES

    @cached_property
    def roundoff(self) -> float:
        """Energy that is roundoff [J]."""
        return 1e-8 * self.least_mu * float(self.blocks.volume.sum())


def with_damping_of(body: Body, spec: PbdSpec) -> PbdSpec:
    """With what the body says of both models' damping: its drag, and its material's retardation time."""
    said = {"mass": body.damping, "stiffness": body.material.retardation_time}
    damping = spec.damping.model_copy(update={part: value for part, value in said.items() if value > 0.0})
    return spec.model_copy(update={"damping": damping})


def build_parameters(model: PbdModel, body: Body, region: Region, tools: ToolSet, spec: PbdSpec) -> PbdParameters:
    """The numbers of a region of the model's structure. Raises SettingError for what blocks with state cannot do."""
    spec = with_damping_of(body, spec)
    if body.material.n_state:
        _check_memory(body, spec)
    blocks = build_block_parameters(model.blocks, body, region, spec.hourglass)
    mass = model.levels.gathered(region.mass)
    inverse_mass = np.zeros(len(region.nodes))
    free = ~region.fixed & (mass > 0.0)
    inverse_mass[free] = 1.0 / mass[free]
    x_rest = np.ascontiguousarray(body.x_rest[region.nodes])
    felt = with_round_edges(tools, body)
    points = with_bulges(find_points(body, region, felt, model.levels.coarse), body, region)
    _, _, weight = model.levels.rows(*points.rows)
    tilt = [model.levels.rows(*points.rows[:2], np.ascontiguousarray(along))[2] for along in points.tilt.T]
    frequency = highest_frequency(
        *(new_workspace(), x_rest, inverse_mass, model.blocks.nodes),
        *(blocks.volume, blocks.constants, blocks.law, blocks.padding_x),
    )
    rate = frequency / _limit(model, body, region, spec)
    viscous = make_viscous(blocks, rate * spec.damping.stiffness)
    softness = block_softness(model.blocks.nodes, inverse_mass)
    arrays = ParameterArrays(
        mass=mass,
        inverse_mass=inverse_mass,
        x_rest=x_rest,
        gravity=body.gravity,
        volume=blocks.volume,
        softness=softness,
        constants=viscous.constants,
        law=blocks.law,
        kappa=KAPPA,
        renewed=_renewed(body),
        weight=weight,
        tilt=np.stack(tilt, axis=1),
        point_softness=np.add.reduceat(weight**2 * inverse_mass[model.node], model.indptr[:-1])
        if len(weight)
        else np.zeros(0),
        point_give=points.give,
        point_lag=points.lag,
        ease=points.ease,
        friction_factor=body.friction_field.at_points(x_rest, model.indptr, model.node, weight),
        kind=felt.kind,
        shape=felt.shape,
        reach=felt.reach,
        places=felt.places,
        short=SHORT * felt.wall,
        friction=felt.friction,
        followed=felt.followed,
        margin=MARGIN * float(blocks.edges.min()),
        mass_rate=spec.damping.mass,
        stiffness_time=spec.damping.stiffness,
        lag=SHOWN * LEAST_KAPPA * mean_lag(viscous, softness),
        tolerance=spec.residual or 0.0,
    )
    return PbdParameters(
        spec=spec,
        tools=felt,
        blocks=viscous,
        arrays=arrays,
        own_mass=region.mass,
        wave_speed=body.wave_speed,
        least_mu=min(material.mu for material in body.materials),
        frequency=frequency,
        rate=rate,
    )


def _renewed(body: Body) -> float:
    """`ParameterArrays.renewed` of a body [s]."""
    if any(material.yielding for material in body.materials):
        return float(np.finfo(np.float64).tiny)
    return RENEWED * min((time for each in body.materials for _, time in each.relaxation), default=0.0)


def _check_memory(body: Body, spec: PbdSpec) -> None:
    """Raise SettingError, with its key and the remedy, for what a body whose material has state cannot do."""
    kind = body.material.kind
    key = "body.material.relaxation" if any(each.relaxation for each in body.materials) else "body.material.plasticity"
    if body.relaxes and body.material.respond != RELAXING:
        raise SettingError(
            f"{key}: pbd knows it beside neo_hookean, this is {kind}: use that, or set regions.default: fem"
        )
    what = key if body.relaxes else f"the state of {kind}"
    if spec.method == "leapfrog":
        raise SettingError(f"models.pbd.method: leapfrog does not know {what}: use xpbd")
    if spec.damping.stiffness > 0.0:
        raise SettingError(f"models.pbd.damping.stiffness, and a retardation_time, do not know {what}: leave them out")


def block_softness(nodes: NDArray[np.int32], inverse_mass: Floats) -> Floats:
    """8 times the largest inverse mass of each block's nodes (b, 4); nodes (b, 8, 4), those of the padding last."""
    padded = np.concatenate([inverse_mass, np.zeros(8)])
    return np.ascontiguousarray(8.0 * padded[nodes].max(axis=1))


def _limit(model: PbdModel, body: Body, region: Region, spec: PbdSpec) -> float:
    """Largest omega_max h that is stable, by the materials' Poisson ratios."""
    table = TOUCHED if model.touches.any() else STABLE
    used = np.unique(body.octant_material[region.cells][body.fill[region.cells] > 0.0])
    here = (body.materials[number] for number in used)
    limit = min(float(np.interp(0.5 * material.young / material.mu - 1.0, *table)) for material in here)
    return limit * TWO_SWEEPS if spec.sweeps > 1 else limit
