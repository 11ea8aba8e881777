"""What a PBD region is, built once: blocks, nodes, surface points, tools, and how many substeps a step takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.models import PbdSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.errors import SettingError
from softseam_services.body.interpolate import point_weights
from softseam_services.tools.tool_set import ToolSet

from .blocks import Blocks, build_blocks, make_viscous, mean_lag
from .edges import Edges, build_edges
from .kernels.block import new_workspace
from .kernels.damping import LEAST_KAPPA
from .kernels.frequency import MARGIN as FREQUENCY_MARGIN
from .kernels.frequency import highest_frequency
from .kernels.share import find_shares, slip_of_patches
from .levels import Levels, build_levels, coarse_cells

KAPPA = 0.5
"""share of the largest local compliance that the local solve counts with; 0.5 to 0.6 gave the longest stable substeps
on Simpson masses, where the nodes of a block differ by up to 8"""
STABLE = ((0.0, 0.2, 0.3, 0.4, 0.45), (0.9, 1.3, 1.75, 2.1, 2.6))
"""largest omega_max h with one sweep against Poisson's ratio; measured by undamped random kicks, see the decision note.
An explicit step has 2."""
TOUCHED = ((0.0, 0.2, 0.3, 0.4, 0.45, 0.49), (0.9, 1.0, 1.3, 1.8, 2.0, 2.1))
"""the same where tools may touch: beyond, blocks between smooth walls gain energy (decision 22), points chatter and
friction holds less than it should (decision 22)"""
TWO_SWEEPS = 1.5
"""how much longer a substep may be with two sweeps and more"""
SHORTER, LONG = 2.0, 25.0
"""how many times shorter substeps are where stress is viscous, and the damping time up to which that is enough, in
longest undamped substeps; beyond it grows with the time's root (decision 24)"""
SHOWN = 0.8
"""what slow modes lag by, of what blocks do whose nodes do not give way: 0.55 to 1.16 on 23 bodies (decision 24)"""
EXPLICIT = 1.5
"""omega_max h that leapfrog takes; squeezed blocks swing faster than at rest: kicked at random, from 1.7 on some bodies
gain energy"""
EXPLICIT_LIMIT = 2.0
"""omega_max h from which on leapfrog is unstable"""


def shorter_by(rate: float, time: float) -> float:
    """How many times shorter than without it substeps are where stress is damped by `time` [s].

    rate: one over the longest substep without [1/s]
    """
    times = rate * time
    return max(1.0, min(2.0 * times, SHORTER * float(np.sqrt(max(1.0, times / LONG)))))


