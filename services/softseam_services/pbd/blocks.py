"""The blocks of a region, coloured and laid out for the sweep; built once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.materials.point import NEO_HOOKEAN

from .forms import SIGNS, build_forms
from .hourglass import block_constants
from .kernels.block import MU, Constants, G
from .kernels.form import N_FORM
from .kernels.lanes import LANES
from .levels import Levels, build_levels
from .particles.kernels.coloring import MOST_COLORS, color_tiles

Longs = NDArray[np.int64]

VERY_FLAT, MOSTLY = 5.0, 5.0
"""longest edge over the shortest, and a damping time in longest undamped substeps (decision 24)"""


@dataclass(frozen=True)
class Blocks:
    """Blocks in batches of 4 that share no node, colour after colour (n_batches * 4 = padded blocks).

    Octants of a lattice take 8 colours by the parity of their place, in a fixed order, so a sweep is deterministic;
    those of hexahedra that meet anyhow the least colour that is free, octant after octant, which in a lattice is the
    same. In a colour the batches of one material follow those of another. The last batch of a colour and material is
    filled up with an empty block on 8 nodes of its own, which never move.
    """

    nodes: Ints
    """local node ids, n .. n + 7 for padding (n_batches, 8 nodes, 4 lanes)"""
    volume: Floats
    """fill times volume, 0 for padding (n_batches, 4 lanes) [m^3]"""
    octant: Ints
    """8 cell + octant of each lane, 8 cell where it is the whole cell, -1 for padding (n_batches, 4 lanes)"""
    colours: Ints
    """where the batches of each colour begin, and the end (c + 1,)"""
    edges: Floats
    """of boxes, else the shortest of all (3,) [m]"""
    constants: Constants
    padding_x: Floats
    """rest positions of the padding's nodes (8, 3) [m]"""
    law: int
    """number of the materials' kind in `body.materials.point`"""

    @property
    def n_batches(self) -> int:
        return len(self.nodes)


def build_blocks(
    body: Body, region: Region, hourglass: str, levels: Levels | None = None, only: Ints | None = None
) -> Blocks:
    """Colour the filled octants of the region's cells, and its coarse cells; `only` restricts them to these ids."""
    if levels is None:
        levels = build_levels(region, np.zeros(len(region.cells), dtype=np.bool_))
    coarse = levels.coarse
    whole = bool(coarse.all())
    boxes = body.boxes and (whole or not coarse.any())
    edges = body.edges if whole else body.edges / 2.0
    fill = body.fill[region.cells].ravel()
    ids = np.flatnonzero((fill > 0.0) & ((np.arange(len(fill)) % 8 == 0) | ~np.repeat(coarse, 8)))
    if only is not None:
        ids = np.intersect1d(ids, only)
    ids_nodes, weight = levels.block_nodes(region, ids)
    if boxes and whole:
        colour = (body.cell_grid[region.cells[ids // 8]] & 1) @ np.array([1, 2, 4])
    else:
        # The place of an octant in the lattice is 2 grid + (i, j, k), so its parity is (i, j, k): colour = octant.
        colour = ids % 8 if boxes else _colours(ids, ids_nodes, len(region.nodes))
    material = body.octant_material[region.cells].ravel()[ids]
    lanes: list[Longs] = []
    ends, numbers = [0], []
    for each in range(int(colour.max(initial=7)) + 1):
        for number in range(len(body.materials)):
            members = np.flatnonzero((colour == each) & (material == number))
            pad = -len(members) % LANES
            lanes.append(np.concatenate([members, np.full(pad, -1)]))
            numbers += [number] * (len(lanes[-1]) // LANES)
        ends.append(len(numbers))
    order = np.concatenate(lanes).reshape(-1, LANES)
    real = order >= 0
    nodes = np.empty((*order.shape, 8), dtype=np.int32)
    nodes[...] = len(region.nodes) + np.arange(8)
    nodes[real] = ids_nodes[order[real]]
    padding_x = 0.5 * (1.0 + SIGNS) * edges
    if boxes:
        volume = fill[ids] * edges.prod()
        table = np.stack([block_constants(each, edges, hourglass) for each in body.materials])
        constants = Constants(table, np.array(numbers, dtype=np.int32))
    else:
        x = np.concatenate([body.x_rest[region.nodes[ids_nodes]], padding_x[None]])
        if weight is not None:
            weight = np.concatenate([weight, np.eye(8)[None]])
        forms, volume = np.empty((len(x), N_FORM)), np.empty(len(x))
        material = np.append(material, 0)
        for number, of in enumerate(body.materials):
            mine = material == number
            forms[mine], volume[mine] = build_forms(x[mine], of, hourglass, None if weight is None else weight[mine])
        volume = volume * np.append(fill[ids], 0.0)
        table = np.ascontiguousarray(forms[order].transpose(0, 2, 1))
        constants = Constants(table, np.arange(len(order), dtype=np.int32))
    return Blocks(
        nodes=np.ascontiguousarray(nodes.transpose(0, 2, 1)),
        volume=np.where(real, volume[np.maximum(order, 0)], 0.0),
        octant=np.where(real, ids[np.maximum(order, 0)], -1).astype(np.int32),
        colours=np.array(ends, dtype=np.int32),
        edges=edges,
        constants=constants,
        padding_x=padding_x,
        law=body.material.number,
    )


def make_viscous(blocks: Blocks, times: float) -> None:
    """Have neo-Hookean blocks count with the compliance of the axis that has most in their local solve, in place.

    With one for each axis (`kernels.block`, eq. (4)) what a sweep adds to a flat block's stress has a moment. Stress
    catches up with shape within a few substeps, but not where it is viscous: there the moment turns the block, and
    damping is half of what is asked for, or a fifth more. times: damping time in longest undamped substeps. Blocks that
    are `VERY_FLAT` would gain energy below `MOSTLY`, and keep what they have there.
    """
    if blocks.law == NEO_HOOKEAN:
        table = blocks.constants.table
        most, least = table[:, G : G + 3].max(axis=1), table[:, G : G + 3].min(axis=1)
        even = (times > 1.0) & ((times > MOSTLY) | (most < VERY_FLAT**2 * least))
        table[:, G : G + 3] = np.where(even[:, None], most[:, None], table[:, G : G + 3])


def mean_lag(blocks: Blocks, softness: Floats) -> float:
    """8 max w_i V 2 mu G of the blocks, V/mu their weights [1/s^2]; softness (b, 4) is 8 max w_i [1/kg].

    Shear is what slow modes are made of. Where materials differ, the softer one deforms.
    """
    own, boxes = blocks.constants.table[blocks.constants.number], blocks.constants.table.ndim == 2
    mu, slope = (own[:, MU, None], own[:, G : G + 3, None]) if boxes else (own[:, MU], own[:, G : G + 3])
    weight = blocks.volume / mu
    lag = softness * blocks.volume * 2.0 * mu * slope.mean(axis=1)
    return float((weight * lag).sum() / weight.sum())


def _colours(ids: Longs, nodes: Ints, n_nodes: int) -> Longs:
    """Colours (b,) of blocks 8 cell + octant on nodes (b, 8) so that none shares a node with another of its colour."""
    order = np.lexsort((ids, ids % 8))
    chosen, colour = np.zeros(len(ids), dtype=np.int64), np.empty(len(ids), dtype=np.int64)
    if not color_tiles(np.ascontiguousarray(nodes[order]), len(ids), np.zeros(n_nodes, dtype=np.int64), chosen):
        raise ValueError(f"a node belongs to more than {MOST_COLORS} blocks: remesh there")
    colour[order] = chosen
    return colour
