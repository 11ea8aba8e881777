"""An element in the cells of a region, as the kernels take it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.lattice import LOCAL
from softseam_services.by_reference import by_reference
from softseam_services.fem.elements import Table

# Cells whose nodes are off their box by more than this share of an edge are general hexahedra.
_BOX = 1e-9


@by_reference
class Rule(NamedTuple):
    """An element in the region's cells, for the kernels; see `elements.Table` (t shapes, b elements a cell)."""

    nodes: Ints
    """(b, m)"""
    gradient: Floats
    """(t, b, q, 3, m) [1/m]"""
    weight: Floats
    """octants' fill included (c, b q) [m^3]"""
    share: Floats
    """(b, q, 8)"""
    stabilised: bool
    stabilisation: Floats
    """mu S (t, b, m, m) [N/m]"""
    fill: Floats
    """of each element (c, b)"""
    group_nodes: Ints
    """(g, n), (0, 0) for none"""
    shape: Ints
    """which of the t shapes each cell has (c,)"""


def cell_shapes(body: Body, region: Region) -> tuple[Floats, Ints]:
    """Nodes (t, 27, 3) of cells of different shapes, and which of them each cell has (c,); boxes have one."""
    x = body.x_rest[region.nodes][region.cell_nodes]
    box = 0.5 * body.edges * (LOCAL - 1)
    x = x - x[:, 13:14]
    if np.abs(x - box).max() <= _BOX * float(body.edges.min()):
        return box[None], np.zeros(len(x), dtype=np.int32)
    return x, np.arange(len(x), dtype=np.int32)


def build_rule(table: Table, fill: Floats, mu: float, shape: Ints) -> Rule:
    """An element's table with the cells' fill (c, 8), the shear modulus and the cells' shapes (c,) in it."""
    filling = np.einsum("bqo,co->cbq", table.share, fill)
    weight = table.weight[shape] * filling
    return Rule(
        nodes=table.nodes,
        gradient=np.ascontiguousarray(table.gradient),
        weight=np.ascontiguousarray(weight.reshape(len(shape), -1)),
        share=np.ascontiguousarray(table.share),
        stabilised=bool(table.stabilisation.any()),
        stabilisation=np.ascontiguousarray(mu * table.stabilisation),
        fill=np.ascontiguousarray(fill @ table.element_share.T),
        group_nodes=table.group_nodes,
        shape=shape,
    )
