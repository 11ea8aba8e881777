"""What bodies of a pile do to one another: who may meet, with what forces, and what a step did."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interfaces import Faces
from softseam_coupling.kernels.nearest_face import N_OF_FACE
from softseam_protocol.messages.pile import Meetings
from softseam_protocol.scene.interfaces import written_key
from softseam_services.body.body import Floats, Ints
from softseam_services.body.contact_faces import faces_of
from softseam_services.body.errors import SettingError
from softseam_services.body.sampled_faces import SampledFaces
from softseam_services.jit import Rows

from .guests import Guests
from .kernels.asleep import AWAKE, FELL, LIES
from .kernels.between import DEPTH, IMPULSE, LARGEST, WORK, new_books
from .kernels.eights import fill_eights, find_groups, lay_rows, new_eights, new_groups
from .kernels.pairs import EIGHT
from .kernels.search import find_rows
from .kernels.touch import LISTED, N_INTS, N_NUMBERS, Touch
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
        p, f, triangles = int(counts.sum()), int(self._ends[-1]), _ends(len(each.triangles) for each in faces)
        most = int(counts.max(initial=0))
        self.touch = Touch(
            first=_ends(counts),
            node=np.concatenate(nodes).astype(np.int32),
            row=rows,
            number=number,
            first_triangle=triangles,
            corners=np.concatenate([each.triangles for each in faces]).astype(np.int32),
            area=np.concatenate([each.area for each in faces]),
            inverse_mass=np.concatenate([*masses, np.zeros(sum(counts[own:]))]),
            yields=np.array([each.yields for each in faces]),
            spacing=np.array([each.spacing for each in faces]),
            pair=pair,
            friction=np.array([each.friction for each in contacts.values()], dtype=np.float64),
            visits=np.asarray((pair >= own).any(axis=1)),
            presses=np.array([_shares(faces[one], faces[other]) for one, other in pair.tolist()]).reshape(m, 2),
            place=self._ends[:-1].reshape(m, 2).astype(np.int32),
            guest_at=np.zeros_like(guests.came),
            guest_to=np.zeros_like(guests.came),
            at=np.zeros((p, 3)),
            to=np.zeros((p, 3)),
            out=np.zeros((p, 3)),
            faces=np.zeros((triangles[-1], N_OF_FACE)),
            fresh=np.zeros(b, dtype=np.bool_),
            box=np.zeros((b, 6)),
            halo=np.zeros((b, 6)),
            way=np.zeros((b, 4)),
            middle=np.zeros((b, 4)),
            since=np.full((m, 4), np.nan),
            n_close=np.zeros((m, 2), dtype=np.int32),
            close=np.zeros(f, dtype=np.int32),
            counts=np.zeros(f, dtype=np.int32),
            listed=np.zeros((f, LISTED), dtype=np.int32),
            last=np.zeros(f, dtype=np.int32),
            share=np.zeros((most, 3)),
            beside=np.zeros(most),
            moved=np.zeros((most, 3)),
            start=np.zeros(m + 1, dtype=np.int32),
            ints=np.zeros((f, N_INTS), dtype=np.int32),
            rows=np.zeros((f, N_NUMBERS)),
            forces=np.zeros((2, f, 3)),
            carries=np.zeros((2, m), dtype=np.bool_),
            asleep=np.zeros(b, dtype=np.int32),
            stands=np.zeros(m, dtype=np.bool_),
        )
        self._visits: Mask = self.touch.visits
        self._make_room(counts, pair, [each for each in faces if isinstance(each, Faces)])
        self._dt = 1.0
        sides = pair.ravel()
        kept_by = np.where(sides < own, sides, np.where(pair[:, ::-1].ravel() < own, pair[:, ::-1].ravel(), 0))
        self._own = [np.flatnonzero(kept_by == number) for number in range(own)]
        """contacts whose forces a body's snapshot has: its own, and those of guests that it meets"""
        self.groups, self.books = new_groups(b, m), new_books(b, m)
        self.n_groups = 0
        self._xw = pieces.xw
        self.eights = new_eights(EIGHT, len(self._xw))
        self.any = m > 0

    def find(self, members: Rows, asleep: Mask, fell: Mask, now: int, dt: float) -> None:
        """What touches in a step of dt [s]: of the first `n_groups` of `groups` the rows in `eights`.

        asleep  bodies that sleep through it, and guests; fell: bodies of them that did not through the step before
        now     which of the forces between bodies the step begins with
        """
        touch, guests, self._dt = self.touch, self._guests, dt
        touch.asleep[:] = np.where(asleep, LIES, AWAKE)
        touch.asleep[: self._n_own][fell] = FELL
        touch.asleep[self._n_own :][asleep[self._n_own :]] = FELL  # guests are said to be where they are in each step
        touch.guest_at[:], touch.guest_to[:] = guests.came, guests.goes
        n_rows, others = find_rows(members, self._n_own, touch, now, dt)
        if others:
            self.n_groups, self._n_eights = find_groups(touch, self.groups), -1
            while self._n_eights < 0:
                self._n_eights = lay_rows(touch, self.groups, self.n_groups, self.eights, len(self._xw) - EIGHT)
                if self._n_eights < 0:
                    self.eights = new_eights(2 * len(self.eights.laid), len(self._xw))
        if n_rows:
            fill_eights(touch, self.eights, self._n_eights)
        if len(guests.faces):
            guests.gather(touch, touch.forces[now])

    def _make_room(self, counts: Numbers, pair: Ints, faces: list[Faces]) -> None:
        """For patches: of each node of the side that they are around, with the nodes and points that may be near it."""
        ones = n_nodes = n_entries = 0
        meets = set(pair[self._visits].ravel().tolist())
        for first, second in pair[self._visits].tolist():
            one, guest = (second, first) if first >= self._n_own else (first, second)
            ones += counts[one]
            n_nodes += counts[one] * min(counts[one], 32)
            n_entries += 16 * counts[one] + 4 * counts[guest]
        met = [each if number in meets else _NO_FACES for number, each in enumerate(faces)]
        self._guests.make_room(len(pair), ones, n_nodes, n_entries, met)

    @property
    def met(self) -> Meetings:
        """What the contacts did in the last step that had points near enough."""
        counts = np.diff(self.touch.start)
        places = np.flatnonzero(counts).astype(np.int32)
        met = self.books.met[places]
        force = met[:, IMPULSE:] / self._dt
        return Meetings(
            places, counts[places], met[:, DEPTH].copy(), met[:, LARGEST].copy(), met[:, WORK].copy(), force
        )

    def size_of(self, number: int) -> int:
        """Of `of_body`."""
        return int(sum(3 * (self._ends[k + 1] - self._ends[k]) for k in self._own[number]))

    def of_body(self, number: int, now: int) -> Floats:
        """Forces on the points of a body, contact by contact, for its snapshot."""
        forces = self.touch.forces[now]
        parts = [forces[self._ends[k] : self._ends[k + 1]].ravel() for k in self._own[number]]
        return np.concatenate([np.zeros(0), *parts])

    def load(self, number: int, now: int, forces: Floats) -> None:
        """Continue from `of_body`, or with no forces."""
        at = 0
        for k in self._own[number]:
            own = self.touch.forces[now, self._ends[k] : self._ends[k + 1]]
            own[:] = forces[at : at + own.size].reshape(own.shape) if len(forces) else 0.0
            at += own.size
            self.touch.carries[now, k // 2] = True
        self.touch.stands[:] = False


def _shares(one: Faces | SampledFaces, other: Faces | SampledFaces) -> tuple[float, float]:
    """How much of its area each presses with: both with half of it, but a guest, with which patches are made, with all,
    and of two guests the second."""
    if isinstance(one, Faces) and isinstance(other, Faces):
        return 0.5, 0.5
    return (0.0, 1.0) if isinstance(other, SampledFaces) else (1.0, 0.0)


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
