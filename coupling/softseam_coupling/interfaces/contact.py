"""Contact between two bodies: patches of one press on faces of the other, with Coulomb's friction.

Of the body whose nodes are closer points q are *sampled*, as close as its functions ask for (`Surface`). Each, of area
a_q, is from the nearest triangle of the other that looks towards it a way d_q from the foot there: where both will be
if they go on as in the last step, kept over the step. One that is beside the faces counts less, none at half of the
spacing. The other's nodes are farther apart than these points: alone each would ask for a force of its own. So points
are gathered by the weights t_qi of the places i of nodes around their feet (a mortar with lumped multipliers):

    A_i = sum_q a_q t_qi,   w_qi = a_q t_qi/A_i,   d_i = sum_q w_qi d_q,   n_i ~ sum_q w_qi n_q                   (1)

and patch i presses with p = -r g where g = n_i . d_i is negative (docs/decisions/19), across it sticks to where it was,
or slides:

    C = 1/r = (y_a + y_b)/A_i,   y = h/(60 E)                                                                      (2)

of the bodies' spacing h and modulus E. Its force goes to the points and to their feet by the same weights: an even
pressure puts on the nodes of both what their functions say, however unlike their cells. Points of a surface that runs
through cells are no closer than patches would be, and round: each is a patch by itself, y = h/(20 E), for what is open
around a round contact would keep a patch open that is half in it. What sticks is stretched by C t at its force t: a
step's offset is

    T d_i + C t_0,   T = 1 - n n^T                                                                                 (3)

as it begins, with the force t_0 that the patch had then, so that nothing creeps under a force that stays.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from softseam_coupling.interfaces.kind import Ids, Meeting, Pair, Rows, Surface
from softseam_coupling.kernels.nearest_face import nearest_faces, point_normals

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

REACH = 0.5
"""of the points' spacing: so near a face a point may touch it in a step, and so far beside it a point counts [1]"""


class Rubs(Protocol):
    """What a scene says of it."""

    @property
    def between(self) -> tuple[str, str]:
        """Names of the bodies."""

    @property
    def friction(self) -> float:
        """Coulomb's coefficient [1]."""


class Contact:
    """See the module."""

    def __init__(self, spec: Rubs, a: Meeting, b: Meeting) -> None:
        surfaces = []
        for name, one in zip(spec.between, (a, b), strict=True):
            if one.surface is None:
                raise ValueError(
                    f"contact does not meet {name!r} yet, whose cells are tetrahedra: take a block, or a closed surface"
                )
            if not one.forces_at_end:
                raise ValueError(
                    f"contact of XPBD is solved in its pile, which {name!r} is not in, for another interface, a ladder "
                    "or a near region joins or cuts it, or whom it touches: leave that out, or give both bodies "
                    "`regions: {default: fem}`"
                )
            surfaces.append(one.surface())
        first, second = surfaces
        through = first.through_cells, second.through_cells
        self._fine = int(through[1]) if through[0] != through[1] else int(first.spacing >= second.spacing)
        """which of the two is sampled: one that runs through cells, the finer one of two alike"""
        self._friction, self._surfaces = spec.friction, (first, second)
        self.nodes = first.nodes, second.nodes
        self._yield = first.yields + second.yields
        self._reach = REACH * min(first.spacing, second.spacing)
        sampled, other = surfaces[self._fine], surfaces[1 - self._fine]
        n_patches = len(sampled.area) if sampled.through_cells else other.n_patches
        self._force = np.zeros((n_patches, 3))  # of each patch, on the first body [N]
        self._x = a.x_rest[first.nodes], b.x_rest[second.nodes]
        self._v = np.zeros_like(self._x[0]), np.zeros_like(self._x[1])
        self._ids = np.zeros(0, dtype=np.int64)
        """patches whose rows were made last"""

    def rows(self, x: Pair, dt: float) -> Rows:
        sampled, other = self._surfaces[self._fine], self._surfaces[1 - self._fine]
        to = [side.places(own + dt * v) for side, own, v in zip(self._surfaces, x, self._v, strict=True)]
        points, faces = to[self._fine], to[1 - self._fine]
        close, face, foot, area, facing = self._near(sampled, points, other, faces)
        if not len(close):
            self._ids = close
            return _no_rows(x)
        theirs, clamped = other.within(face, foot)
        ways = sampled.places(x[self._fine])[close] - theirs @ x[1 - self._fine] - clamped
        sign = 1.0 if self._fine == 0 else -1.0
        self._ids, total, weights, facing = (
            (close, area, csr_array(eye_array(len(close))), facing)
            if sampled.through_cells
            else _gather(area[:, None] * _shares(other, face, foot), facing)
        )
        gap, normal = sign * (weights @ ways), sign * facing
        of_fine, of_other = (weights @ sampled.weights[close]).toarray(), (weights @ theirs).toarray()
        pair = (of_fine, of_other) if self._fine == 0 else (of_other, of_fine)
        compliance = self._yield / total
        offset = _across(gap + compliance[:, None] * self._force[self._ids], normal)
        fixed = gap - (pair[0] @ x[0] - pair[1] @ x[1])  # by nodes that are clamped
        friction = np.full(len(total), self._friction)
        return Rows(pair, offset - fixed, compliance, normal, friction, self._ids)

    def _near(
        self, sampled: Surface, points: Floats, other: Surface, faces: Floats
    ) -> tuple[Ids, Ids, Floats, Floats, Floats]:
        """Sampled points that may touch: their numbers, triangles, weights of the corners of these in the feet (n, 3),
        areas (n,) [m^2], and normals out of the triangles (n, 3)."""
        close = _within(points, faces, self._reach)
        n = len(close)
        face, share, beside, normal = np.empty(n, dtype=np.int64), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
        if n:
            out = _normals(sampled, points)
            out = np.einsum("qk,qki->qi", sampled.upon_share[close], out[sampled.upon[close]])
            nearest_faces(
                *(points[close], out, faces, other.triangles, self._reach, self._reach),
                *(face, share, beside, normal),
            )
        covered = 1.0 - beside / self._reach
        met = np.flatnonzero((face >= 0) & (covered * sampled.area[close] > 0.0))
        close, face, normal = close[met], face[met], normal[met]
        foot = _feet(points[close], faces[other.triangles[face]])
        if len(close) and other.rounded.any():
            normal = _round(other, faces, face, share[met], normal)
        return close, face, foot, covered[met] * sampled.area[close], normal

    def commit(self, x: Pair, multipliers: Floats, dt: float) -> None:
        self._force[:] = 0.0
        self._force[self._ids] = multipliers
        self._v = (x[0] - self._x[0]) / dt, (x[1] - self._x[1]) / dt
        self._x = x[0].copy(), x[1].copy()

    def save(self) -> dict[str, Floats]:
        ends = zip("ab", self._x, self._v, strict=True)
        return {"force": self._force} | {f"{of}_{k}": each for k, x, v in ends for of, each in (("x", x), ("v", v))}

    def load(self, arrays: Mapping[str, Floats]) -> None:
        found = {key: np.array(arrays[key]) for key in self.save()}
        if any(found[key].shape != own.shape for key, own in self.save().items()):
            raise ValueError("the saved contact is of other bodies")
        self._force, self._x = found["force"], (found["x_a"], found["x_b"])
        self._v = found["v_a"], found["v_b"]


