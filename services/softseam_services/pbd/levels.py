"""Cells of PBD that are one block in place of eight, and the nodes that hang on them.

A coarse cell's block is that of its 8 corners. Its other 19 nodes follow the corners, trilinearly:

    x_s = sum_r N_r(s) x_r,   weights 1/2, 1/4 or 1/8                                                              (1)

and so do, in the same way, those that finer cells beside it share with it: they hang on its edge or face. Nothing is
solved for them. With W the rows of (1), and a unit row for every node that is free to move, x = W x_free, so

    f_free = W^T f,   m_free = W^T m                                                                               (2)

is all that forces and masses need: W has row sums 1 and reproduces places, so (2) keeps total force and torque, total
mass and its centre, and the work f . x. The masses of a cell's 27 nodes, (1, 4, 16, 64)/216 of it, become 1/8 each.

A block of a finer cell that hangs in part still has 8 free nodes. Corner q of octant o differs from o on some axes S;
if it hangs, it does so on the corners of its own cell that differ from o on a part of S, and those of its corners that
lie between hang as well. So corner q gives its place to the cell's corner q, and (8, 8) weights say the rest:
slopes b' = W^T b on the nodes that take part, which keep sum b'_i X_i^T = 1, the patch test (`forms`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_protocol.scene.models import CoarseSpec
from softseam_services.body.body import SAME, Body, Floats, Ints, Region
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.tools.kernels import cell_distances
from softseam_services.tools.tool_set import ToolSet

from .kernels.hanging import Hanging, follow

Mask = NDArray[np.bool_]

CORNERS = np.flatnonzero((LOCAL != 1).all(axis=1)).astype(np.int32)
"""local ids of a cell's corners, x fastest (8,)"""
TRILINEAR = np.prod(1.0 - 0.5 * np.abs(LOCAL[:, None, :] - LOCAL[CORNERS][None]), axis=2)
"""what each corner gives to each of a cell's nodes (27, 8)"""


def coarse_cells(body: Body, wanted: CoarseSpec | None, tools: ToolSet) -> Mask:
    """Cells that PBD takes as one block (C,): those far from tools, or in boxes, that can be.

    Cells stay in eight where the body fills them in part, where two materials meet, where only a part of an edge or a
    face is clamped, and where edges are curved. Tools are where they are at the start.
    """
    if wanted is None:
        return np.zeros(body.n_cells, dtype=np.bool_)
    chosen = np.zeros(body.n_cells, dtype=np.bool_)
    if wanted.beyond is not None:
        distance, node_gap = np.empty(body.n_cells), np.empty(body.n_nodes)
        cell_distances(
            *(body.x_rest, body.cell_nodes, tools.kind, tools.shape, tools.position, tools.orientation, tools.followed),
            *(node_gap, distance),
        )
        chosen |= distance > wanted.beyond
    centres = body.x_rest[body.cell_nodes[:, 13]]
    for box in wanted.boxes:
        chosen |= ((centres >= np.array(box.min)) & (centres <= np.array(box.max))).all(axis=1)
    return chosen & _may_be_coarse(body)


def _may_be_coarse(body: Body) -> Mask:
    nodes = body.cell_nodes
    x, held = body.x_rest[nodes], body.fixed[nodes]
    bent = np.abs(x - np.einsum("ar,cri->cai", TRILINEAR, x[:, CORNERS])).max(axis=(1, 2))
    all_held = ((1.0 - held[:, CORNERS]) @ TRILINEAR.T) == 0.0
    alike = (body.octant_material == body.octant_material[:, :1]).all(axis=1)
    full = (body.fill >= 1.0 - 1e-9).all(axis=1)
    return np.asarray(full & alike & (held == all_held).all(axis=1) & (bent <= SAME * body.resolution))


