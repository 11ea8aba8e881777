"""Tetrahedra of a file as cells: ten nodes each in the places of `tetrahedron`, quality, masses, and the surface.

The other 17 of a cell's 27 places repeat the node in the middle, so that whoever gathers and scatters cells of 27 nodes
knows these, too; no element and no mass refers to them. A file's middle nodes are taken wherever they stand in its
cells; where it has none, edges are straight. Corners are put in that of three orders which makes the shortest diagonal
between middles of opposite edges the one that the inner parts of a cell share, for they are the least flat so (M. E. G.
Ong, SIAM J. Sci. Comput. 15, 1994). Masses are the diagonal of the consistent matrix, scaled to the cell's
(E. Hinton, T. Rock, O. C. Zienkiewicz, Earthq. Eng. Struct. Dyn. 4, 1976), all of them positive:
  m_corner = rho V/36,   m_middle = 4 rho V/27                                                                    (1)
"""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells
from softseam_services.body.hexahedra import POOR, OwnCells, rough_places, shared_nodes
from softseam_services.body.mesh_io import RawTetrahedra
from softseam_services.body.surface_check import check_surface
from softseam_services.body.tetrahedral_surface import lay_out, outer_faces, surface_of
from softseam_services.body.tetrahedron import CENTRE, CORNERS, ENDS, MIDDLES, NODES, shape_functions
from softseam_services.body.units import check_extent, unit_guess

_ORDERS = np.array([[0, 1, 2, 3], [0, 3, 1, 2], [0, 2, 3, 1]])
"""of corners, none of which mirrors: the edge 0 3 becomes that of each of the three diagonals"""
_DIAGONALS = np.array([[3, 1], [2, 4], [0, 5]])
"""edges between whose middles they run"""
_LONGER = 1.0 + 1e-9
"""a diagonal that another one is not shorter than by more than rounding stays"""
_RULE = np.concatenate([np.full((4, 4), 1.0 / 6.0) + np.eye(4) / 3.0, np.full((1, 4), 0.25)])
_WEIGHTS = np.array([0.45, 0.45, 0.45, 0.45, -0.8]) / 6.0
"""points and weights that are exact to degree 3, which the volume ratio of a curved cell has"""


