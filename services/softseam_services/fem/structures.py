"""Structures of the regions that were asked for last, and the tables that a region is computed with.

Of a body that differs from one that was there before in numbers alone, the order of elimination and the symbolic factor
are those of the one before.
"""

from typing import NamedTuple

from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body, Ints, Region
from softseam_services.jit import n_bytes
from softseam_services.tools.tool_set import ToolSet

from .model import NO_ROLLERS, Connectivity, FemModel
from .parameters import FemParameters, build_parameters

_KEPT = 8
_BYTES = 200_000_000
"""of all structures together"""


class Tables(NamedTuple):
    """Of a region: its structure and its numbers. No step writes to them, so that solvers of one region may share
    them."""

    model: FemModel
    parameters: FemParameters


class Structures:
    """Kept by what names them, the latest in use last."""

    def __init__(self) -> None:
        self._kept: dict[bytes, FemModel] = {}

    def find(self, connectivity: Connectivity) -> FemModel:
        """The structure of this connectivity, built where it is not kept."""
        name, kept = connectivity.name, self._kept
        kept[name] = model = kept.pop(name, None) or connectivity.ordered()
        while len(kept) > 1 and (len(kept) > _KEPT or sum(map(n_bytes, kept.values())) > _BYTES):
            kept.pop(next(iter(kept)))
        return model


def build_tables(
    body: Body,
    region: Region,
    tools: ToolSet | None = None,
    spec: FemSpec | None = None,
    rollers: Ints = NO_ROLLERS,
    structures: Structures | None = None,
) -> Tables:
    """Of a region of a body; spec: which element, the default's where it is None; rollers: as of the model;
    structures: those that are known, which gain this one."""
    connectivity = Connectivity(body, region, tools, spec, rollers)
    model = connectivity.ordered() if structures is None else structures.find(connectivity)
    return Tables(model, build_parameters(model, body, region, tools, spec))
