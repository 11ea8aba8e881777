"""An element in the cells of a region, as the kernels take it."""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import SAME, Body, Floats, Ints, Region
from softseam_services.body.lattice import LOCAL
from softseam_services.body.point_materials import point_moduli, point_parameters
from softseam_services.jit import record

from .elements.table import Table


@record
class Rule(NamedTuple):
    """An element in the region's cells, for the kernels; see `elements.table` (t shapes, b elements a cell)."""

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
    """of each element, times the modulus that steadies it over the body's shear modulus (c, b)"""
    group_nodes: Ints
    """(g, n), (0, 0) for none"""
    shape: Ints
    """which of the t shapes each cell has (c,)"""
    parameters: Floats
    """of the material at each point, for `body.materials.point`: of the k ways a cell is made up
    (k, b q, MAX_PARAMETERS)"""
    moduli: Floats
    """mu and lambda there (k, b q, 2) [Pa]"""
    blend: Ints
    """which of these ways each cell is (c,)"""


def cell_shapes(body: Body, region: Region) -> tuple[Floats, Ints, bool]:
    """Nodes (t, 27, 3) of cells of different shapes, which of them each cell has (c,), and whether that is one, the
    body's box; a cell that is none may be alone, too."""
    x = body.x_rest[region.nodes][region.cell_nodes]
    box = body.from_axes(0.5 * body.edges * (LOCAL - 1))
    x = x - x[:, 13:14]
    if np.abs(x - box).max() <= SAME * float(body.edges.min()):
        return box[None], np.zeros(len(x), dtype=np.int32), True
    return x, np.arange(len(x), dtype=np.int32), False


def build_rule(table: Table, fill: Floats, shear: Floats, shape: Ints, body: Body, cells: Ints) -> Rule:
    """An element's table with the fill (c, 8) of the body's cells (c,), their shapes (c,) and materials.

    shear (c, 8): fill that the stabilisation counts with
    """
    mu = body.material.mu
    relative = body.of_octants([material.steadying / mu for material in body.materials])[cells]
    weight = table.weight[shape] * np.einsum("bqo,co->cbq", table.share, fill)
    parameters, moduli, blend = _blends(body, cells, table.share.reshape(-1, 8))
    return Rule(
        nodes=table.nodes,
        gradient=np.ascontiguousarray(table.gradient),
        weight=np.ascontiguousarray(weight.reshape(len(shape), -1)),
        share=np.ascontiguousarray(table.share),
        stabilised=bool(table.stabilisation.any()),
        stabilisation=np.ascontiguousarray(mu * table.stabilisation),
        fill=np.ascontiguousarray((shear * relative) @ table.element_share.T),
        group_nodes=table.group_nodes,
        shape=shape,
        parameters=parameters,
        moduli=moduli,
        blend=blend,
    )


def _blends(body: Body, cells: Ints, share: Floats) -> tuple[Floats, Floats, Ints]:
    """`Rule.parameters`, `Rule.moduli` and `Rule.blend`: each material at all points, then each cell of more than one.

    share (b q, 8) of each point in each octant
    """
    number = body.octant_material[cells]
    whole = np.array([np.tile(material.parameters, (len(share), 1)) for material in body.materials])
    moduli = np.array([np.tile((material.mu, material.lambda_), (len(share), 1)) for material in body.materials])
    blend = number[:, 0].copy()
    mixed = np.flatnonzero((number != number[:, :1]).any(axis=1))
    blend[mixed] = len(whole) + np.arange(len(mixed))
    return (
        np.ascontiguousarray(np.concatenate([whole, point_parameters(body, cells[mixed], share)])),
        np.ascontiguousarray(np.concatenate([moduli, point_moduli(body, cells[mixed], share)])),
        blend,
    )