def tetrahedral_cells(path: str, raw: RawTetrahedra, scale: float, up: str, at: Floats, density: float) -> OwnCells:
    """Cells with the base's centre at `at` [m]; raises MeshError. up: the file's axis that points up."""
    axis = "xyz".index(up)
    points = scale * raw.points[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
    check_extent(path, points, scale)
    corners, places = _ordered(path, points, raw)
    nodes, x_rest = _number(path, corners, places)
    low, high = x_rest.min(axis=0), x_rest.max(axis=0)
    x_rest += at - np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    x = x_rest[nodes]
    volume = _volumes(path, x)
    notes = _doubts(x, volume)
    if raw.mirrored:
        notes.append("all tetrahedra were mirrored; their corners were put in order")
    used, triangles = np.unique(outer_faces(nodes[:, :4])[1], return_inverse=True)
    check_surface(path, x_rest[used], triangles.reshape(-1, 3).astype(np.int32))
    cell_nodes = np.repeat(nodes[:, CENTRE, None], 27, axis=1).astype(np.int32)
    cell_nodes[:, NODES] = nodes
    cell_mass = np.zeros((len(nodes), 27))
    cell_mass[:, CORNERS], cell_mass[:, MIDDLES] = 1.0 / 36.0, 4.0 / 27.0  # eq. (1)
    return OwnCells(
        x_rest=np.ascontiguousarray(x_rest),
        cell_nodes=cell_nodes,
        cell_grid=rough_places(x[:, :4].mean(axis=1)),
        edge=float(np.linalg.norm(x[:, ENDS[:, 0]] - x[:, ENDS[:, 1]], axis=2).min()),
        cell_mass=density * volume[:, None] * cell_mass,
        surface=surface_of(x_rest, cell_nodes, lay_out(cell_nodes)),
        notes=(*notes, *(f"{path}: {guess}" for guess in unit_guess(x_rest, scale))),
    )


def _ordered(path: str, points: Floats, raw: RawTetrahedra) -> tuple[Cells, Floats]:
    """Corners (C, 4) in the order that makes a diagonal the shortest, and places of all nodes (C, 10, 3)."""
    corners = raw.cells.astype(np.int64)
    middles = points[corners[:, ENDS]].mean(axis=2)
    curved = raw.middles[:, 0] >= 0
    extra = points[raw.middles[curved]]
    # files disagree on the order of middle nodes: each goes where the corners expect it
    place = np.linalg.norm(extra[:, :, None] - middles[curved][:, None], axis=3).argmin(axis=2)
    wrong = np.flatnonzero((np.sort(place, axis=1) != np.arange(6)).any(axis=1))
    if len(wrong):
        raise MeshError(
            f"{path}: {len(wrong)} tetrahedra have middle nodes far from where they belong, the first is number "
            f"{np.flatnonzero(curved)[wrong[0]]}; straighten its edges, or export tetrahedra of 4 nodes"
        )
    own = np.empty_like(extra)
    np.put_along_axis(own, place[:, :, None], extra, axis=1)
    middles[curved] = own
    length = np.linalg.norm(middles[:, _DIAGONALS[:, 0]] - middles[:, _DIAGONALS[:, 1]], axis=2)
    order = _ORDERS[np.where(length[:, 0] > _LONGER * length.min(axis=1), length.argmin(axis=1), 0)]
    edge = np.zeros((4, 4), dtype=np.int64)
    edge[ENDS[:, 0], ENDS[:, 1]] = edge[ENDS[:, 1], ENDS[:, 0]] = np.arange(6)
    edges = edge[order[:, ENDS[:, 0]], order[:, ENDS[:, 1]]]
    corners = np.take_along_axis(corners, order, axis=1)
    return corners, np.concatenate([points[corners], np.take_along_axis(middles, edges[:, :, None], axis=1)], axis=1)


def _number(path: str, corners: Cells, x: Floats) -> tuple[Cells, Floats]:
    """Nodes that cells share, the middle of an edge by its ends: nodes (C, 10), x_rest (N, 3)."""
    key = np.full((len(x), 10, 2), -1, dtype=np.int64)
    key[:, :4, 1], key[:, 4:] = corners, np.sort(corners[:, ENDS], axis=2)
    return shared_nodes(path, key, x, "tetrahedra", "edge")


def _volumes(path: str, x: Floats) -> Floats:
    """Of cells with nodes x (C, 10, 3): (C,) [m^3]; raises MeshError where a curved one is turned over somewhere."""
    middles = 0.5 * (np.eye(4)[ENDS[:, 0]] + np.eye(4)[ENDS[:, 1]])
    slope = shape_functions(np.concatenate([_RULE, np.eye(4), middles]))[1]
    jacobian = np.linalg.det(np.einsum("cai,qaj->cqij", x, slope, optimize=True))
    least = jacobian.min(axis=1) / np.abs(jacobian).max(axis=1)
    bad = least <= 1e-6
    if bad.any():
        worst = int(np.argmin(least))
        centre = np.array2string(x[worst].mean(axis=0), precision=4)
        raise MeshError(
            f"{path}: {int(bad.sum())} of {len(x)} tetrahedra are curved so far that they are turned over in part, the "
            f"worst is number {worst} around {centre} m; straighten its edges, or remesh there"
        )
    return np.asarray(jacobian[:, : len(_RULE)] @ _WEIGHTS)


def _doubts(x: Floats, volume: Floats) -> list[str]:
    """That cells are slivers: volume over the mean square of edges, 1 of a regular one (A. Liu, B. Joe, BIT 34, 1994,
    eta = 12 (3 V)^(2/3)/sum l^2)."""
    square = ((x[:, ENDS[:, 0]] - x[:, ENDS[:, 1]]) ** 2).sum(axis=(1, 2))
    quality = 12.0 * np.cbrt(3.0 * volume) ** 2 / square
    poor = quality < POOR
    if not poor.any():
        return []
    return [
        f"{int(poor.sum())} of {len(x)} tetrahedra are slivers, the worst is number {int(np.argmin(quality))}, of "
        f"quality {quality.min():.2g} where a regular one has 1: expect less accuracy there, or remesh there"
    ]