def _no_rows(x: Pair) -> Rows:
    """Of bodies with their nodes at x."""
    a, b = (np.zeros((0, len(own))) for own in x)
    none = np.zeros((0, 3))
    return Rows((a, b), none, np.zeros(0), none, np.zeros(0), np.zeros(0, dtype=np.int64))


def _within(points: Floats, others: Floats, reach: float) -> Ids:
    """Numbers of points (p, 3) no farther than reach [m] from the box around others (q, 3)."""
    low, high = others.min(axis=0) - reach, others.max(axis=0) + reach
    return np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))


def _feet(points: Floats, corners: Floats) -> Floats:
    """Weights (n, 3) of the corners (n, 3, 3) of triangles in the feet of points (n, 3) on their planes, which may be
    outside: there force and reaction are on one line."""
    b, c, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    bb, bc, cc, pb, pc = (np.einsum("nk,nk->n", *pair) for pair in ((b, b), (b, c), (c, c), (p, b), (p, c)))
    size = bb * cc - bc * bc
    second, third = (cc * pb - bc * pc) / size, (bb * pc - bc * pb) / size
    return np.stack([1.0 - second - third, second, third], axis=1)


def _normals(surface: Surface, points: Floats) -> Floats:
    """Unit vectors out of a surface with its points there (p, 3), at these (p, 3)."""
    found = np.empty_like(points)
    point_normals(points, surface.triangles, found)
    return found


def _round(surface: Surface, points: Floats, face: Ids, share: Floats, normal: Floats) -> Floats:
    """Normals (n, 3) of triangles (n,) at places with weights of their corners (n, 3), where the surface is rounded."""
    corners = _normals(surface, points)[surface.triangles[face]]
    corners = np.where(surface.rounded[face][:, :, None], corners, normal[:, None])
    found = np.einsum("nk,nki->ni", share, corners)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _shares(surface: Surface, face: Ids, foot: Floats) -> Floats:
    """Weights t (n, patches) of the places around feet with weights (n, 3) in triangles (n,), none negative."""
    within = np.maximum(foot, 0.0)
    within /= within.sum(axis=1, keepdims=True)
    corners = surface.triangles[face]
    found = np.zeros((len(face), surface.n_patches))
    rows = np.arange(len(face))[:, None]
    for k in range(3):
        np.add.at(found, (rows, surface.among[corners[:, k]]), within[:, k, None] * surface.part[corners[:, k]])
    return found


def _gather(shares: Floats, facing: Floats) -> tuple[Ids, Floats, csr_array, Floats]:
    """Eq. (1) of areas a_q t_qi (n, patches) and normals (n, 3): which patches there are, A_i, w_iq and n_i of them."""
    total, normal = np.asarray(shares.sum(axis=0)), shares.T @ facing
    length = np.linalg.norm(normal, axis=1)
    ids = np.flatnonzero((total > 0.0) & (length > 0.0))
    return ids, total[ids], csr_array((shares[:, ids] / total[ids]).T), normal[ids] / length[ids, None]


def _across(vectors: Floats, normal: Floats) -> Floats:
    """Without what is along unit normals (c, 3)."""
    return np.asarray(vectors - np.einsum("ck,ck->c", vectors, normal)[:, None] * normal)
