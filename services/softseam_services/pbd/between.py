"""What bodies of a pile do to one another: who may meet, with what forces, and what a step did."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interfaces import Faces
from softseam_protocol.messages.pile import Met
from softseam_protocol.scene.interfaces import written_key
from softseam_services.body.body import Floats, Ints
from softseam_services.body.contact_faces import faces_of
from softseam_services.body.errors import SettingError
from softseam_services.body.sampled_faces import SampledFaces
from softseam_services.jit import Rows

from .guests import Guests
from .kernels.between import IMPULSE, N_INTS, N_MET, N_NUMBERS, Touch, find_groups, find_rows
from .pile_pieces import Piece, Pieces

Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]

_NO_NODES = np.zeros(0, dtype=np.int32)
_NO_FACES = Faces(_NO_NODES, np.zeros((0, 3), dtype=np.int32), np.zeros(0), 0.0, 0.0)


@dataclass(frozen=True)
class Contact:
    """Between two bodies of a pile, or with a guest of it."""

    bodies: tuple[int, int]
    """their numbers, those of guests after those of the pile's bodies"""
    friction: float
    """Coulomb's coefficient [1]"""


class Group(NamedTuple):
    """What touches one another in a step, directly or by others."""

    bodies: Numbers
    """numbers of bodies of the pile"""
    guests: Numbers
    """and of guests, among these"""
    met: Numbers
    """of contacts between bodies"""
    visits: Numbers
    """and of those with guests"""


class Between:
    """The contacts of a pile, by the names of their interfaces. Raises SettingError for a body that cannot have any."""

    def __init__(self, contacts: Mapping[str, Contact], pieces: Pieces, guests: Guests) -> None:
        own, m = len(pieces.each), len(contacts)
        b = own + len(guests.faces)
        pair = np.array([each.bodies for each in contacts.values()], dtype=np.int32).reshape(m, 2)
        faces: list[Faces | SampledFaces] = [*[_NO_FACES] * own, *guests.faces]
        for name, contact in contacts.items():
            for body in contact.bodies:
                if body < own and faces[body] is _NO_FACES:
                    faces[body] = _faces(name, pieces.each[body])
        nodes = [each.nodes if isinstance(each, Faces) else np.arange(len(each.area)) for each in faces]
        masses = [piece.parameters.arrays.inverse_mass[at] for piece, at in zip(pieces.each, nodes[:own], strict=True)]
        self._guests, self._n_own = guests, own
        counts = np.array([len(each.area) for each in faces])
        rows = np.concatenate([pieces.first_row, pieces.n_rows + np.cumsum([0, *counts[own:]])[:-1]]).astype(np.int32)
        number = np.full(pieces.n_rows + counts[own:].sum(), -1, dtype=np.int32)
        for first, own_nodes in zip(rows, nodes, strict=True):
            number[first + own_nodes] = np.arange(len(own_nodes))
        self._ends = np.cumsum([0, *counts[pair].ravel()])
        self.touch = Touch(
            first=_ends(counts),
            node=np.concatenate(nodes).astype(np.int32),
            row=rows,
            number=number,
            first_triangle=_ends(len(each.triangles) for each in faces),
            corners=np.concatenate([each.triangles for each in faces]).astype(np.int32),
            area=np.concatenate([each.area for each in faces]),
            inverse_mass=np.concatenate([*masses, np.zeros(sum(counts[own:]))]),
            yields=np.array([each.yields for each in faces]),
            spacing=np.array([each.spacing for each in faces]),
            pair=pair,
            friction=np.array([each.friction for each in contacts.values()], dtype=np.float64),
            presses=np.array([_shares(faces[one], faces[other]) for one, other in pair.tolist()]).reshape(m, 2),
            place=self._ends[:-1].reshape(m, 2).astype(np.int32),
            at=np.zeros((counts.sum(), 3)),
            to=np.zeros((counts.sum(), 3)),
            out=np.zeros((counts.sum(), 3)),
            way=np.zeros((b, 4)),
            start=np.zeros(m + 1, dtype=np.int32),
            ints=np.zeros((self._ends[-1], N_INTS), dtype=np.int32),
            rows=np.zeros((self._ends[-1], N_NUMBERS)),
            work=np.zeros(b),
            turned=np.zeros((b, 3)),
            met=np.zeros((m, N_MET)),
        )
        self.forces: tuple[Floats, Floats] = np.zeros((self._ends[-1], 3)), np.zeros((self._ends[-1], 3))
        """on points, see `Touch.place`, as the committed step left them, and as the tentative one does [N]"""
        self.centre, self._dt = np.zeros((b, 3)), 1.0
        self._visits: Mask = np.asarray((pair >= own).any(axis=1))
        self._make_room(counts, pair)
        self._of_guests = slice(int(self.touch.first[own]), int(self.touch.first[b]))
        sides = pair.ravel()
        kept_by = np.where(sides < own, sides, np.where(pair[:, ::-1].ravel() < own, pair[:, ::-1].ravel(), 0))
        self._own = [np.flatnonzero(kept_by == number) for number in range(own)]
        """contacts whose forces a body's snapshot has: its own, and those of guests that it meets"""

    def find(self, members: Rows, asleep: Mask, now: int, dt: float) -> list[Group]:
        """What touches in a step of dt [s].

        asleep  of the pile's bodies, and of guests
        now     which of `forces` the step begins with
        """
        touch, b, own, self._dt = self.touch, len(asleep), self._n_own, dt
        if not len(touch.pair):
            return []
        touch.at[self._of_guests], touch.to[self._of_guests] = self._guests.came, self._guests.goes
        find_rows(members, own, touch, asleep, self.forces[now], self.forces[1 - now], dt)
        if own < b:
            self._guests.gather(touch, self.forces[now])
        order, start = np.zeros(b, dtype=np.int64), np.zeros(b + 1, dtype=np.int64)
        n = find_groups(touch, order, start)
        met = np.flatnonzero(np.diff(touch.start))
        groups = [order[start[group] : start[group + 1]] for group in range(n)]
        return [self._group(each, met[np.isin(touch.pair[met, 0], each)]) for each in groups]

    def _group(self, bodies: Numbers, met: Numbers) -> Group:
        own, visits = bodies < self._n_own, self._visits[met]
        return Group(bodies[own], bodies[~own] - self._n_own, met[~visits], met[visits])

    def _make_room(self, counts: Numbers, pair: Ints) -> None:
        """For patches: of each node of the side that they are around, with the nodes and points that may be near it."""
        ones = n_nodes = n_entries = 0
        for first, second in pair[self._visits].tolist():
            one, guest = (second, first) if first >= self._n_own else (first, second)
            ones += counts[one]
            n_nodes += counts[one] * min(counts[one], 32)
            n_entries += 16 * counts[one] + 3 * counts[guest]
        self._guests.make_room(len(pair), ones, n_nodes, n_entries)

    @property
    def met(self) -> list[Met]:
        """What the contacts did in the last step that had points near enough."""
        counts = np.diff(self.touch.start)
        places = np.flatnonzero(counts)
        figures = self.touch.met[places]
        figures[:, IMPULSE:] /= self._dt
        columns = counts[places].tolist(), *figures.T.tolist(), places.tolist()
        return [Met(*each) for each in zip(*columns, strict=True)]

    def size_of(self, number: int) -> int:
        """Of `of_body`."""
        return int(sum(3 * (self._ends[k + 1] - self._ends[k]) for k in self._own[number]))

    def of_body(self, number: int, now: int) -> Floats:
        """Forces on the points of a body, contact by contact, for its snapshot."""
        parts = [self.forces[now][self._ends[k] : self._ends[k + 1]].ravel() for k in self._own[number]]
        return np.concatenate([np.zeros(0), *parts])

    def load(self, number: int, now: int, forces: Floats) -> None:
        """Continue from `of_body`, or with no forces."""
        at = 0
        for k in self._own[number]:
            own = self.forces[now][self._ends[k] : self._ends[k + 1]]
            own[:] = forces[at : at + own.size].reshape(own.shape) if len(forces) else 0.0
            at += own.size


