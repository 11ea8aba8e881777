"""Elements by their names in the scene file."""

from collections.abc import Callable

from softseam_protocol.table import Table
from softseam_services.body.body import Floats

from . import hexahedra, tetrahedra
from .table import Table as ElementTable

__all__ = ["ELEMENTS", "ElementTable"]

ELEMENTS: Table[Callable[[Floats, float], ElementTable]] = Table(
    "builders of elements",
    {
        "hex27": hexahedra.hex27,
        "hex27_full": hexahedra.hex27_full,
        "hex27_reduced": hexahedra.hex27_reduced,
        "hex8": hexahedra.hex8,
        "hex8_bbar": hexahedra.hex8_bbar,
        "hex8_full": hexahedra.hex8_full,
        "hex8_reduced": hexahedra.hex8_reduced,
        "tet4": tetrahedra.tet4,
        "tet4_fbar": tetrahedra.tet4_fbar,
        "tet10": tetrahedra.tet10,
    },
)
"""(nodes of t cells (t, 27, 3) [m], Poisson's ratio) -> table; raises MeshError where a cell is turned over"""
