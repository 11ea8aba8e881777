"""Points of a region at which tools touch: those of the body's surface, then points inside faces of cells.

On a block the former are nodes, half a cell apart, and what is round, or has an edge, passes between them. So planes
and boxes that cover the block touch there, and all other tools inside faces, at the middles of 2 x 2 patches a block,
as in FEM (tools/face_points.py).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.bulges import bulges
from softseam_services.body.contact_points import PENALTY, is_embedded, point_stiffness
from softseam_services.body.interpolate import point_weights
from softseam_services.body.outer_faces import outer_faces
from softseam_services.shapes.branches import CYLINDER
from softseam_services.tools.edged import pressing_between
from softseam_services.tools.face_points import FacePoints, face_points
from softseam_services.tools.kernels import DENSE, LIGHT, SAG, WIDE, sag_by
from softseam_services.tools.tool_set import ToolSet

THINNEST = 0.125
"""half the length of a cylinder that presses inside faces, in edges of a cell"""

Mask = NDArray[np.bool_]
Rows = tuple[Ints, Ints, Floats]


class Points(NamedTuple):
    """p points of a region, the surface's k first; t tools."""

    rows: Rows
    """which nodes each follows, as of `point_weights`"""
    tilt: Floats
    """as of `FacePoints`, 0 on the surface (entries, 2)"""
    touches: Mask
    """(p, t)"""
    give: Floats
    """compliance of contact, 1/r of body/contact_points.py, inside faces that of tools/kernels/patch.py; 0 at nodes
    (p,) [m/N]"""
    lag: Floats
    """how much farther a point that is pressed firmly is inside a tool for the tool's being round, (1 - LIGHT/DENSE) s
    of tools/kernels/patch.py, or for the surface's, `with_bulges` (p, t) [m]"""
    ease: float
    """q/(1 - q) of the law there, q = LIGHT/DENSE; of an embedded surface LIGHT/PENALTY [1]"""
    visits: Ints
    """the order in which contacts take them (p,)"""


def find_points(body: Body, region: Region, tools: ToolSet, coarse: Mask) -> Points:
    """The points of a region, of whose cells those that are `coarse` (c,) are one block. Inside faces there are none
    without tools that press between nodes."""
    indptr, node, weight = point_weights(body, region, "hex8")
    touches = np.tile(body.surface.area[region.points][:, None] > 0.0, len(tools.names))
    give, lag, ease = np.zeros(len(touches)), np.zeros(touches.shape), LIGHT / (DENSE - LIGHT)
    if is_embedded(body):
        stiffness = point_stiffness(body, region, np.full(len(give), 0.5 * body.resolution))
        np.divide(1.0, stiffness, out=give, where=stiffness > 0.0)
    between = pressing_between(tools, body) & ~_thin_discs(tools, body)
    if not between.any():
        visits = _by_colours(body, region, indptr, node)
        return Points((indptr, node, weight), np.zeros((len(weight), 2)), touches, give, lag, ease, visits)
    inner = face_points(body, region, outer_faces(body, region), "hex8")
    h = inner.edge[inner.face] * np.where(coarse[inner.cell], 1.0, 0.5)  # of blocks
    visits = _by_colours(body, region, inner.indptr, inner.node)
    touches &= ~(between & np.isin(node, inner.node)[:, None])
    return Points(
        (
            np.concatenate([indptr, indptr[-1] + inner.indptr[1:]]),
            np.concatenate([node, inner.node]),
            np.concatenate([weight, inner.weight]),
        ),
        np.concatenate([np.zeros((len(weight), 2)), inner.tilt]),
        np.concatenate([touches, np.tile(between, (len(inner.cell), 1))]),
        np.concatenate([give, h / (DENSE * _young(body, region, inner) * inner.area)]),
        np.concatenate([lag, (1.0 - LIGHT / DENSE) * tools.bends * _sag(tools.half_width, h[:, None])]),
        ease,
        np.concatenate([np.arange(len(touches), dtype=np.int32), len(touches) + visits]),
    )


def with_bulges(points: Points, body: Body, region: Region) -> Points:
    """Where the surface runs through cells: s by how far it stands out from what they can flatten, q = LIGHT/PENALTY
    (docs/decisions/45). Points inside faces have their tool's."""
    if not body.cut or len(points.touches) > len(region.points):
        return points
    sag = 8.0 * SAG * bulges(body, region)  # between nodes h apart SAG h^2/R
    lag = np.repeat((1.0 - LIGHT / PENALTY) * sag[:, None], points.touches.shape[1], axis=1)
    return points._replace(lag=lag, ease=LIGHT / (PENALTY - LIGHT))


