"""Root cells and the sliver cells that are joined to each (`body.slivers`), for the kernels.

A sliver cell holds its nodes with next to nothing. Those that no other cell has are tied to the root cell's quadratic
functions N_a, extended beyond it, by an energy that vanishes on all that these functions have, linear fields among it:

  U = sum_n k/2 |x_n - sum_a N_a(xi_n) x_a|^2,   k = mu h                                                     (1)

xi_n the node's place in the root cell's coordinates, h the least edge of a cell. A tie is stiff, and no constraint: the
space of functions stays whole, and forces do not rise, as they do where such nodes follow (docs/decisions/17). Octants
of both cells with one deformation gradient (`octants`, eq. 1) are groups of the joint.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.filled import filled_moments, gradient_integrals
from softseam_services.body.interpolate import hex27
from softseam_services.body.slivers import true_fill
from softseam_services.jit import record

from .octants import Octants
from .tree import Longs, Tree, cell_places


@record
class Joints(NamedTuple):
    """j joints of up to m nodes, with g groups of octants and t ties; a plain tuple of arrays for the kernels."""

    nodes: Ints
    """local node ids, those of the root cell first, in its local order; -1 beyond the last (j, m)"""
    place: Ints
    """of each in the order of elimination, -1 for clamped nodes (j, m)"""
    home: Ints
    """27 times a cell that has each, and its number in it (j, m)"""
    cell: Ints
    """the root cell (j,)"""
    group: Ints
    """of a joint's groups the first, and one more than the last (j + 1,)"""
    octant: Ints
    """root of each group, as of `FemModel.root` (g,)"""
    tie: Ints
    """of a joint's ties the first, and one more than the last (j + 1,)"""
    tied: Ints
    """which of the joint's nodes each tie holds (t,)"""
    cell_local: Ints
    """as of `Tree`, and so what follows (j, m)"""
    cell_rank: Ints
    cell_free: Ints
    cell_column: Longs
    cell_height: Ints
    cell_row: Ints


@record
class JointNumbers(NamedTuple):
    """What the joints' energies are made of."""

    gradient: Floats
    """of each group (g, 3, m) [1/m]"""
    weight: Floats
    """its volume (g,) [m^3]"""
    parameters: Floats
    """of its material (g, MAX_PARAMETERS)"""
    follow: Floats
    """N_a of eq. (1) (t, 27)"""
    stiffness: Floats
    """k (t,) [N/m]"""


def root_cells(root: Ints) -> Ints:
    """The cell that each one's octants are joined to, its own for all that are no sliver cells (c,)."""
    of_octants = root // 8
    own = np.arange(len(root), dtype=np.int32)
    apart = of_octants != own[:, None]
    first = of_octants[own, apart.argmax(axis=1)]
    return np.where(apart.any(axis=1), first, own).astype(np.int32)


