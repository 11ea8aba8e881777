"""Cells of a body, numbered on their own, and the nodes that two sets of cells share."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Ints, Region

Mask = NDArray[np.bool_]

BESIDE = 1.0
"""Points of the other side that are closer to the seam than this are solved by the side that owns the seam's points
[half cell edges]: those in the octants beside it."""


def build_region(body: Body, cells: Ints, coupling_nodes: Ints, owns_coupling_points: bool = True) -> Region:
    """The region of these cells (global ids, made ascending); coupling_nodes are global ids, kept in the given order.

    A surface point that sits on a node of both sides, clamped or not, or closer to the seam than `BESIDE`, belongs to
    the side that owns the seam's points, whatever cell carries it in the body. So contact there is solved by one side,
    the same one along the whole seam: the other side's answer to a seam force would jump whenever such a point sticks,
    slips or lifts off.
    """
    cells = np.unique(cells).astype(np.int32)
    if len(cells) == 0 or cells[0] < 0 or cells[-1] >= body.n_cells:
        raise ValueError(f"a region needs cells within 0 .. {body.n_cells - 1}, got {len(cells)} of them")
    nodes, local = np.unique(body.cell_nodes[cells], return_inverse=True)
    cell_nodes = local.reshape(-1, 27).astype(np.int32)
    seam = np.minimum(np.searchsorted(nodes, coupling_nodes), len(nodes) - 1)
    if not np.array_equal(nodes[seam], coupling_nodes):
        raise ValueError("a seam node does not belong to the region's cells")
    cell_number = np.full(body.n_cells, -1, dtype=np.int32)
    cell_number[cells] = np.arange(len(cells))
    carrier, point_local = body.surface.cell.copy(), body.surface.local.copy()
    inside, shared = cell_number >= 0, coupling_nodes
    if len(coupling_nodes):
        _carry_across(body, inside if owns_coupling_points else ~inside, carrier, point_local)
        shared = np.intersect1d(body.cell_nodes[inside], body.cell_nodes[~inside])
    point_cell = cell_number[carrier]
    node = node_of_point(body)
    on_seam = np.flatnonzero(np.isin(node, shared))
    if owns_coupling_points:
        order = np.argsort(cell_nodes, axis=None, kind="stable")
        first = order[np.searchsorted(cell_nodes.reshape(-1)[order], np.searchsorted(nodes, node[on_seam]))]
        point_cell[on_seam] = first // 27
        place = first % 27
        point_local[on_seam] = np.stack([place % 3, place // 3 % 3, place // 9], axis=1) - 1.0
    else:
        point_cell[on_seam] = -1
    points = np.flatnonzero(point_cell >= 0).astype(np.int32)
    mass = np.zeros(len(nodes))
    np.add.at(mass, cell_nodes, body.cell_mass[cells])
    return Region(
        cells=cells,
        nodes=nodes.astype(np.int32),
        cell_nodes=cell_nodes,
        mass=mass,
        fixed=body.fixed[nodes],
        seam=seam.astype(np.int32),
        points=points,
        point_cell=point_cell[points],
        point_local=point_local[points],
    )


def _carry_across(body: Body, inside: Mask, cell: Ints, local: Floats) -> None:
    """Give points of other cells that lie just beyond a face of a cell `inside` (C,) to that cell.

    cell (P,), local (P, 3): what carries each point and where, in coordinates of its cell; updated in place, so that
    local may exceed 1 by up to `BESIDE`.
    """
    number = np.full(tuple(body.cell_grid.max(axis=0) + 3), -1, dtype=np.int32)
    at = body.cell_grid + 1  # with a rim of no cells
    number[at[:, 0], at[:, 1], at[:, 2]] = np.arange(body.n_cells)
    points = np.flatnonzero(~inside[cell])
    home, place = at[cell[points]], local[points]
    nearest = np.full(len(points), BESIDE)
    for face in range(6):
        axis, side = face // 2, 2 * (face % 2) - 1
        step = np.zeros(3, dtype=np.int64)
        step[axis] = side
        other = number[tuple((home + step).T)]
        beyond = 1.0 - side * place[:, axis]
        closer = (other >= 0) & inside[other] & (beyond < nearest)
        nearest[closer] = beyond[closer]
        chosen = points[closer]
        cell[chosen], local[chosen] = other[closer], place[closer]
        local[chosen, axis] -= 2.0 * side


def node_of_point(body: Body) -> Ints:
    """Node that each surface point sits on, -1 for none (P,)."""
    place = np.rint(body.surface.local).astype(np.int32)
    exact = (np.abs(body.surface.local - place) < 1e-9).all(axis=1)
    a = (place + 1) @ np.array([1, 3, 9], dtype=np.int32)
    return np.where(exact, body.cell_nodes[body.surface.cell, np.where(exact, a, 0)], -1).astype(np.int32)


def shared_nodes(body: Body, cells_a: Ints, cells_b: Ints) -> Ints:
    """Global ids, ascending, of the nodes that both sets of cells have; clamped nodes are left out (s,)."""
    shared = np.intersect1d(body.cell_nodes[cells_a], body.cell_nodes[cells_b])
    return shared[~body.fixed[shared]].astype(np.int32)
