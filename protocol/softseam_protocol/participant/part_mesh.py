"""The mesh of a part: whether it is one, the octants of its hexahedra, and points that these carry."""

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure, PartMesh

Floats = NDArray[np.float64]

CORNERS = np.array([(a, b, c) for c in (0, 1) for b in (0, 1) for a in (0, 1)])
"""of an octant, and the octants of a cell; x fastest (8, 3)"""
OCTANTS = np.array([(octant + CORNERS) @ (1, 3, 9) for octant in CORNERS])
"""places of each octant's corners among a cell's 27 nodes (8, 8)"""


def mesh_of(request: Configure) -> PartMesh:
    """The mesh that a Configure reports. Raises ValueError where there is none, or one that is not whole."""
    mesh = request.mesh
    if mesh is None:
        raise ValueError("Configure reports no mesh: send cells, from an orchestrator as new as this participant")
    n, c, p = len(mesh.nodes), len(mesh.cell_nodes), len(mesh.points)
    lengths = {(len(mesh.x_rest), n), (len(mesh.mass), n), (len(mesh.fixed), n), (len(request.cells), c)}
    lengths |= {(len(mesh.point_cell), p), (len(mesh.point_local), p)}
    whole = all(came == wanted for came, wanted in lengths) and bool(n and (np.diff(mesh.nodes) > 0).all())
    within = mesh.cell_nodes.max(initial=0) < n and mesh.point_cell.max(initial=0) < (c or n)
    if not (whole and within and np.isin(request.coupling_nodes, mesh.nodes).all()):
        raise ValueError("Configure.mesh names nodes or cells that it has not: send the mesh of the cells it names")
    return mesh


def has_tetrahedra(mesh: PartMesh) -> bool:
    """Whether a cell is a tetrahedron, which has no octants."""
    return bool((np.diff(np.sort(mesh.cell_nodes, axis=1), axis=1) == 0).any())


def surface_points(mesh: PartMesh, x: Floats) -> Floats:
    """Positions of the surface points (p, 3) [m] of hexahedra, or of no cells, whose nodes are at x (n, 3) [m]."""
    if not len(mesh.cell_nodes):
        return np.asarray(x[mesh.point_cell] + mesh.point_local)
    octant = (mesh.point_local > 0.0).astype(int)
    inside = (mesh.point_local + 1.0 - octant)[:, None]  # 0 to 1 along the octant's edges
    weight = np.where(CORNERS == 1, inside, 1.0 - inside).prod(axis=2)
    nodes = mesh.cell_nodes[mesh.point_cell[:, None], OCTANTS[octant @ (1, 2, 4)]]
    return np.asarray(np.einsum("pa,pai->pi", weight, x[nodes]))