def build_joints(cell_nodes: Ints, root: Ints, seam: Ints, tree: Tree) -> Joints:
    """Of cells with these nodes (c, 27) and roots (c, 8); what is beyond the seam's nodes (s,) holds these, too."""
    of_cell = root_cells(root)
    slivers = np.flatnonzero(of_cell != np.arange(len(root)))
    held = np.zeros(len(tree.position), dtype=np.bool_)
    held[cell_nodes[of_cell == np.arange(len(root))]] = True
    held[seam] = True
    held |= tree.position < 0
    cells = np.unique(of_cell[slivers]).astype(np.int32)
    nodes, homes = [], []
    groups: list[Longs] = []
    tied: list[Longs] = []
    for cell in cells:
        joined = np.concatenate([[cell], slivers[of_cell[slivers] == cell]])
        flat = cell_nodes[joined].reshape(-1)
        first = np.sort(np.unique(flat, return_index=True)[1])
        nodes.append(flat[first])
        homes.append(27 * joined[first // 27] + first % 27)
        octants = root[joined[1:]]
        groups.append(np.unique(octants[octants // 8 == cell]).astype(np.int64))
        ours = ~held[nodes[-1]]
        held[nodes[-1]] = True  # a node between sliver cells of two joints is the first one's
        tied.append(np.flatnonzero(ours))
    most = max((len(each) for each in nodes), default=27)
    padded, home = np.full((2, len(cells), most), -1, dtype=np.int32)
    for joint, (mine, at) in enumerate(zip(nodes, homes, strict=True)):
        padded[joint, : len(mine)], home[joint, : len(mine)] = mine, at
    position = np.append(tree.position, np.int32(-1))
    n_all = tree.meta[:, 2]
    key = np.repeat(np.arange(len(n_all)), n_all) * max(len(tree.own_front), 1) + tree.rows
    return Joints(
        padded,
        position[padded],
        home,
        cells,
        _pointer(groups),
        _joined(groups),
        _pointer(tied),
        _joined(tied),
        *cell_places(padded, position, tree.own_front, tree.meta, key),
    )


def build_numbers(
    joints: Joints, body: Body, region: Region, root: Ints, octants: Octants, cell_nodes: Ints
) -> JointNumbers:
    """Of a region's joints; root and octants are of its cells."""
    most, volume = joints.nodes.shape[1], float(body.edges.prod()) / 8.0
    n_groups, x, mu = len(joints.octant), body.x_rest[region.nodes], [each.mu for each in body.materials]
    gradient, follow = np.zeros((n_groups, 3, most)), np.empty((len(joints.tied), 27))
    stiffness = np.empty(len(joints.tied))
    members, at_root = np.flatnonzero(np.isin(root, joints.octant)), root.reshape(-1)
    cells = np.unique(members // 8)
    fill = true_fill(body, region.cells[cells])
    integral = body.axes @ gradient_integrals(filled_moments(body, region.cells[cells], fill), body.edges)
    place, slope = np.full(len(x), -1), np.empty((27, 3))
    for joint in range(len(joints.cell)):
        nodes = joints.nodes[joint][joints.nodes[joint] >= 0]
        place[nodes] = np.arange(len(nodes))
        for group in range(joints.group[joint], joints.group[joint + 1]):
            for member in members[at_root[members] == joints.octant[group]]:
                own = integral[np.searchsorted(cells, member // 8), member % 8]
                gradient[group][:, place[cell_nodes[member // 8]]] += own
        cell = joints.cell[joint]
        centre, firm = x[cell_nodes[cell, 13]], np.mean(np.array(mu)[body.octant_material[region.cells[cell]]])
        for tie in range(joints.tie[joint], joints.tie[joint + 1]):
            away = body.along_axes(x[nodes[joints.tied[tie]]] - centre)
            hex27(away / (0.5 * body.edges), follow[tie], slope)
            stiffness[tie] = firm * float(body.edges.min())
    total = octants.total.reshape(-1)[joints.octant]
    number = body.octant_material[region.cells].reshape(-1)[joints.octant]
    parameters = np.array([each.parameters for each in body.materials])[number]
    return JointNumbers(
        gradient / total[:, None, None], volume * total, np.ascontiguousarray(parameters), follow, stiffness
    )


def follow_roots(joints: Joints, numbers: JointNumbers, x: Floats) -> Floats:
    """Places (n, 3) [m] with what is tied where its root cell's functions have it.

    A state of another model, which has no ties, would stretch them without bound.
    """
    x, of_tie = x.copy(), np.repeat(np.arange(len(joints.cell)), np.diff(joints.tie))
    held = x[joints.nodes[of_tie, :27]]
    x[joints.nodes[of_tie, joints.tied]] = np.einsum("ta,tai->ti", numbers.follow, held)
    return x


def _pointer(parts: list[Longs]) -> Ints:
    return np.cumsum([0, *(len(part) for part in parts)]).astype(np.int32)


def _joined(parts: list[Longs]) -> Ints:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts]).astype(np.int32)