def _sag(half_width: Floats, h: Floats) -> Floats:
    """s of tools/kernels/patch.py [m], of tools of half width R [m] on blocks of edge h [m]. It is (R/h)^(1/3) times
    FEM's under what is wider than a block, as forces of balls and rods ask for (docs/decisions/43)."""
    return np.asarray(np.clip(half_width / h, 1.0, WIDE) ** (1.0 / 3.0) * sag_by(half_width, h))


def _by_colours(body: Body, region: Region, indptr: Ints, node: Ints) -> Ints:
    """Points of a surface (p,) as contacts take them. Those that are nodes stay in order, for each is alone; of others
    those of octants that share no node come one after another, which eight lanes can take at once: in the order of
    cells each would wait for its neighbour's.

    Of each octant the first point, then of each the second, and so on: every time by the eight colours of a lattice.
    """
    if len(node) == len(indptr) - 1:
        return np.arange(len(node), dtype=np.int32)
    places = body.x_rest[region.nodes][node]
    low, high = (extreme.reduceat(places, indptr[:-1]) for extreme in (np.minimum, np.maximum))
    edge = (high - low).max(axis=0)
    octant = np.rint((low - low.min(axis=0)) / np.where(edge > 0.0, edge, 1.0)).astype(np.int64)
    _, own = np.unique(octant, axis=0, return_inverse=True)
    own = own.ravel()
    by_octant = np.argsort(own, kind="stable")
    first = np.searchsorted(own[by_octant], own[by_octant])
    number = np.empty(len(own), dtype=np.int64)
    number[by_octant] = np.arange(len(own)) - first
    return np.lexsort((own, (octant & 1) @ np.array([1, 2, 4]), number)).astype(np.int32)


def _thin_discs(tools: ToolSet, body: Body) -> Mask:
    """Cylinders so short that a fast point, which yields a little, would be past their middle; nodes do not (t,)."""
    return np.asarray((tools.kind == CYLINDER) & (tools.shape[:, 1] < THINNEST * body.resolution))


def _young(body: Body, region: Region, inner: FacePoints) -> Floats:
    """Young's modulus where points inside faces are (q,) [Pa]."""
    octant = (inner.local >= 0.0) @ np.array([1, 2, 4])
    young = body.of_octants([material.young for material in body.materials])
    return np.asarray(young[region.cells[inner.cell], octant])


def hand_on(force: Floats, touches: Mask, n_surface: int, rows: Rows) -> None:
    """Contact forces (p, t, 3) [N] of points that do not touch a tool to others that do, tool by tool; in place.

    A node's goes inside the faces around it, and that of a point between nodes to theirs. The total is kept, and
    between nodes the torque, where all of them have points. Where nothing touches, the force is dropped: no contact
    looks at such a point again, so that what it carried would push for ever.
    """
    single = np.diff(rows[0]) == 1
    for tool in range(force.shape[1]):
        idle = np.flatnonzero(~touches[:, tool] & force[:, tool].any(axis=1))
        takes = np.flatnonzero(touches[:, tool] & (single | (np.arange(len(touches)) >= n_surface)))
        if len(idle):
            given = _shares(rows, idle, takes).T @ force[idle, tool]
            force[idle, tool] = 0.0
            force[takes, tool] += given


class Gathering:
    """Forces on points inside faces as forces on the surface's, with the same sums: of so many points of the surface,
    and all points by the nodes that they follow."""

    def __init__(self, rows: Rows, n_surface: int) -> None:
        self._n_surface = n_surface
        self._single = np.flatnonzero(np.diff(rows[0])[:n_surface] == 1)
        inner = np.arange(n_surface, len(rows[0]) - 1)
        self._share = _shares(rows, inner, self._single).T if len(inner) else None

    def __call__(self, force: Floats) -> Floats:
        """Forces (p, t, 3) [N] on all points as forces on the surface's (k, t, 3): what acts inside a face is its
        nodes', of those that have points on this side of a seam."""
        summed = force[: self._n_surface].copy()
        if self._share is not None:
            inner = force[self._n_surface :]
            for tool in np.flatnonzero(inner.any(axis=(0, 2))).tolist():
                summed[self._single, tool] += self._share @ inner[:, tool]
        return summed


def _shares(rows: Rows, gives: NDArray[np.int64], takes: NDArray[np.int64]) -> csr_array:
    """What each of some points takes of each of others, by the nodes that both follow; each gives all that it has, or
    nothing where none of its nodes is followed (gives, takes)."""
    places = csr_array((rows[2], rows[1], rows[0]), shape=(len(rows[0]) - 1, int(rows[1].max(initial=-1)) + 1))
    share = places[gives] @ places[takes].T
    total = share.sum(axis=1)
    return share.multiply(np.divide(1.0, total, out=np.zeros_like(total), where=total > 0.0)[:, None]).tocsr()
