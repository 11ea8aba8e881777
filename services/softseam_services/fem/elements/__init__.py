"""One file an element; the table has one row a name of the scene file."""

from collections.abc import Callable

from softseam_protocol.table import Table
from softseam_services.body.body import Floats

from . import hex8, hex8_bbar, hex8_full, hex8_reduced, hex27, hex27_full, hex27_reduced, tet4, tet4_fbar, tet10
from .table import Table as ElementTable

__all__ = ["ELEMENTS", "ElementTable"]

ELEMENTS: Table[Callable[[Floats, float], ElementTable]] = Table(
    "builders of elements",
    {
        "hex27": hex27.build,
        "hex27_full": hex27_full.build,
        "hex27_reduced": hex27_reduced.build,
        "hex8": hex8.build,
        "hex8_bbar": hex8_bbar.build,
        "hex8_full": hex8_full.build,
        "hex8_reduced": hex8_reduced.build,
        "tet4": tet4.build,
        "tet4_fbar": tet4_fbar.build,
        "tet10": tet10.build,
    },
)
"""(nodes of t cells (t, 27, 3) [m], Poisson's ratio) -> table; raises MeshError where a cell is turned over"""