@dataclass(frozen=True)
class PbdModel:
    """n nodes, p surface points, t tools."""

    body: Body
    region: Region
    tools: ToolSet
    spec: PbdSpec
    levels: Levels
    blocks: Blocks
    mass: Floats
    """of nodes, those that hang have given theirs away (n,) [kg]"""
    inverse_mass: Floats
    """0 for clamped nodes and nodes without mass (n,) [1/kg]"""
    seam: Ints
    """nodes that the region's seam follows (m,)"""
    seam_weight: Floats | None
    """what each of these gives to each node of the region's seam (s, m); None where they are the same"""
    softness: Floats
    """8 times the largest inverse mass of each block's nodes (n_batches, 4) [1/kg]"""
    x_rest: Floats
    indptr: Ints
    node: Ints
    weight: Floats
    """points follow nodes: sparse rows, see `point_weights`"""
    point_softness: Floats
    """sum of w_i N_i^2 of each point (p,) [1/kg]"""
    active: NDArray[np.bool_]
    """points that can touch (p,)"""
    edges: Edges
    frequency: float
    """highest angular frequency of the region at rest [rad/s]"""

    @property
    def n_nodes(self) -> int:
        return len(self.region.nodes)

    @property
    def n_points(self) -> int:
        return len(self.region.points)

    @property
    def n_tools(self) -> int:
        return len(self.tools.names)

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
        return max(1, int(np.ceil(dt * self._rate * shorter_by(self._rate, self.spec.damping.stiffness) - 1e-9)))

    @property
    def viscous_times(self) -> float:
        """The time of damping in proportion to stiffness, in longest substeps without it [1]."""
        return self._rate * self.spec.damping.stiffness

    @cached_property
    def lag(self) -> float:
        """kappa k of `kernels.damping`, eq. (3) [1/s^2]: the mean over volume, blocks that are softer counting more."""
        return SHOWN * LEAST_KAPPA * mean_lag(self.blocks, self.softness)

    @cached_property
    def _rate(self) -> float:
        """One over the longest stable substep without damping [1/s]."""
        touched = bool(self.active.any() and self.n_tools > 0)
        table = TOUCHED if touched else STABLE
        cells = self.region.cells
        used = np.unique(self.body.octant_material[cells][self.body.fill[cells] > 0.0])
        here = (self.body.materials[number] for number in used)
        limit = min(float(np.interp(0.5 * material.young / material.mu - 1.0, *table)) for material in here)
        return self.frequency / (limit * TWO_SWEEPS if self.spec.sweeps > 1 else limit)

    def find_shares(self, x: Floats, position: Floats, orientation: Floats) -> None:
        """What tools with edges cover of points, where the nodes are at x (n, 3): `edges` updated in place."""
        if len(self.edges.faces):
            find_shares(x, self.tools.shape, position, orientation, self.edges)

    def slip_at_edges(self, force: Floats, slip: Floats) -> float:
        """Largest slip under tools with edges where points are covered in part [m]; force, slip (p, t, 3)."""
        return float(slip_of_patches(self.edges, self.tools.near, force, slip)) if len(self.edges.faces) else 0.0

    def seam_force(self, force: Floats) -> Floats:
        """Forces (s, 3) [N] on the region's seam as forces on the nodes that it follows (m, 3); (0, 3) stays."""
        return force if self.seam_weight is None or len(force) == 0 else self.seam_weight.T @ force

    @property
    def explicit(self) -> bool:
        """Whether the region is stepped by leapfrog."""
        return self.spec.method == "leapfrog"


def build_model(scene: Scene, body: Body, region: Region, tools: ToolSet) -> PbdModel:
    """Everything of a PBD region that never changes. Raises SettingError where the material has state."""
    if body.material.n_state:
        raise SettingError(f"regions: pbd does not know the state of {body.material.kind}: give all cells to fem")
    spec = scene.models.pbd
    if body.material.retardation_time > 0.0:
        damping = spec.damping.model_copy(update={"stiffness": body.material.retardation_time})
        spec = spec.model_copy(update={"damping": damping})
    levels = build_levels(region, coarse_cells(body, spec.coarse, tools)[region.cells])
    blocks = build_blocks(body, region, spec.hourglass, levels)
    mass = levels.gathered(region.mass)
    inverse_mass = np.zeros(len(region.nodes))
    free = ~region.fixed & (mass > 0.0)
    inverse_mass[free] = 1.0 / mass[free]
    padded = np.concatenate([inverse_mass, np.zeros(8)])
    x_rest = np.ascontiguousarray(body.x_rest[region.nodes])
    indptr, node, weight = rows = levels.rows(*point_weights(body, region, "hex8"))
    seam, seam_weight = region.seam, None
    if levels.ties is not None:
        of_seam = levels.ties[region.seam]
        seam = np.unique(of_seam.indices).astype(np.int32)
        seam_weight = of_seam[:, seam].toarray()
    model = PbdModel(
        body=body,
        region=region,
        tools=tools,
        spec=spec,
        levels=levels,
        blocks=blocks,
        mass=mass,
        inverse_mass=inverse_mass,
        seam=seam,
        seam_weight=seam_weight,
        softness=np.ascontiguousarray(8.0 * padded[blocks.nodes].max(axis=1)),
        x_rest=x_rest,
        indptr=indptr,
        node=node,
        weight=weight,
        point_softness=np.add.reduceat(weight**2 * inverse_mass[node], indptr[:-1]) if len(node) else np.zeros(0),
        active=levels.touching(body.surface.area[region.points] > 0.0, rows, region.seam),
        edges=build_edges(body, region, tools, levels),
        frequency=highest_frequency(
            new_workspace(),
            x_rest,
            inverse_mass,
            blocks.nodes,
            blocks.volume,
            blocks.constants,
            blocks.law,
            blocks.padding_x,
        ),
    )
    make_viscous(blocks, model.viscous_times)
    return model