@dataclass(frozen=True)
class Levels:
    """Of a region with n nodes and c cells."""

    coarse: Mask
    """cells that are one block (c,)"""
    hanging: Hanging
    """nodes that follow others"""
    hangs: Mask
    """(n,)"""
    ties: csr_array | None
    """W of eq. (2) (n, n), None where nothing hangs"""

    def gathered(self, loads: Floats) -> Floats:
        """Forces, masses or momenta of all nodes on those that are free to move, eq. (2) (n, ...)."""
        return loads if self.ties is None else np.asarray(self.ties.T @ loads)

    def follow(self, x: Floats, v: Floats) -> None:
        """Places and velocities (n, 3) of the nodes that hang; in place."""
        if self.ties is not None:
            follow(x, v, self.hanging)

    def rows(self, indptr: Ints, node: Ints, weight: Floats) -> tuple[Ints, Ints, Floats]:
        """Sparse rows over all nodes as rows over those that are free to move: the same entries for all weights."""
        if self.ties is None:
            return indptr, node, weight
        shape = len(indptr) - 1, len(self.hangs)
        entries = csr_array((np.ones(len(node)), node, indptr), shape=shape) @ self.ties
        entries.sort_indices()
        row = np.repeat(np.arange(shape[0]), np.diff(entries.indptr))
        own = csr_array((weight, node, indptr), shape=shape) @ self.ties
        data = np.asarray(own[row, entries.indices], dtype=np.float64).ravel()
        return entries.indptr.astype(np.int32), entries.indices.astype(np.int32), data

    def touching(self, active: Mask, rows: tuple[Ints, Ints], seam: Ints) -> Mask:
        """Points (p,) of those `active` that meet tools; rows say how they follow nodes that are free to move.

        A point between free nodes which all have points of their own, here or beyond the seam, does not: a face has
        four nodes to move where nine would touch, and sticking points that fight over them gain energy.
        """
        indptr, node = rows
        if self.ties is None or not active.any():
            return active
        alone = active & (np.diff(indptr) == 1)
        met = np.zeros(len(self.hangs), dtype=np.bool_)
        met[node[indptr[:-1][alone]]] = True
        met[seam] = True
        between = active & ~alone & np.logical_and.reduceat(met[node], indptr[:-1])
        return np.asarray(active & ~between)

    def block_nodes(self, cell_nodes: Ints, ids: NDArray[np.int64]) -> tuple[Ints, Floats | None]:
        """Nodes (b, 8) of the blocks 8 cell + octant, and what each gives to each of the block's corners (b, 8, 8).

        None for the latter where nothing hangs: each is a corner.
        """
        cells, local = ids // 8, OCTANT_NODES[ids % 8]
        if self.ties is None:
            return cell_nodes[cells[:, None], local], None
        local[self.coarse[cells]] = CORNERS
        nodes = cell_nodes[cells[:, None], local]
        hangs = self.hangs[nodes]
        nodes = np.where(hangs, cell_nodes[cells][:, CORNERS], nodes)
        return nodes, np.where(hangs[:, :, None], TRILINEAR[local], np.eye(8))


def build_levels(cell_nodes: Ints, n: int, coarse: Mask) -> Levels:
    """Of cells with nodes (c, 27) among n, of which those that are `coarse` (c,) are one block."""
    hangs = np.zeros(n, dtype=np.bool_)
    none = np.zeros(0, dtype=np.int32)
    if not coarse.any():
        return Levels(coarse, Hanging(none, np.zeros(1, dtype=np.int32), none, np.zeros(0)), hangs, None)
    cells = cell_nodes[coarse]
    between = np.setdiff1d(np.arange(27), CORNERS)
    slave, first = np.unique(cells[:, between], return_index=True)
    cell, place = first // len(between), between[first % len(between)]
    weight, master = TRILINEAR[place], cells[cell][:, CORNERS]
    order = np.argsort(np.where(weight > 0.0, master, n), axis=1, kind="stable")
    weight, master = np.take_along_axis(weight, order, axis=1), np.take_along_axis(master, order, axis=1)
    used = weight > 0.0
    indptr = np.concatenate([[0], np.cumsum(used.sum(axis=1))]).astype(np.int32)
    hanging = Hanging(slave.astype(np.int32), indptr, master[used].astype(np.int32), weight[used])
    hangs[slave] = True
    free = np.flatnonzero(~hangs)
    rows = np.concatenate([free, np.repeat(slave, np.diff(indptr))])
    columns = np.concatenate([free, hanging.master])
    ties = csr_array((np.concatenate([np.ones(len(free)), hanging.weight]), (rows, columns)), shape=(n, n))
    return Levels(coarse, hanging, hangs, ties)


def thin_out(levels: Levels, region: Region, mass: Floats, x: Floats, v: Floats) -> None:
    """Make a state of all nodes, x and v (n, 3), one of the nodes that move, whose masses are mass (n,); in place.

    They keep their places, and get all the momentum and angular momentum of the region; the others are to follow.
    """
    if levels.ties is not None:
        momenta = region.mass @ v, np.cross(x, region.mass[:, None] * v).sum(axis=0)
        _repair(np.where(region.fixed, 0.0, mass), x, v, *momenta)


def fill_in(levels: Levels, region: Region, mass: Floats, x: Floats, v: Floats) -> None:
    """Give nodes that hang such velocities that all nodes, with the masses of the cells, have the momentum and angular
    momentum of those that move, whose masses are mass (n,); v (n, 3) in place. The way back of `thin_out`.
    """
    if levels.ties is not None:
        rest = mass - np.where(levels.hangs, 0.0, region.mass)
        momenta = rest @ v, np.cross(x, rest[:, None] * v).sum(axis=0)
        _repair(np.where(levels.hangs & ~region.fixed, region.mass, 0.0), x, v, *momenta)


def _repair(mass: Floats, x: Floats, v: Floats, momentum: Floats, angular: Floats) -> None:
    """Give nodes with mass (n,) momentum and angular momentum by the least kinetic change a + omega x r; v in place.

    Nothing is done where they lie on a line.
    """
    total = mass.sum()
    if total == 0.0:
        return
    r = x - (mass @ x) / total
    second = (mass[:, None] * r).T @ r
    inertia = np.trace(second) * np.eye(3) - second
    values = np.linalg.eigvalsh(inertia)
    if not values[0] > 1e-6 * values[-1]:
        return
    lacks = momentum - mass @ v
    turns = angular - np.cross(x, mass[:, None] * v).sum(axis=0) - np.cross((mass @ x) / total, lacks)
    change = lacks / total + np.cross(np.linalg.solve(inertia, turns), r)
    v[mass > 0.0] += change[mass > 0.0]
