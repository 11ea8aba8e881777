"""What bodies of a pile do to one another: who may meet, with what forces, and what a step did."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.nearest_face import N_OF_FACE
from softseam_protocol.messages.pile import Meetings
from softseam_services.body.body import Floats, Ints
from softseam_services.body.contact_faces import Faces
from softseam_services.body.sampled_faces import SampledFaces
from softseam_services.jit import Rows

from .guests import Guests
from .kernels.asleep import AWAKE, FELL, LIES
from .kernels.between import DEPTH, IMPULSE, LARGEST, WORK, new_books
from .kernels.eights import fill_eights, find_groups, lay_rows, new_eights, new_groups
from .kernels.pairs import EIGHT
from .kernels.search import find_rows
from .kernels.touch import LISTED, LISTED_OF_MESHES, N_INTS, N_NUMBERS, Touch
from .pile_pieces import Pieces
from .surfaces import NO_FACES, Contact, Surfaces, uponed

Mask = NDArray[np.bool_]


class Between:
    """The contacts of a pile, by the names of their interfaces. Raises SettingError for a body that cannot have any."""

    def __init__(self, contacts: Mapping[str, Contact], pieces: Pieces, guests: Guests) -> None:
        own, m = len(pieces.each), len(contacts)
        surfaces = Surfaces(contacts, pieces.each, guests.faces)
        b, all_ = surfaces.n_bodies, surfaces.all
        pair = np.array([each.bodies for each in contacts.values()], dtype=np.int32).reshape(m, 2)
        sides = np.array([each.sides for each in surfaces.meets], dtype=np.int32).reshape(m, 2)
        presses = np.array([each.presses for each in surfaces.meets]).reshape(m, 2)
        around = np.array([each.around for each in surfaces.meets], dtype=np.int32)
        self._guests, self._n_own = guests, own
        counts = np.array([len(each.area) for each in all_])
        p, s, triangles = int(counts.sum()), len(all_), _ends(len(each.triangles) for each in all_)
        forces = np.array([surfaces.n_forces(surface) for surface in range(s)])[sides]
        patched = around[:, None] == [0, 1]
        held = np.where((around[:, None] < 0) | patched, forces + patched, 0)  # what it has taken comes after forces
        pressing = np.where(presses > 0.0, counts[sides], 0)
        self._ends, places = np.cumsum([0, *held.ravel()]), np.cumsum([0, *pressing.ravel()])
        f, most = int(places[-1]), int(counts.max(initial=0))
        follow, follows, by = _followed(surfaces)
        upon = [uponed(each) for each in all_]
        lattices = [surfaces.lattice(surface) for surface in range(s)]
        mesh = any(surfaces.followed(surface) for surface in range(s))
        self.touch = Touch(
            body=np.array(surfaces.body, dtype=np.int32),
            first=_ends(counts),
            node=np.concatenate(
                [each.nodes if isinstance(each, Faces) else np.zeros(len(each.area)) for each in all_]
            ).astype(np.int32),
            row=pieces.first_row,
            number=_numbers(surfaces, pieces),
            follow=follow,
            follows=follows,
            by=by,
            first_triangle=triangles,
            corners=np.concatenate([each.triangles for each in all_]).astype(np.int32),
            rounded=np.concatenate([_rounded(each) for each in all_]),
            upon=np.concatenate([each[0] for each in upon]),
            upon_share=np.concatenate([each[1] for each in upon]),
            curved=np.array([not isinstance(each, Faces) and len(each.among.T) == 8 for each in all_]),
            area=np.concatenate([each.area for each in all_]),
            inverse_mass=np.concatenate([_inverse_mass(surfaces, pieces, surface) for surface in range(s)]),
            yields=np.array([each.yields for each in all_]),
            octant=np.concatenate([each.octant for each in lattices]),
            rise=np.concatenate([each.rise for each in lattices]),
            spread=np.concatenate([each.spread for each in lattices]),
            mean=np.concatenate([each.mean for each in lattices]),
            light=np.array([surfaces.light(surface) for surface in range(s)]),
            spacing=np.array([each.spacing for each in all_]),
            pair=pair,
            sides=sides,
            friction=np.array([each.friction for each in contacts.values()], dtype=np.float64),
            visits=around >= 0,
            around=around,
            presses=presses,
            place=places[:-1].reshape(m, 2).astype(np.int32),
            held=np.stack([self._ends[:-1], self._ends[1:]], axis=1).reshape(m, 2, 2).astype(np.int32),
            guest_at=np.zeros_like(guests.came),
            guest_to=np.zeros_like(guests.came),
            at=np.zeros((p, 3)),
            to=np.zeros((p, 3)),
            out=np.zeros((p, 3)),
            faces=np.zeros((triangles[-1], N_OF_FACE)),
            fresh=np.zeros(s, dtype=np.bool_),
            box=np.zeros((s, 6)),
            halo=np.zeros((s, 6)),
            way=np.zeros((s, 4)),
            middle=np.zeros((s, 4)),
            since=np.full((m, 4), np.nan),
            n_close=np.zeros((m, 2), dtype=np.int32),
            close=np.zeros(f, dtype=np.int32),
            counts=np.zeros(f, dtype=np.int32),
            listed=np.zeros((f, LISTED_OF_MESHES if mesh else LISTED), dtype=np.int32),
            last=np.zeros(f, dtype=np.int32),
            share=np.zeros((most, 3)),
            beside=np.zeros(most),
            moved=np.zeros((most, 3)),
            start=np.zeros(m + 1, dtype=np.int32),
            ints=np.zeros((f, N_INTS), dtype=np.int32),
            rows=np.zeros((f, N_NUMBERS)),
            forces=np.zeros((2, self._ends[-1], 3)),
            carries=np.zeros((2, m), dtype=np.bool_),
            asleep=np.zeros(b, dtype=np.int32),
            stands=np.zeros(m, dtype=np.bool_),
        )
        self._by_patches = bool((around >= 0).any())
        squares = set(sides[around == 0, 0].tolist()) | set(sides[around == 1, 1].tolist())
        met = [each if k in squares and isinstance(each, Faces) else NO_FACES for k, each in enumerate(all_[:own])]
        guests.make_ready(m, pieces.n_rows, met)
        self._dt = 1.0
        bodies = pair.ravel()
        kept_by = np.where(bodies < own, bodies, np.where(pair[:, ::-1].ravel() < own, pair[:, ::-1].ravel(), 0))
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
        touch.guest_at[:], touch.guest_to[:] = guests.came, guests.ahead
        n_rows, others = find_rows(members, self._n_own, touch, now, dt)
        if others:
            self.n_groups, self._n_eights = find_groups(touch, self.groups), -1
            while self._n_eights < 0:
                self._n_eights = lay_rows(touch, self.groups, self.n_groups, self.eights, len(self._xw) - EIGHT)
                if self._n_eights < 0:
                    self.eights = new_eights(2 * len(self.eights.laid), len(self._xw))
        if n_rows:
            fill_eights(touch, self.eights, self._n_eights)
        if self._by_patches:
            guests.gather(touch, self._xw, touch.forces[now])

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
        own = self._own[number]
        return 3 * int((self._ends[own + 1] - self._ends[own]).sum())

    def of_body(self, number: int, now: int) -> Floats:
        """Forces on the points of a body, contact by contact, for its snapshot."""
        forces, own, ends = self.touch.forces[now], self._own[number], self._ends
        begins = np.cumsum([0, *(ends[own + 1] - ends[own])])
        found = np.zeros((begins[-1], 3))
        for place in np.flatnonzero(self.touch.carries[now, own // 2]).tolist():  # others carry none
            found[begins[place] : begins[place + 1]] = forces[ends[own[place]] : ends[own[place] + 1]]
        return found.ravel()

    def load(self, number: int, now: int, forces: Floats) -> None:
        """Continue from `of_body`, or with no forces."""
        at = 0
        for k in self._own[number]:
            own = self.touch.forces[now, self._ends[k] : self._ends[k + 1]]
            own[:] = forces[at : at + own.size].reshape(own.shape) if len(forces) else 0.0
            at += own.size
            self.touch.carries[now, k // 2] = True
        self.touch.stands[:] = False


def _ends(counts: Iterable[int]) -> Ints:
    """First of each, and the end of the last."""
    return np.cumsum([0, *counts]).astype(np.int32)


def _rounded(faces: Faces | SampledFaces) -> Mask:
    """See `Touch.rounded`."""
    return np.zeros(faces.triangles.shape, dtype=np.bool_) if isinstance(faces, Faces) else faces.rounded


def _followed(surfaces: Surfaces) -> tuple[Ints, Ints, Floats]:
    """See `Touch.follow`, `follows`, `by`."""
    counts, nodes, weights = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for surface in range(len(surfaces.all)):
        faces = surfaces.followed(surface)
        if faces is not None:
            counts.append(np.diff(faces.weights.indptr))
            nodes.append(faces.nodes[faces.weights.indices])
            weights.append(faces.weights.data)
    return _ends(np.concatenate(counts)), np.concatenate(nodes).astype(np.int32), np.concatenate(weights)


def _numbers(surfaces: Surfaces, pieces: Pieces) -> Ints:
    """See `Touch.number`."""
    number = np.full(pieces.n_rows, -1, dtype=np.int32)
    for surface, body in reversed(list(enumerate(surfaces.body))):  # of nodes last: patches are around these
        faces = surfaces.followed(surface)
        if faces is not None or surfaces.of_nodes(surface):
            nodes = surfaces.all[surface].nodes
            number[pieces.first_row[body] + nodes] = np.arange(len(nodes))
    return number


def _inverse_mass(surfaces: Surfaces, pieces: Pieces, surface: int) -> Floats:
    """See `Touch.inverse_mass`."""
    if not surfaces.of_nodes(surface):
        return np.zeros(len(surfaces.all[surface].area))
    return np.asarray(pieces.each[surface].parameters.arrays.inverse_mass[surfaces.all[surface].nodes])
