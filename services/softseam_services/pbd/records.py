"""What kernels of a PBD region take by reference."""

from __future__ import annotations

from typing import NamedTuple

from softseam_services.body.body import Floats, Ints
from softseam_services.by_reference import by_reference

from .kernels.block import Constants


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
