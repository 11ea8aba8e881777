"""Stress recovered at the nodes from the points where it is most accurate.

Superconvergent patch recovery: O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331-1364. Around
each node a quadratic polynomial, of the order of the cell's displacements, is fitted component by component to the
stresses at the sample points of the cells that share the node; its value there is the recovered stress. FEM samples at
the 2 x 2 x 2 Gauss points, PBD at the centres of its blocks. In cells that the body fills in part FEM has the mean over
the filled part of each octant, which a linear stress has at its centroid. Samples weigh as much as their octant is
filled; empty octants have none.

    sigma*_n = m + a . A^+ <r', sigma> + b . S^+ <s', sigma>,   A = <r', r'>,   S = <s', s'>                       (1)

with r the distance to the node over its mean along each axis, r' = r - <r>/<1>, s' what of s = (r_x^2, r_y^2, r_z^2,
r_x r_y, r_y r_z, r_z r_x) a constant and r' do not give, <u, v> = sum_q w_q u_q v_q, m the mean, and a, b the values of
r' and s' at the node: mean, slopes and curvatures, each fitted to what the ones before leave. The pseudo-inverses leave
out what the samples leave open: the two planes of samples in a single cell fix no curvature, and the fit is linear
across that cell; a single octant's value is taken as it is. Where another material is in reach the fit is linear, too:
stress is singular at the edges of borders, and a curvature fitted to that overshoots.
The fit depends on the rest state alone: a sparse matrix, built once.

Between the nodes, the polynomials P_v around a cell's corners count by its trilinear functions N_v (on a tetrahedron by
its linear ones),

    sigma*(x) = sum_v N_v(x) P_v(x)                                                                                (2)

(T. Blacker, T. Belytschko, Int. J. Numer. Meth. Engng 37 (1994) 517-536), each with all the cells around it: a node in
the middle of a cell sees that one cell, which fixes no curvature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_protocol.models import GAUSS_POINTS
from softseam_services.body import tetrahedron
from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.filled import FILL_FLOOR, filled_centroids, filled_moments
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.own_shapes import sample_places

_CORNERS: Ints = np.flatnonzero((LOCAL % 2 == 0).all(axis=1)).astype(np.int32)
"""local ids of a cell's corners (8,)"""
_ALL = np.arange(27, dtype=np.int32)
FEM_SAMPLE = GAUSS_POINTS
"""local coordinates of the samples are +- this"""
SEEN = 1e-6
"""eigenvalue, over the sum of the weights, from which on the samples determine a slope or a curvature"""


@dataclass(frozen=True)
class _Patches:
    """What the samples around each of some nodes give, n of which have any."""

    cells: Ints
    """those that share one of the nodes (c,)"""
    weighted: Floats
    """w_q (1, r, s) of eq. (1), of each of the k nodes of these cells and each sample (c, k, 8, 10)"""
    scale: Floats
    """mean distance of each node's samples along each axis (N, 3), in what `_offsets` measures"""
    row: Ints
    """place of a node among the n, -1 where it has no sample or was not asked for (N,)"""
    total: Floats
    """<1> (n, 1)"""
    mean: Floats
    """of (1, r, s) (n, 10)"""
    slopes: Floats
    """A^+ (n, 3, 3)"""
    slanted: Floats
    """of s by r' (n, 3, 6)"""
    bends: Floats
    """S^+ (n, 6, 6); 0 where another material is in reach"""

    def fit(self, row: Ints, r: Floats) -> Floats:
        """Factors of `weighted` (p, 10) for the value at r (p, 3) of the polynomial around the node in place `row`."""
        mean, away = self.mean[row], r - self.mean[row, 1:4]
        bend = np.concatenate([r * r, r * np.roll(r, -1, axis=1)], axis=1) - mean[:, 4:]
        bend -= np.einsum("pi,pij->pj", away, self.slanted[row])
        found = np.empty((len(row), 10))
        found[:, 4:] = (self.bends[row] @ bend[..., None])[..., 0]
        found[:, 1:4] = (self.slopes[row] @ away[..., None] - self.slanted[row] @ found[:, 4:, None])[..., 0]
        found[:, 0] = 1.0 / self.total[row, 0] - (found[:, 1:] * mean[:, 1:]).sum(axis=1)
        return found


