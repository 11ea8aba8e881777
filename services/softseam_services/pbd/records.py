"""What kernels of a PBD region take by reference."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.by_reference import by_reference

from .blocks import Blocks
from .kernels.block import N_STRESS, Constants
from .kernels.damping import N_FRAME
from .kernels.lanes import aligned
from .kernels.monitor import N_FIGURES
from .model import PbdModel


@by_reference
class BlockArrays(NamedTuple):
    """The blocks of a region, as of `Blocks` and `PbdModel`."""

    nodes: Ints
    volume: Floats
    softness: Floats
    constants: Constants
    law: int


@by_reference
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


@by_reference
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
    asked: Floats
    """stress that shapes ask for, see `kernels.damping` (b, N_STRESS), or (0, N_STRESS) without damping"""
    frame: Floats
    """F at the start of a substep (b, N_FRAME), or (0, N_FRAME)"""
    figures: Floats
    """of each batch, see `kernels.monitor` (b, N_FIGURES)"""


def block_arrays(model: PbdModel) -> BlockArrays:
    """A region's blocks."""
    blocks = model.blocks
    return BlockArrays(blocks.nodes, blocks.volume, model.softness, blocks.constants, blocks.law)


def leap_arrays(model: PbdModel, figures: Floats) -> Leap:
    """Scratch in which each node has a row of four."""
    n = model.n_nodes
    leap = Leap(aligned(n + 8, 4), aligned(n + 8, 4), aligned(n, 4), aligned(n + 8, 4), figures)
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
        asked=aligned(damped, N_STRESS),
        frame=aligned(damped, N_FRAME),
        figures=np.zeros((b if tolerance > 0.0 else 0, N_FIGURES)),
    )
