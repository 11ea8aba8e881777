"""Hexahedra of a file as cells of their own: 27 nodes each, quality, masses, and the surface at their outer faces.

Hexahedra of 8, 20 or 27 nodes in VTK's order; the nodes that a cell lacks follow from its corners (trilinear) or, of
20, from the serendipity functions. Neighbours share the nodes of their common face. With the 27 functions N_a, the
local coordinates xi_a of the nodes and Simpson's weights w_a (sum 1 over the cell) masses are
  m_a = rho V w_a J(xi_a)/sum_b w_b J(xi_b),  J = det dx/dxi,  V = int J by 3^3 Gauss points                       (1)
which are positive, and have the right centre of mass where faces are flat or ruled: J is a polynomial of degree 2 then.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from softseam_services.body.body import ALIKE, Floats, Ints, Surface
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells
from softseam_services.body.interpolate import hex27
from softseam_services.body.lattice import LOCAL, SIMPSON
from softseam_services.body.mesh_io import RawHexahedra
from softseam_services.body.surface_check import check_surface
from softseam_services.body.units import check_extent, unit_guess

CORNERS = np.array([0, 2, 8, 6, 18, 20, 26, 24])
"""lattice nodes of VTK's corners"""
_PLACES: Floats = LOCAL.astype(np.float64) - 1.0
"""local coordinates of a cell's nodes (27, 3)"""
POOR = 0.1
"""a cell whose least J is below this share of its mean is worth a warning"""
_POINTS, _LINE_WEIGHTS = np.polynomial.legendre.leggauss(3)
_GAUSS: Floats = np.array(list(product(_POINTS, repeat=3)))
_WEIGHTS: Floats = np.array(list(product(_LINE_WEIGHTS, repeat=3))).prod(axis=1)
_SIMPSON_LINE = np.array([1.0, 4.0, 1.0]) / 6.0


def _edges() -> tuple[Cells, Cells]:
    """Lattice nodes at the middles of edges (12,), and those at the two ends of each (12, 2)."""
    middle: Cells = np.flatnonzero((LOCAL == 1).sum(axis=1) == 1).astype(np.int64)
    stride = np.array([1, 3, 9])[np.argmax(LOCAL[middle] == 1, axis=1)]
    return middle, np.stack([middle - stride, middle + stride], axis=1)


def _faces() -> Cells:
    """Lattice nodes of the six faces -x +x -y +y -z +z, rows along u, columns along v, u x v outward (6, 3, 3)."""
    stride, faces = np.array([1, 3, 9]), []
    for axis, side in product(range(3), (0, 2)):
        u, v = ((axis + 1) % 3, (axis + 2) % 3) if side else ((axis + 2) % 3, (axis + 1) % 3)
        faces.append(side * stride[axis] + np.arange(3)[:, None] * stride[u] + np.arange(3)[None, :] * stride[v])
    return np.array(faces)


_MIDDLES, _ENDS = _edges()
_FACES = _faces()
_CENTRES = _FACES[:, 1, 1]
_FACE_CORNERS = _FACES[:, [0, 0, 2, 2], [0, 2, 0, 2]]


@dataclass(frozen=True)
class OwnCells:
    """Arrays of a body, see `Body`."""

    x_rest: Floats
    cell_nodes: Ints
    cell_grid: Ints
    edge: float
    """the shortest of all [m]"""
    cell_mass: Floats
    surface: Surface
    notes: tuple[str, ...]


