"""The blocks of a region, coloured and laid out for the sweep; built once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.lattice import OCTANT_NODES

from .hourglass import block_constants
from .kernels.block import Constants
from .kernels.lanes import LANES


@dataclass(frozen=True)
class Blocks:
    """Blocks in batches of 4 that share no node, colour after colour (n_batches * 4 = padded blocks).

    Octants of a lattice take 8 colours by the parity of their place, in a fixed order, so a sweep is deterministic; in
    a colour the batches of one material follow those of another. The last batch of a colour and material is filled up
    with an empty block on 8 nodes of its own, which never move.
    """

    nodes: Ints
    """local node ids, n .. n + 7 for padding (n_batches, 8 nodes, 4 lanes)"""
    volume: Floats
    """fill times volume, 0 for padding (n_batches, 4 lanes) [m^3]"""
    octant: Ints
    """8 cell + octant of each lane, -1 for padding (n_batches, 4 lanes)"""
    colours: Ints
    """where the batches of each colour begin, and the end (9,)"""
    edges: Floats
    """(3,) [m]"""
    constants: Constants
    padding_x: Floats
    """rest positions of the padding's nodes (8, 3) [m]"""
    law: int
    """number of the materials' kind in `body.materials.point`"""

    @property
    def n_batches(self) -> int:
        return len(self.nodes)


def build_blocks(body: Body, region: Region, hourglass: str, only: Ints | None = None) -> Blocks:
    """Colour the filled octants of the region's cells; `only` restricts them to these ids 8 cell + octant."""
    edges = body.edges / 2.0
    volume = (body.fill[region.cells] * edges.prod()).ravel()
    ids = np.flatnonzero(volume > 0.0)
    if only is not None:
        ids = np.intersect1d(ids, only)
    octant = ids % 8
    # The place of an octant in the lattice is 2 grid + (i, j, k), so its parity is (i, j, k): colour = octant.
    material = body.octant_material[region.cells].ravel()[ids]
    lanes: list[Ints] = []
    ends, numbers = [0], []
    for colour in range(8):
        for number in range(len(body.materials)):
            members = ids[(octant == colour) & (material == number)]
            pad = -len(members) % LANES
            lanes.append(np.concatenate([members, np.full(pad, -1)]))
            numbers += [number] * (len(lanes[-1]) // LANES)
        ends.append(len(numbers))
    order = np.concatenate(lanes).reshape(-1, LANES)
    real = order >= 0
    n_nodes = len(region.nodes)
    nodes = np.empty((*order.shape, 8), dtype=np.int32)
    nodes[...] = n_nodes + np.arange(8)
    nodes[real] = region.cell_nodes[order[real] // 8][np.arange(real.sum())[:, None], OCTANT_NODES[order[real] % 8]]
    corner = np.array([(i, j, k) for k in range(2) for j in range(2) for i in range(2)], dtype=np.float64)
    return Blocks(
        nodes=np.ascontiguousarray(nodes.transpose(0, 2, 1)),
        volume=np.where(real, volume[np.maximum(order, 0)], 0.0),
        octant=order.astype(np.int32),
        colours=np.array(ends, dtype=np.int32),
        edges=edges,
        constants=Constants(
            np.stack([block_constants(each, edges, hourglass) for each in body.materials]),
            np.array(numbers, dtype=np.int32),
        ),
        padding_x=corner * edges,
        law=body.material.number,
    )
