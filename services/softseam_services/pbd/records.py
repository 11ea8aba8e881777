"""What kernels of a PBD region take by reference."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import record
from softseam_services.tools.tool_set import ToolSet

from .blocks import Blocks
from .kernels.block import N_STRESS, Constants
from .kernels.damping import N_FRAME
from .kernels.hanging import Hanging
from .kernels.lanes import LANES, aligned
from .kernels.monitor import N_FIGURES
from .kernels.pairs import N_ROWS, WIDTH
from .model import PbdModel


@record
class BlockArrays(NamedTuple):
    """The blocks of a region, as of `Blocks` and `PbdModel`."""

    nodes: Ints
    volume: Floats
    softness: Floats
    """as tools hold the nodes now, see `kernels.hold`: updated in place"""
    softness_free: Floats
    constants: Constants
    law: int


@record
class PointArrays(NamedTuple):
    """Surface points and the nodes that they follow, as of `PbdModel`."""

    indptr: Ints
    node: Ints
    weight: Floats
    softness: Floats
    active: NDArray[np.bool_]
    inverse_mass: Floats
    """of nodes (n,) [1/kg]"""
    side: Ints
    """as of `Edges`, and so is `soft`, its `give`: updated in place (p, t)"""
    soft: Floats


@record
class NodeArrays(NamedTuple):
    """Nodes of a region."""

    mass: Floats
    x_rest: Floats
    gravity: Floats
    cell_nodes: Ints
    seam: Ints
    hanging: Hanging


@record
class ToolArrays(NamedTuple):
    """Tools, as of `ToolSet`."""

    kind: NDArray[np.int64]
    shape: Floats
    reach: Floats
    friction: Floats
    near: NDArray[np.bool_]


@record
class Contacts(NamedTuple):
    """Points that may touch tools in a step, t tools, and their places now; see `kernels.pairs` and `kernels.hold`."""

    start: Ints
    rows: Ints
    pairs: Floats
    held: Ints
    held_blocks: Ints
    position: Floats
    """before and after a substep (2, t, 3) [m]"""
    orientation: Floats
    """(2, t, 4)"""
    motion: Floats
    """see `kernels.tool_motion` (2, t, 12)"""


@record
class Scratch(NamedTuple):
    """Of a step; n nodes, p points."""

    xw: Floats
    """positions and inverse masses (n + 8, 4)"""
    x_star: Floats
    push: Floats
    pull: Floats
    point_x: Floats
    newest: Ints
    node_gap: Floats
    figures: Floats
    """of each batch, see `kernels.monitor` (b, N_FIGURES)"""


@record
class Leap(NamedTuple):
    """Scratch of the explicit step; n nodes, b batches. The rows after the nodes are the padding's."""

    place: Floats
    """positions (n + 8, 4) [m]; the fourth column is not used"""
    speed: Floats
    """velocities half a substep ahead (n + 8, 4) [m/s], and inverse masses [1/kg]"""
    push: Floats
    """g of free nodes (n, 4) [m/s^2]"""
    pull: Floats
    """forces of the blocks (n + 8, 4) [N]"""
    figures: Floats
    """of each batch, see `kernels.monitor` (b, N_FIGURES)"""
    hanging: Hanging


@record
class Solve(NamedTuple):
    """How a substep is solved; b batches."""

    tolerance: float
    """residual at which sweeps stop, see `kernels.monitor`; 0: never [1]"""
    used: Ints
    """sweeps of each substep of a step, where they may stop (substeps,)"""
    mass_rate: float
    """damping that is proportional to mass [1/s]"""
    stiffness_time: float
    """damping that is proportional to stiffness [s]"""
    lag: float
    """by how much sweeps show less of it, see `kernels.damping` [1/s^2]"""
    asked: Floats
    """stress that shapes ask for, see `kernels.damping` (b, N_STRESS), or (0, N_STRESS) without damping"""
    frame: Floats
    """F at the start of a substep (b, N_FRAME), or (0, N_FRAME)"""
    figures: Floats
    """of each batch, see `kernels.monitor` (b, N_FIGURES)"""


def block_arrays(blocks: Blocks, nodes: Ints, softness: Floats) -> BlockArrays:
    """Blocks with their nodes numbered like this."""
    return BlockArrays(nodes, blocks.volume, softness.copy(), softness, blocks.constants, blocks.law)


def node_arrays(model: PbdModel) -> NodeArrays:
    """A region's nodes."""
    region = model.region
    return NodeArrays(model.mass, model.x_rest, model.body.gravity, region.cell_nodes, model.seam, model.levels.hanging)


def point_arrays(model: PbdModel) -> PointArrays:
    """A region's points."""
    edges = model.edges
    rows = model.indptr, model.node, model.weight, model.point_softness
    return PointArrays(*rows, model.active, model.inverse_mass, edges.side, edges.give)


def tool_arrays(tools: ToolSet) -> ToolArrays:
    """The tools of a region."""
    return ToolArrays(tools.kind, tools.shape, tools.reach, tools.friction, tools.near)


def new_contacts(n: int, b: int, p: int, t: int) -> Contacts:
    """Room for n nodes, b batches, p points and t tools."""
    return Contacts(
        start=np.zeros(t + 1, dtype=np.int32),
        rows=np.zeros((p * t, N_ROWS), dtype=np.int32),
        pairs=aligned(p * t, WIDTH),
        held=np.zeros(n + 8, dtype=np.int32),
        held_blocks=np.zeros(LANES * b + 1, dtype=np.int32),
        position=np.zeros((2, t, 3)),
        orientation=np.zeros((2, t, 4)),
        motion=np.zeros((2, t, 12)),
    )


def new_scratch(model: PbdModel) -> Scratch:
    """With the inverse masses of the nodes and the places of the padding in xw."""
    n, p = model.n_nodes, model.n_points
    scratch = Scratch(
        xw=aligned(n + 8, 4),
        x_star=np.zeros((n, 3)),
        push=np.zeros((n, 3)),
        pull=aligned(n + 8, 4),
        point_x=np.zeros((p, 3)),
        newest=np.zeros(n, dtype=np.int32),
        node_gap=np.zeros(n),
        figures=np.zeros((model.blocks.n_batches, N_FIGURES)),
    )
    scratch.xw[:n, 3] = model.inverse_mass
    scratch.xw[n:, :3] = model.blocks.padding_x
    return scratch


def leap_arrays(model: PbdModel, figures: Floats) -> Leap:
    """Scratch in which each node has a row of four."""
    n = model.n_nodes
    rows = aligned(n + 8, 4), aligned(n + 8, 4), aligned(n, 4), aligned(n + 8, 4)
    leap = Leap(*rows, figures, model.levels.hanging)
    leap.place[n:, :3] = model.blocks.padding_x
    leap.speed[:n, 3] = model.inverse_mass
    leap.push[model.inverse_mass > 0.0, :3] = model.body.gravity
    return leap


def solve_arrays(model: PbdModel, blocks: Blocks, substeps: int, tolerance: float) -> Solve:
    """How the region's substeps are solved on some of its blocks; at most `substeps` a step."""
    spec, b = model.spec, blocks.n_batches
    damped = b if spec.damping.stiffness > 0.0 else 0
    return Solve(
        tolerance=tolerance,
        used=np.zeros(substeps if tolerance > 0.0 else 0, dtype=np.int32),
        mass_rate=spec.damping.mass,
        stiffness_time=spec.damping.stiffness,
        lag=model.lag,
        asked=aligned(damped, N_STRESS),
        frame=aligned(damped, N_FRAME),
        figures=np.zeros((b if tolerance > 0.0 else 0, N_FIGURES)),
    )