def own_cells(path: str, raw: RawHexahedra, scale: float, up: str, at: Floats, density: float) -> OwnCells:
    """Cells with the base's centre at `at` [m]; raises MeshError. up: the file's axis that points up."""
    axis = "xyz".index(up)
    points = scale * raw.points[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
    check_extent(path, points, scale)
    x, corner, turned = _lattice(path, points, raw.cells)
    _quality(path, x, "put its corners in order, or remesh there")
    cell_nodes, x_rest = _number(path, x, corner)
    low, high = x_rest.min(axis=0), x_rest.max(axis=0)
    x_rest += at - np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    notes = ["all hexahedra were mirrored; their corners were put in order"] if turned else []
    notes += [f"{path}: {guess}" for guess in unit_guess(x_rest, scale)]
    return numbered_cells(path, x_rest, cell_nodes, density, notes)


def numbered_cells(
    path: str,
    x_rest: Floats,
    cell_nodes: Ints,
    density: float,
    notes: Sequence[str] = (),
    remedy: str = "remesh there",
) -> OwnCells:
    """Cells (C, 27) of nodes (N, 3) [m] that are where they belong; raises MeshError, which names the remedy."""
    x = x_rest[cell_nodes]
    least, volume = _quality(path, x, remedy)
    outer = _outer_faces(path, cell_nodes)
    surface = _surface(x_rest, cell_nodes, outer)
    nodes = cell_nodes[surface.cell, ((surface.local + 1.0) @ np.array([1.0, 3.0, 9.0])).astype(np.int64)]
    check_surface(path, x_rest[nodes], surface.triangles)
    weight = SIMPSON * _jacobians(x, _PLACES)
    poor = least < POOR
    if poor.any():
        notes = (
            *notes,
            f"{int(poor.sum())} of {len(x)} cells are badly distorted, the worst is number {int(np.argmin(least))}, "
            f"whose volume ratio falls to {least.min():.2g} of its mean: expect less accuracy there, or {remedy}",
        )
    edge = np.linalg.norm(x[:, _ENDS[:, 0]] - x[:, _ENDS[:, 1]], axis=2)
    return OwnCells(
        x_rest=np.ascontiguousarray(x_rest),
        cell_nodes=cell_nodes,
        cell_grid=rough_places(x.mean(axis=1)),
        edge=float(edge.min()),
        cell_mass=density * (volume / weight.sum(axis=1))[:, None] * weight,  # eq. (1)
        surface=surface,
        notes=tuple(notes),
    )


def _lattice(path: str, points: Floats, blocks: tuple[Cells, ...]) -> tuple[Floats, Cells, bool]:
    """Nodes of all cells in local order (C, 27, 3), the file's points at their corners, else -1 (C, 27), and whether
    all had to be mirrored."""
    signs = _PLACES
    trilinear = 0.125 * (1.0 + signs[:, None, :] * signs[CORNERS]).prod(axis=2)
    parts, corners = [], []
    for cells in blocks:
        corner = np.full((len(cells), 27), -1, dtype=np.int64)
        corner[:, CORNERS] = cells[:, :8]
        x = np.einsum("ac,tci->tai", trilinear, points[cells[:, :8]])
        given = cells.shape[1] - 8
        if given:
            extra = points[cells[:, 8:]]
            # files disagree on the order of middle nodes: each goes where the corners expect it
            free = _MIDDLES if given == 12 else np.setdiff1d(np.arange(27), CORNERS)
            distance = np.linalg.norm(extra[:, :, None] - x[:, None, free], axis=3)
            place = free[distance.argmin(axis=2)]
            wrong = np.flatnonzero((np.sort(place, axis=1) != free).any(axis=1))
            if len(wrong):
                raise MeshError(
                    f"{path}: {len(wrong)} hexahedra of {cells.shape[1]} nodes have middle nodes far from where they "
                    f"belong, the first is number {wrong[0]}; straighten its edges, or export linear hexahedra"
                )
            np.put_along_axis(x, place[:, :, None], extra, axis=1)
        if given == 12:
            x = _serendipity(x)
        parts.append(x)
        corners.append(corner)
    x, corner = np.concatenate(parts), np.concatenate(corners)
    mirrored = bool((_jacobians(x, np.zeros((1, 3))) < 0.0).all())
    if mirrored:
        turned = [i + 3 * j + 9 * k for k in range(3) for j in range(3) for i in (2, 1, 0)]
        x, corner = x[:, turned], corner[:, turned]
    return x, corner, mirrored


def _serendipity(x: Floats) -> Floats:
    """Middles of faces and cells (C, 27, 3) as a hexahedron of 20 nodes has them; updated in place."""
    x[:, _CENTRES] = 0.5 * x[:, _FACES[:, [0, 1, 1, 2], [1, 0, 2, 1]]].sum(axis=2)
    x[:, _CENTRES] -= 0.25 * x[:, _FACE_CORNERS].sum(axis=2)
    x[:, 13] = 0.25 * (x[:, _MIDDLES].sum(axis=1) - x[:, CORNERS].sum(axis=1))
    return x


def _jacobians(x: Floats, local: Floats) -> Floats:
    """J of eq. (1) at local coordinates (q, 3) of cells (C, 27, 3): (C, q) [m^3]."""
    slope, value = np.empty((len(local), 27, 3)), np.empty(27)
    for point, out in zip(np.ascontiguousarray(local, dtype=np.float64), slope, strict=True):
        hex27(point, value, out)
    return np.asarray(np.linalg.det(np.einsum("tai,qaj->tqij", x, slope, optimize=True)))


def cell_volumes_at(x: Floats) -> Floats:
    """Volumes (C,) [m^3] of cells with nodes x (C, 27, 3), as their masses have them."""
    return _jacobians(x, _GAUSS) @ _WEIGHTS


def _quality(path: str, x: Floats, remedy: str) -> tuple[Floats, Floats]:
    """Least J of each cell over its mean (C,), and its volume (C,) [m^3]; raises MeshError where J is not positive."""
    inner, outer = _jacobians(x, _GAUSS), _jacobians(x, _PLACES)
    volume = inner @ _WEIGHTS
    size = np.ptp(x, axis=1).max(axis=1)
    least = 8.0 * np.minimum(inner.min(axis=1), outer.min(axis=1)) / np.maximum(np.abs(volume), 1e-9 * size**3)
    bad = least <= 1e-6
    if bad.any():
        worst = int(np.argmin(least))
        centre = np.array2string(x[worst].mean(axis=0), precision=4)
        raise MeshError(
            f"{path}: {int(bad.sum())} of {len(x)} hexahedra are inverted or degenerate, the worst is number {worst} "
            f"around {centre} m, whose volume ratio falls to {least[worst]:.2g} of its mean; {remedy}"
        )
    return least, volume


def _number(path: str, x: Floats, corner: Cells) -> tuple[Ints, Floats]:
    """Nodes that cells share: cell_nodes (C, 27), x_rest (N, 3); corner (C, 27) the file's points at corners, else -1.

    Cells share the middle of an edge or face whose corners they share.
    """
    n_cells = len(x)
    key = np.full((n_cells, 27, 5), -1, dtype=np.int64)  # kind and corners, ascending
    key[:, CORNERS, 0], key[:, CORNERS, 1] = 0, corner[:, CORNERS]
    key[:, _MIDDLES, 0], key[:, _MIDDLES, 1:3] = 1, np.sort(corner[:, _ENDS], axis=2)
    key[:, _CENTRES, 0], key[:, _CENTRES, 1:] = 2, np.sort(corner[:, _FACE_CORNERS], axis=2)
    key[:, 13, 0], key[:, 13, 1] = 3, np.arange(n_cells)
    nodes, x_rest = shared_nodes(path, key, x, "hexahedra", "edge or face")
    return nodes.astype(np.int32), x_rest


def shared_nodes(path: str, key: Cells, x: Floats, cells: str, at: str) -> tuple[Cells, Floats]:
    """Number nodes of one key as one: nodes (C, k), places (N, 3); raises MeshError where their places differ.

    key (C, k, m) and x (C, k, 3) of each cell's nodes; cells, at: the words for them and for what neighbours share
    """
    _, first, number = np.unique(key.reshape(-1, key.shape[2]), axis=0, return_index=True, return_inverse=True)
    nodes, x_rest = number.reshape(key.shape[:2]), x.reshape(-1, 3)[first]
    apart = np.linalg.norm(x_rest[nodes] - x, axis=2).max(axis=1)
    torn = np.flatnonzero(apart > ALIKE * np.ptp(x, axis=1).max(axis=1))
    if len(torn):
        raise MeshError(
            f"{path}: {len(torn)} {cells} are curved otherwise than a neighbour at an {at} that they share, the first "
            f"is number {torn[0]}; let neighbours share their middle nodes"
        )
    return nodes, x_rest


def _outer_faces(path: str, cell_nodes: Ints) -> Cells:
    """Cell and face of every face that no two cells share (f, 2); raises MeshError where three meet."""
    _, number, count = np.unique(cell_nodes[:, _CENTRES], return_inverse=True, return_counts=True)
    shared = count[number.reshape(-1, 6)]
    if (shared > 2).any():
        cell = int(np.argwhere(shared > 2)[0, 0])
        raise MeshError(
            f"{path}: {int((count > 2).sum())} faces belong to three or more hexahedra, one of number {cell}; remove "
            "duplicate hexahedra"
        )
    return np.argwhere(shared == 1).astype(np.int64)


def _surface(x_rest: Floats, cell_nodes: Ints, outer: Cells) -> Surface:
    """Points at the nodes of the outer faces, eight triangles a face; areas by Simpson, which sum to the surface's."""
    nodes = cell_nodes[outer[:, 0][:, None, None], _FACES[outer[:, 1]]]  # (f, 3, 3)
    x = x_rest[nodes]
    slope = np.array([[-1.5, 2.0, -0.5], [-0.5, 0.0, 0.5], [0.5, -2.0, 1.5]])  # of the quadratics at -1, 0, 1
    along_u = np.einsum("pa,favi->fpvi", slope, x)
    along_v = np.einsum("qb,fubi->fuqi", slope, x)
    vector = np.cross(along_u, along_v) * (4.0 * np.outer(_SIMPSON_LINE, _SIMPSON_LINE))[None, :, :, None]
    area, normal = np.zeros(len(x_rest)), np.zeros((len(x_rest), 3))
    np.add.at(area, nodes, np.linalg.norm(vector, axis=3))
    np.add.at(normal, nodes, vector)
    points, first = np.unique(nodes, return_index=True)
    face = first // 9
    number = np.full(len(x_rest), -1, dtype=np.int32)
    number[points] = np.arange(len(points))
    triangles = []
    for i, j in product(range(2), range(2)):
        a, b, c, d = nodes[:, i, j], nodes[:, i + 1, j], nodes[:, i + 1, j + 1], nodes[:, i, j + 1]
        triangles += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    place = _FACES[outer[face, 1]].reshape(-1, 9)[np.arange(len(points)), first % 9]
    return Surface(
        cell=outer[face, 0].astype(np.int32),
        local=_PLACES[place],
        area=area[points],
        normal=normal[points] / np.linalg.norm(normal[points], axis=1, keepdims=True),
        triangles=number[np.concatenate(triangles)],
    )


def rough_places(centres: Floats) -> Ints:
    """Where cells lie, for those who divide them in halves (C, 3): about four places a cell along each axis."""
    size = np.ptp(centres, axis=0)
    pitch = max(float(size.max()), 1e-12) / (4.0 * np.cbrt(len(centres)) + 1.0)
    return np.asarray(np.rint((centres - centres.min(axis=0)) / pitch), dtype=np.int32)
