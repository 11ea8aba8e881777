"""The blocks of a region, coloured and laid out for the sweep: what is joined to what; their numbers are in
`block_parameters`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region

from .kernels.lanes import LANES
from .levels import Levels, build_levels
from .particles.kernels.coloring import MOST_COLORS, color_tiles

Longs = NDArray[np.int64]


class CellLayout(NamedTuple):
    """What the blocks' structure follows from: c cells on n nodes."""

    nodes: Ints
    """local ids (c, 27)"""
    n_nodes: int
    filled: NDArray[np.bool_]
    """octants that have a block (c, 8)"""
    material: Ints
    """number of each octant's material (c, 8)"""
    parity: Ints
    """whether the cell's place in the grid is even or odd, by axis (c, 3)"""
    boxes: bool
    """whether cells are boxes of one size, whose blocks need no numbers of their own"""


def cell_layout(body: Body, region: Region) -> CellLayout:
    """Of the region's cells."""
    cells = region.cells
    return CellLayout(
        nodes=region.cell_nodes,
        n_nodes=len(region.nodes),
        filled=body.fill[cells] > 0.0,
        material=body.octant_material[cells],
        parity=body.cell_grid[cells] & 1,
        boxes=body.boxes and (body.relaxes or not body.material.n_state),
    )


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
    octant: Ints
    """8 cell + octant of each lane, 8 cell where it is the whole cell, -1 for padding (n_batches, 4 lanes)"""
    order: Longs
    """place in `ids` of each lane, -1 for padding (n_batches, 4 lanes)"""
    material: Ints
    """number of the material of each batch (n_batches,)"""
    colours: Ints
    """where the batches of each colour begin, and the end (c + 1,)"""
    ids: Longs
    """8 cell + octant, ascending (b,)"""
    corners: Ints
    """nodes of each block (b, 8)"""
    weight: Floats | None
    """what each node gives to each of the block's corners, see `levels`; None where each is a corner (b, 8, 8)"""
    colour: Longs
    """(b,)"""
    kind: Ints
    """number of each block's material (b,)"""
    boxes: bool
    """whether all are boxes of one size"""
    whole: bool
    """whether each is a whole cell"""
    n_nodes: int

    @property
    def n_batches(self) -> int:
        return len(self.nodes)

    def only(self, ids: Ints | Longs) -> Blocks:
        """Some of these blocks, those of `ids`, laid out anew."""
        kept = np.flatnonzero(np.isin(self.ids, ids))
        corners = self.corners[kept]
        colour = self.colour[kept] if self.boxes else _colours(self.ids[kept], corners, self.n_nodes)
        weight = None if self.weight is None else self.weight[kept]
        return _laid_out(self.ids[kept], corners, weight, colour, self.kind[kept], self.boxes, self.whole, self.n_nodes)


def build_blocks(cells: CellLayout, levels: Levels | None = None) -> Blocks:
    """Colour the filled octants of the cells, and the coarse cells; without levels none is coarse."""
    if levels is None:
        levels = build_levels(cells.nodes, cells.n_nodes, np.zeros(len(cells.nodes), dtype=np.bool_))
    coarse = levels.coarse
    whole = bool(coarse.all())
    boxes = cells.boxes and (whole or not coarse.any())
    filled = cells.filled.ravel()
    ids = np.flatnonzero(filled & ((np.arange(len(filled)) % 8 == 0) | ~np.repeat(coarse, 8)))
    corners, weight = levels.block_nodes(cells.nodes, ids)
    if boxes and whole:
        colour = cells.parity[ids // 8] @ np.array([1, 2, 4])
    else:
        # The place of an octant in the lattice is 2 grid + (i, j, k), so its parity is (i, j, k): colour = octant.
        colour = ids % 8 if boxes else _colours(ids, corners, cells.n_nodes)
    return _laid_out(ids, corners, weight, colour, cells.material.ravel()[ids], boxes, whole, cells.n_nodes)


def _laid_out(
    ids: Longs, corners: Ints, weight: Floats | None, colour: Longs, kind: Ints, boxes: bool, whole: bool, n_nodes: int
) -> Blocks:
    """Batches of blocks of one colour and material."""
    lanes: list[Longs] = []
    ends, numbers = [0], []
    for each in range(int(colour.max(initial=7)) + 1):
        for number in np.unique(kind[colour == each]).tolist():
            members = np.flatnonzero((colour == each) & (kind == number))
            pad = -len(members) % LANES
            lanes.append(np.concatenate([members, np.full(pad, -1)]))
            numbers += [number] * (len(lanes[-1]) // LANES)
        ends.append(len(numbers))
    order = np.concatenate(lanes or [np.zeros(0, dtype=np.int64)]).reshape(-1, LANES)
    real = order >= 0
    nodes = np.empty((*order.shape, 8), dtype=np.int32)
    nodes[...] = n_nodes + np.arange(8)
    nodes[real] = corners[order[real]]
    return Blocks(
        nodes=np.ascontiguousarray(nodes.transpose(0, 2, 1)),
        octant=np.where(real, ids[np.maximum(order, 0)], -1).astype(np.int32),
        order=order,
        material=np.array(numbers, dtype=np.int32),
        colours=np.array(ends, dtype=np.int32),
        ids=ids,
        corners=corners,
        weight=weight,
        colour=colour,
        kind=kind,
        boxes=boxes,
        whole=whole,
        n_nodes=n_nodes,
    )


def _colours(ids: Longs, nodes: Ints, n_nodes: int) -> Longs:
    """Colours (b,) of blocks 8 cell + octant on nodes (b, 8) so that none shares a node with another of its colour."""
    order = np.lexsort((ids, ids % 8))
    chosen, colour = np.zeros(len(ids), dtype=np.int64), np.empty(len(ids), dtype=np.int64)
    if not color_tiles(np.ascontiguousarray(nodes[order]), len(ids), np.zeros(n_nodes, dtype=np.int64), chosen):
        raise ValueError(f"a node belongs to more than {MOST_COLORS} blocks: remesh there")
    colour[order] = chosen
    return colour


Mask = NDArray[np.bool_]


def to_blocks(blocks: Blocks, coarse: Mask, internal: Floats, memory: Floats) -> None:
    """memory (b, r, 4) of the batches' blocks, its first n numbers <- the octants' internal (c, 8, n); of a cell that
    is one block, which coarse (c,) says, their mean."""
    if memory.size:
        internal = np.where(coarse[:, None, None], internal.mean(axis=1, keepdims=True), internal)
        real = blocks.octant >= 0
        memory.transpose(0, 2, 1)[real, : internal.shape[2]] = internal[
            blocks.octant[real] // 8, blocks.octant[real] % 8
        ]


def to_octants(blocks: Blocks, coarse: Mask, memory: Floats) -> Floats:
    """The way back (c, 8, n): each octant has what its block remembers, an empty one zeros."""
    if not memory.size:
        return np.zeros((0, 8, 0))
    internal = np.zeros((len(coarse), 8, memory.shape[1]))
    real = blocks.octant >= 0
    internal[blocks.octant[real] // 8, blocks.octant[real] % 8] = memory.transpose(0, 2, 1)[real]
    internal[coarse] = internal[coarse, :1]
    return internal