def _shares(one: Faces | SampledFaces, other: Faces | SampledFaces) -> tuple[float, float]:
    """How much of its area each presses with: both with half of it, but where a guest is, with which patches are made:
    there the one whose points are closer does, and of two guests the second."""
    if isinstance(one, Faces) and isinstance(other, Faces):
        return 0.5, 0.5
    if isinstance(one, SampledFaces) and isinstance(other, SampledFaces):
        return 0.0, 1.0
    if isinstance(other, SampledFaces):
        second, first = _shares(other, one)
        return first, second
    assert isinstance(one, SampledFaces)
    return (1.0, 0.0) if one.closeness <= other.spacing else (0.0, 1.0)


def _ends(counts: Iterable[int]) -> Ints:
    """First of each, and the end of the last."""
    return np.cumsum([0, *counts]).astype(np.int32)


def _faces(name: str, piece: Piece) -> Faces:
    """The surface of a body that an interface of this name meets. Raises SettingError."""
    found = faces_of(piece.body)
    if found is None:
        raise SettingError(f"{written_key(name)}: contact meets no surface that runs through cells yet: take blocks")
    if piece.apart or piece.parameters.arrays.tolerance > 0.0:
        raise SettingError(
            f"{written_key(name)}: bodies that touch are advanced by sweeps that are as many in all of them: leave out "
            "models.pbd.residual, method: leapfrog, and materials with a state of their own"
        )
    if len(piece.model.arrays.hanging.node):
        raise SettingError(f"{written_key(name)}: contact meets no cells of two sizes yet: leave out models.pbd.coarse")
    return found
