"""An element in the cells of a region, as the kernels take it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Body, Floats, Ints, Material, Region
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
    """of each element, times its shear modulus over the body's (c, b)"""
    group_nodes: Ints
    """(g, n), (0, 0) for none"""
    shape: Ints
    """which of the t shapes each cell has (c,)"""
    parameters: Floats
    """of the material at each point, for `body.materials.point`: of the k ways a cell is made up (k, b q, 3)"""
    blend: Ints
    """which of these ways each cell is (c,)"""


def cell_shapes(body: Body, region: Region) -> tuple[Floats, Ints]:
    """Nodes (t, 27, 3) of cells of different shapes, and which of them each cell has (c,); boxes have one."""
    x = body.x_rest[region.nodes][region.cell_nodes]
    box = 0.5 * body.edges * (LOCAL - 1)
    x = x - x[:, 13:14]
    if np.abs(x - box).max() <= _BOX * float(body.edges.min()):
        return box[None], np.zeros(len(x), dtype=np.int32)
    return x, np.arange(len(x), dtype=np.int32)


def build_rule(table: Table, fill: Floats, shape: Ints, materials: tuple[Material, ...], number: Ints) -> Rule:
    """An element's table with the cells' fill (c, 8), their shapes (c,), and the materials of their octants (c, 8)."""
    mu = materials[0].mu
    relative = np.array([material.mu / mu for material in materials])[number]
    weight = table.weight[shape] * np.einsum("bqo,co->cbq", table.share, fill)
    parameters, blend = _blends(table.share.reshape(-1, 8), fill, np.array([m.parameters for m in materials]), number)
    return Rule(
        nodes=table.nodes,
        gradient=np.ascontiguousarray(table.gradient),
        weight=np.ascontiguousarray(weight.reshape(len(shape), -1)),
        share=np.ascontiguousarray(table.share),
        stabilised=bool(table.stabilisation.any()),
        stabilisation=np.ascontiguousarray(mu * table.stabilisation),
        fill=np.ascontiguousarray((fill * relative) @ table.element_share.T),
        group_nodes=table.group_nodes,
        shape=shape,
        parameters=parameters,
        blend=blend,
    )


def _blends(share: Floats, fill: Floats, parameters: Floats, number: Ints) -> tuple[Floats, Ints]:
    """`Rule.parameters` and `Rule.blend`: the m materials at all points, then every cell that has more than one.

    share (b q, 8), fill (c, 8), parameters (m, 3), number (c, 8). A point between octants has the mean of their
    constants, by volume.
    """
    blend = number[:, 0].copy()
    mixed = np.flatnonzero((number != number[:, :1]).any(axis=1))
    blend[mixed] = len(parameters) + np.arange(len(mixed))
    weight = share[None] * fill[mixed][:, None]
    blended = np.einsum("cqo,cop->cqp", weight, parameters[number[mixed]]) / weight.sum(axis=2)[..., None]
    whole = np.repeat(parameters[:, None], len(share), axis=1)
    return np.ascontiguousarray(np.concatenate([whole, blended])), blend