def nodal_recovery(body: Body, sample: Floats, material: int = 0) -> csr_array:
    """Matrix (N, 8 C) that takes values at all octants, cell by cell, to the nodes.

    sample (C,) local coordinate of each cell's samples; material: only its octants count, as stress jumps where another
    begins. Rows of nodes without such an octant in reach are zero.
    """
    patches = _patches(body, sample, material, np.arange(body.n_nodes, dtype=np.int32))
    fit = np.zeros((body.n_nodes, 10))
    found = patches.row >= 0
    fit[found] = patches.fit(patches.row[found], np.zeros((int(found.sum()), 3)))
    cell_nodes = body.cell_nodes[patches.cells][:, _places(body)]
    weight = np.einsum("caq,canq->can", fit[cell_nodes], patches.weighted)
    row = np.broadcast_to(cell_nodes[:, :, None], weight.shape)
    column = np.broadcast_to((8 * patches.cells[:, None] + np.arange(8))[:, None, :], weight.shape)
    entries = (weight.ravel(), (row.ravel(), column.ravel()))
    return csr_array(entries, shape=(body.n_nodes, 8 * body.n_cells))


def point_recovery(body: Body, sample: Floats, material: int, cell: Ints, local: Floats, at: Floats) -> csr_array:
    """Matrix (p, 8 C) that takes values at all octants, cell by cell, to points of a material, eq. (2).

    cell (p,), local (p, 3) and at (p, 3) [m]: the cell that each is in, where in it, in [-1, 1], and where at rest.
    """
    ids, share = _corner_shares(body, local)
    n_corners, n_places = len(ids), len(_places(body))
    corners = body.cell_nodes[cell][:, ids].ravel()
    patches = _patches(body, sample, material, corners)
    r = np.repeat(at, n_corners, axis=0) - body.x_rest[corners]
    r = (body.along_axes(r) / body.edges if body.boxes else r) / patches.scale[corners]
    fit = share.reshape(-1, 1) * patches.fit(patches.row[corners], r)
    shared = body.cell_nodes[patches.cells][:, _places(body)].ravel()
    places = csr_array((np.ones(len(shared)), (shared, np.arange(len(shared)))), shape=(body.n_nodes, len(shared)))
    corner, place = places[corners].nonzero()
    weight = np.einsum("eq,enq->en", fit[corner], patches.weighted.reshape(-1, 8, 10)[place])
    row = np.broadcast_to((corner // n_corners)[:, None], weight.shape)
    column = 8 * patches.cells[place // n_places][:, None] + np.arange(8)
    return csr_array((weight.ravel(), (row.ravel(), column.ravel())), shape=(len(cell), 8 * body.n_cells))


def _patches(body: Body, sample: Floats, material: int, nodes: Ints) -> _Patches:
    """Of these nodes."""
    wanted = np.zeros(body.n_nodes, dtype=np.bool_)
    wanted[nodes] = True
    cells = np.flatnonzero(wanted[body.cell_nodes].any(axis=1)).astype(np.int32)
    cell_nodes = body.cell_nodes[cells][:, _places(body)]
    r = _offsets(body, sample, cells)  # (c, k, 8, 3)
    square, count = np.zeros((body.n_nodes, 3)), np.bincount(cell_nodes.ravel(), minlength=body.n_nodes)
    np.add.at(square, cell_nodes, (r * r).mean(axis=2))
    scale = np.sqrt(square / np.maximum(count, 1)[:, None])
    r /= scale[cell_nodes][:, :, None]
    p = np.concatenate([np.ones((*r.shape[:3], 1)), r, r * r, r * np.roll(r, -1, axis=3)], axis=3)
    weighted = p * (body.fill * (body.octant_material == material))[cells][:, None, :, None]
    moments = np.zeros((body.n_nodes, 10, 10))
    np.add.at(moments, cell_nodes, np.swapaxes(weighted, 2, 3) @ p)
    found = np.flatnonzero(wanted & (moments[:, 0, 0] > 0.0))
    total = moments[found, :1, 0]
    mean = moments[found, 0] / total
    centred = moments[found] - total[..., None] * mean[:, :, None] * mean[:, None, :]
    slopes = _inverse(centred[:, 1:4, 1:4], SEEN * total)
    slanted = slopes @ centred[:, 1:4, 4:]
    left = centred[:, 4:, 4:] - np.swapaxes(centred[:, 1:4, 4:], 1, 2) @ slanted
    bends = _inverse(left, SEEN * total)
    bends[_beside_another(body, material, cells)[found]] = 0.0
    row = np.full(body.n_nodes, -1, dtype=np.int32)
    row[found] = np.arange(len(found))
    return _Patches(cells, weighted, scale, row, total, mean, slopes, slanted, bends)


def _places(body: Body) -> Ints:
    """Local ids of the nodes that its cells have (k,)."""
    return tetrahedron.NODES if body.tetrahedra else _ALL


def _corner_shares(body: Body, local: Floats) -> tuple[Ints, Floats]:
    """Local ids of a cell's corners (v,), and N_v of eq. (2) at places in cells (p, 3): (p, v)."""
    if body.tetrahedra:
        return tetrahedron.CORNERS, tetrahedron.barycentric_of(local)
    return _CORNERS, np.asarray((0.5 * (1.0 + (LOCAL[_CORNERS] - 1.0) * local[:, None])).prod(axis=2))


def _beside_another(body: Body, material: int, cells: Ints) -> NDArray[np.bool_]:
    """Nodes with a filled octant of another material in one of their cells (N,)."""
    mixed = ((body.octant_material != material) & (body.fill > 0.0))[cells].any(axis=1)
    beside = np.zeros(body.n_nodes, dtype=np.bool_)
    beside[body.cell_nodes[cells[mixed]]] = True
    return beside


def _inverse(matrix: Floats, least: Floats) -> Floats:
    """Pseudo-inverses of symmetric matrices (n, k, k), without the eigenvalues below `least` (n, 1)."""
    value, vector = np.linalg.eigh(matrix)
    scale = np.where(value > least, 1.0 / np.maximum(value, least), 0.0)
    return np.asarray((vector * scale[:, None, :]) @ np.swapaxes(vector, 1, 2))


def _offsets(body: Body, sample: Floats, cells: Ints) -> Floats:
    """From every node of these cells to their samples (c, k, 8, 3), in cell edges on boxes, else in metres."""
    if not body.boxes:
        x = body.x_rest[body.cell_nodes[cells][:, _places(body)]]
        return np.asarray(sample_places(body, sample)[cells, None] - x[:, :, None])
    return np.asarray(0.5 * (_sample_coordinates(body, sample, cells)[:, None] - (LOCAL - 1.0)[:, None, :]))


def _sample_coordinates(body: Body, sample: Floats, cells: Ints) -> Floats:
    """Local coordinates of the samples of box cells (c, 8, 3)."""
    octant = (LOCAL - 1.0)[OCTANT_NODES].sum(axis=1) / 4.0  # -1 or 1 along each axis
    at = sample[cells, None, None] * octant
    cut = (sample[cells] == FEM_SAMPLE) & (body.fill[cells] < 1.0).any(axis=1)
    fill = np.maximum(body.fill[cells[cut]], FILL_FLOOR)
    at[cut] = filled_centroids(filled_moments(body, cells[cut], fill))
    return np.asarray(at)


_SHEAR = np.sqrt(6.0)
_DIFFERENCES = np.array(
    [
        [1.0, 0.0, -1.0, 0.0, 0.0, 0.0],
        [-1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, -1.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, _SHEAR, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, _SHEAR, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, _SHEAR],
    ]
)
"""of xx yy zz yz xz xy, the sum of whose squares is 3 s:s"""


def von_mises(cauchy: Floats) -> Floats:
    """von Mises stress sqrt(3/2 s:s) of Cauchy stresses xx yy zz yz xz xy (..., 6) [Pa]."""
    differences = cauchy.reshape(-1, 6) @ _DIFFERENCES
    squares = np.einsum("...k,...k->...", differences, differences)
    return np.asarray(np.sqrt(0.5 * squares).reshape(cauchy.shape[:-1]))
