"""Elements of cells that are tetrahedra: one quadratic tetrahedron, or the eight linear ones of its parts.

With one volume ratio for all eight, the linear ones are F-bar-Patch (see `tet4_fbar`) on patches that every mesh has: a
cell then has one constraint on volume for some four freedoms of its own, without that cure it has eight.
"""

from collections.abc import Callable

import numpy as np

from softseam_protocol.table import Table
from softseam_services.body.body import Floats
from softseam_services.body.tetrahedron import NODES, OF_PARTS, PARTS

from . import table
from .table import Reference
from .table import Table as ElementTable
from .tetrahedra import quadratic


def _quadratic(fine: bool = False) -> Reference:
    """The first of a cube's six quadratic ones."""
    all_six = quadratic(fine)
    return Reference(all_six.nodes[:1], all_six.slope[:1], all_six.weight[:1], all_six.share[:1])


def _linear() -> Reference:
    """One of four nodes with one point in each part of a cell."""
    slope = np.concatenate([-np.ones((1, 3)), np.eye(3)])
    return Reference(
        nodes=NODES[PARTS],
        slope=np.tile(slope, (8, 1, 1, 1)),
        weight=np.full((8, 1), 1.0 / 6.0),
        share=np.eye(8)[OF_PARTS][:, None],
    )


_FINE, _COARSE, _LINEAR = _quadratic(fine=True), _quadratic(), _linear()


def _tet10(x: Floats) -> ElementTable:
    return table.corrected(_FINE, _COARSE, x)


def _tet4(x: Floats) -> ElementTable:
    return table.full(_LINEAR, x)


def _tet4_fbar(x: Floats) -> ElementTable:
    return table.grouped(_tet4(x), NODES[None])


OF_TETRAHEDRA: Table[Callable[[Floats], ElementTable]] = Table(
    "builders of elements of tetrahedra", {"tet10": _tet10, "tet4": _tet4, "tet4_fbar": _tet4_fbar}
)
"""nodes of t cells (t, 27, 3) [m] -> table; raises MeshError where a cell is turned over"""
