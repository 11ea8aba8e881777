"""Structures of the regions that were asked for last, and the tables that a region is computed with.

Of a body that differs from one that was there before in numbers alone, the order of elimination and the symbolic factor
are those of the one before.
"""

from typing import NamedTuple

from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body, Ints, Region
from softseam_services.jit import n_bytes
from softseam_services.structures import Structures
from softseam_services.tools.tool_set import ToolSet

from .model import NO_ROLLERS, Connectivity, FemModel
from .parameters import FemParameters, build_parameters

_BYTES = 200_000_000
"""of all structures together"""


class Tables(NamedTuple):
    """Of a region: its structure and its numbers. No step writes to them, so that solvers of one region may share
    them."""

    model: FemModel
    parameters: FemParameters


FemStructures = Structures[Connectivity, FemModel]


def no_structures() -> FemStructures:
    """None known yet."""
    return Structures(Connectivity.ordered, n_bytes, _BYTES)


def build_tables(
    body: Body,
    region: Region,
    tools: ToolSet | None = None,
    spec: FemSpec | None = None,
    rollers: Ints = NO_ROLLERS,
    structures: FemStructures | None = None,
) -> Tables:
    """Of a region of a body; spec: which element, the default's where it is None; rollers: as of the model;
    structures: those that are known, which gain this one."""
    connectivity = Connectivity(body, region, tools, spec, rollers)
    model = connectivity.ordered() if structures is None else structures.find(connectivity)
    return Tables(model, build_parameters(model, body, region, tools, spec))
