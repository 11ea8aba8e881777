"""What FEM's regions were computed with last, kept for the next that is the same one.

An episode is begun anew, a switch comes in every episode, a state that is put back is of a cut that was: each asks for
a region that was there before, and its tables take many times as long to build as what a solver writes to. A scene that
differs in numbers alone, be it a modulus, a coefficient of friction or a size, makes another body with other tables,
but what is joined to what in its regions, and the order of elimination, are those that were found before.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from softseam_protocol.messages.participant import Configure
from softseam_services.body.body import Body
from softseam_services.jit import n_bytes

if TYPE_CHECKING:  # a participant of PBD does not load FEM
    from softseam_services.fem.region_tables import RegionTables
    from softseam_services.fem.structures import FemStructures

_REGIONS = 4
_BYTES = 200_000_000
"""of all regions together: 30 000 cells that are boxes of the body's, 2 000 with tables of their own"""


class Built:
    """Tables of the regions that were asked for last, of one server."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, bytes, bytes, bool], tuple[Body, RegionTables]] = {}

    @cached_property
    def structures(self) -> FemStructures:
        """Those of the regions, whatever the numbers of their bodies."""
        from softseam_services.fem.structures import no_structures

        return no_structures()

    def find(self, body: Body, request: Configure) -> RegionTables | None:
        """The tables of the region of this body that a Configure asks for; None where they are not kept."""
        kept = self._kept.get(_region(body, request))
        return None if kept is None else kept[1]

    def keep(self, body: Body, request: Configure, tables: RegionTables) -> None:
        """Keep these, and of the others the latest."""
        region, kept = _region(body, request), self._kept
        kept.pop(region, None)
        kept[region] = body, tables
        while len(kept) > _REGIONS or sum(n_bytes(table) for _, tables in kept.values() for table in tables) > _BYTES:
            kept.pop(next(iter(kept)))


def _region(body: Body, request: Configure) -> tuple[int, bytes, bytes, bool]:
    """What names a region among those of bodies that live."""
    return id(body), request.cells.tobytes(), request.coupling_nodes.tobytes(), request.owns_coupling_points
