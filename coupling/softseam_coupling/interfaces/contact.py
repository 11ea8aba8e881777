"""Contact between two bodies: points of each press on faces of the other, with Coulomb's friction.

A point of one body at x_p is from the nearest face of the other, that looks towards it, g = n . (x_p - sum_i s_i x_i)
away, with the face's corners x_i, the weights s of the nearest place, and the normal n there: where both will be if
they go on as in the last step, kept over the step. It presses with p = -r g where that is positive (docs/decisions/19),
across it sticks to where it was, or slides. Points of both bodies do so, each with half of the area it stands for, and
less where it is beside the other's faces, none at half of the spacing:

    C = 1/r = 2/A (y_a + y_b),   y = h/(60 E)                                                                      (1)

of the bodies' spacing h and modulus E. What sticks is stretched by C t at its force t: a step's offset is

    T (x_p - sum_i s_i x_i) + C t_0,   T = 1 - n n^T                                                               (2)

as it begins, with the force t_0 that the point had then, so that nothing creeps under a force that stays.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interfaces.kind import Meeting, Pair, Rows
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
        for name, one in zip(spec.between, (a, b), strict=True):
            if one.surface is None:
                raise ValueError(
                    f"contact does not meet the surface of {name!r} yet, which runs through cells: take a block"
                )
            if not one.forces_at_end:
                raise ValueError(
                    f"contact of XPBD is solved in its pile, which {name!r} is not in, for another interface, a ladder or a "
                    "near region joins or cuts it, or whom it touches: leave that out, or give both bodies "
                    "`regions: {default: fem}`"
                )
        self._friction, self._sides = spec.friction, (_Side(a), _Side(b))
        self.nodes = self._sides[0].free, self._sides[1].free
        self._counts = tuple(len(side.surface.nodes) for side in self._sides)
        self._yield = sum(side.surface.yields for side in self._sides)
        self._force = np.zeros((sum(self._counts), 3))  # of each point, on its own body [N]
        self._x = self._sides[0].rest, self._sides[1].rest
        self._v = np.zeros_like(self._x[0]), np.zeros_like(self._x[1])
        self._ids = np.zeros(0, dtype=np.int64)
        """points whose rows were made last"""

    def rows(self, x: Pair, dt: float) -> Rows:
        spacing = min(side.surface.spacing for side in self._sides)
        at = [side.all(own) for side, own in zip(self._sides, x, strict=True)]
        to = [side.all(own + dt * v) for side, own, v in zip(self._sides, x, self._v, strict=True)]
        found = [self._of(own, at, to, spacing) for own in (0, 1)]
        self._ids = np.concatenate([each[0] for each in found])
        weights = tuple(np.concatenate([each[1][side] for each in found]) for side in (0, 1))
        gap, normal, area = (np.concatenate([each[k] for each in found]) for k in (2, 3, 4))
        compliance = 2.0 * self._yield / area
        before = self._force[self._ids]
        before[len(found[0][0]) :] *= -1.0  # on the first body
        offset = _across(gap + compliance[:, None] * before, normal)
        fixed = gap - (weights[0] @ x[0] - weights[1] @ x[1])  # by nodes that are clamped
        friction = np.full(len(gap), self._friction)
        return Rows((weights[0], weights[1]), offset - fixed, compliance, normal, friction, self._ids)

    def _of(
        self, own: int, at: list[Floats], to: list[Floats], spacing: float
    ) -> tuple[NDArray[np.int64], Pair, Floats, Floats, Floats]:
        """Rows of the points of one body, which go from `at` to `to` or so: ids, weights, ways and normals from the
        second body to the first (c, 3), areas (c,) [m^2]."""
        side, other = self._sides[own], self._sides[1 - own]
        points, faces, reach = to[own], to[1 - own], REACH * spacing
        close = _within(points, faces, reach)
        n = len(close)
        face, share, beside, normal = np.empty(n, dtype=np.int64), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
        if n:
            out = np.empty_like(points)
            point_normals(points, side.surface.triangles, out)
            nearest_faces(points[close], out[close], faces, other.surface.triangles, reach, face, share, beside, normal)
        covered = 1.0 - beside / reach
        met = np.flatnonzero((face >= 0) & (covered > 0.0))
        close, face, share, normal = close[met], face[met], share[met], normal[met]
        corners = other.surface.triangles[face]
        away = at[own][close] - np.einsum("ck,cki->ci", share, at[1 - own][corners])
        sign = 1.0 if own == 0 else -1.0
        mine, theirs = np.zeros((len(close), len(side.free))), np.zeros((len(close), len(other.free)))
        rows = np.arange(len(close))
        _put(mine, rows, side.place[close], np.ones(len(close)))
        for k in range(3):
            _put(theirs, rows, other.place[corners[:, k]], share[:, k])
        ids = close.astype(np.int64) + (0 if own == 0 else self._counts[0])
        pair = (mine, theirs) if own == 0 else (theirs, mine)
        return ids, pair, sign * away, sign * normal, covered[met] * side.surface.area[close]

    def commit(self, x: Pair, multipliers: Floats, dt: float) -> None:
        self._force[:] = 0.0
        sign = np.where(self._ids < self._counts[0], 1.0, -1.0)
        self._force[self._ids] = sign[:, None] * multipliers
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


class _Side:
    """A body in contact, p points of which some are clamped."""

    def __init__(self, meeting: Meeting) -> None:
        assert meeting.surface is not None
        self.surface = meeting.surface
        nodes = self.surface.nodes
        free = ~meeting.fixed[nodes]
        self.free = np.sort(nodes[free]).astype(np.int32)
        """nodes that may move, ascending (n,)"""
        self.place = np.where(free, np.searchsorted(self.free, nodes), -1)
        """place of each point among them, -1 of a clamped one (p,)"""
        self._at_rest = meeting.x_rest[nodes]
        self.rest = meeting.x_rest[self.free]

    def all(self, x: Floats) -> Floats:
        """Where all points are, with the free nodes at x (n, 3) [m] (p, 3)."""
        if not len(x):
            return self._at_rest
        return np.where(self.place[:, None] >= 0, x[self.place], self._at_rest)


def _within(points: Floats, others: Floats, reach: float) -> NDArray[np.int64]:
    """Numbers of points (p, 3) no farther than reach [m] from the box around others (q, 3)."""
    low, high = others.min(axis=0) - reach, others.max(axis=0) + reach
    return np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))


def _put(weights: Floats, rows: NDArray[np.int64], places: NDArray[np.int64], share: Floats) -> None:
    """Add shares (c,) at places of rows (c,), where these are not clamped."""
    moves = places >= 0
    np.add.at(weights, (rows[moves], places[moves]), share[moves])


def _across(vectors: Floats, normal: Floats) -> Floats:
    """Without what is along unit normals (c, 3)."""
    return np.asarray(vectors - np.einsum("ck,ck->c", vectors, normal)[:, None] * normal)
