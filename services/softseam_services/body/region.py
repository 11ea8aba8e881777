"""Cells of a body, numbered on their own, and the nodes that two sets of cells share."""

from __future__ import annotations

import numpy as np

from softseam_services.body.body import Body, Ints, Region


def build_region(body: Body, cells: Ints, seam_nodes: Ints) -> Region:
    """The region of these cells (global ids, made ascending); seam_nodes are global ids, kept in the given order."""
    cells = np.unique(cells).astype(np.int32)
    if len(cells) == 0 or cells[0] < 0 or cells[-1] >= body.n_cells:
        raise ValueError(f"a region needs cells within 0 .. {body.n_cells - 1}, got {len(cells)} of them")
    nodes, local = np.unique(body.cell_nodes[cells], return_inverse=True)
    cell_nodes = local.reshape(-1, 27).astype(np.int32)
    seam = np.minimum(np.searchsorted(nodes, seam_nodes), len(nodes) - 1)
    if not np.array_equal(nodes[seam], seam_nodes):
        raise ValueError("a seam node does not belong to the region's cells")
    cell_number = np.full(body.n_cells, -1, dtype=np.int32)
    cell_number[cells] = np.arange(len(cells))
    points = np.flatnonzero(cell_number[body.surface.cell] >= 0).astype(np.int32)
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
        point_cell=cell_number[body.surface.cell[points]],
    )


def shared_nodes(body: Body, cells_a: Ints, cells_b: Ints) -> Ints:
    """Global ids, ascending, of the nodes that both sets of cells have; clamped nodes are left out (s,)."""
    shared = np.intersect1d(body.cell_nodes[cells_a], body.cell_nodes[cells_b])
    return shared[~body.fixed[shared]].astype(np.int32)
