"""What bodies of a pile do to one another: who may meet, with what forces, and what a step did."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interfaces import Faces
from softseam_protocol.messages.pile import Met
from softseam_services.body.body import Floats, Ints
from softseam_services.body.contact_faces import faces_of
from softseam_services.body.errors import SettingError
from softseam_services.jit import Rows

from .kernels.asleep import AWAKE, FELL, LIES
from .kernels.between import N_INTS, N_MET, N_NUMBERS, PRESS, Touch, find_groups, find_rows
from .pile_pieces import Piece, Pieces

Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]

_NO_NODES = np.zeros(0, dtype=np.int32)
_NO_FACES = Faces(_NO_NODES, np.zeros((0, 3), dtype=np.int32), np.zeros(0), 0.0, 0.0)


@dataclass(frozen=True)
class Contact:
    """Between two bodies of a pile."""

    bodies: tuple[int, int]
    """their numbers"""
    friction: float
    """Coulomb's coefficient [1]"""


class Between:
    """The contacts of a pile, by the names of their interfaces. Raises SettingError for a body that cannot have any."""

    def __init__(self, contacts: Mapping[str, Contact], pieces: Pieces) -> None:
        b, m = len(pieces.each), len(contacts)
        pair = np.array([each.bodies for each in contacts.values()], dtype=np.int32).reshape(m, 2)
        faces = [_NO_FACES] * b
        for name, each in contacts.items():
            for number in each.bodies:
                faces[number] = _faces(name, pieces.each[number])
        counts = np.array([len(each.nodes) for each in faces])
        self._ends = np.cumsum([0, *counts[pair].ravel()])
        self.touch = Touch(
            first=_ends(len(each.nodes) for each in faces),
            node=np.concatenate([each.nodes for each in faces]).astype(np.int32),
            row=pieces.first_row,
            first_triangle=_ends(len(each.triangles) for each in faces),
            corners=np.concatenate([each.triangles for each in faces]).astype(np.int32),
            area=np.concatenate([each.area for each in faces]),
            yields=np.array([each.yields for each in faces]),
            spacing=np.array([each.spacing for each in faces]),
            pair=pair,
            friction=np.array([each.friction for each in contacts.values()], dtype=np.float64),
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
            asleep=np.zeros(b, dtype=np.int32),
            stands=np.zeros(m, dtype=np.bool_),
        )
        self.forces: tuple[Floats, Floats] = np.zeros((self._ends[-1], 3)), np.zeros((self._ends[-1], 3))
        """on points, see `Touch.place`, as the committed step left them, and as the tentative one does [N]"""
        self.centre = np.zeros((b, 3))
        self._own = [np.flatnonzero(pair.ravel() == number) for number in range(b)]

    def find(self, members: Rows, asleep: Mask, fell: Mask, now: int, dt: float) -> list[tuple[Numbers, Numbers]]:
        """What touches in a step of dt [s]: of each group of bodies their numbers, and those of contacts that they
        have with one another and with bodies that sleep.

        asleep  bodies that sleep through it (b,); fell: those of them that did not through the step before
        now     which of `forces` the step begins with
        """
        touch, b = self.touch, len(asleep)
        if not len(touch.pair):
            return []
        touch.asleep[:] = np.where(asleep, np.where(fell, FELL, LIES), AWAKE)
        find_rows(members, touch, self.forces[now], self.forces[1 - now], dt)
        order, start = np.zeros(b, dtype=np.int64), np.zeros(b + 1, dtype=np.int64)
        n = find_groups(touch, order, start)
        met = np.flatnonzero(np.diff(touch.start))
        groups = [order[start[group] : start[group + 1]] for group in range(n)]
        return [(bodies, met[np.isin(touch.pair[met], bodies).any(axis=1)]) for bodies in groups]

    @property
    def met(self) -> tuple[Ints, list[Met], Floats]:
        """What contacts did in the last step of which a body was awake: their numbers, figures, and the force of the
        second body on the first (v, 3) [N]."""
        touch = self.touch
        visited = np.flatnonzero(~touch.stands)
        counts, figures = np.diff(touch.start)[visited], touch.met[visited]
        numbers = zip(counts.tolist(), figures[:, :PRESS].tolist(), strict=True)
        return visited.astype(np.int32), [Met(count, *each) for count, each in numbers], figures[:, PRESS:]

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
        self.touch.stands[:] = False


def _ends(counts: Iterable[int]) -> Ints:
    """First of each, and the end of the last."""
    return np.cumsum([0, *counts]).astype(np.int32)


def _faces(name: str, piece: Piece) -> Faces:
    """The surface of a body that an interface of this name meets. Raises SettingError."""
    found = faces_of(piece.body)
    if found is None:
        raise SettingError(f"interfaces.{name}: contact meets no surface that runs through cells yet: take blocks")
    if piece.apart or piece.parameters.arrays.tolerance > 0.0:
        raise SettingError(
            f"interfaces.{name}: bodies that touch are advanced by sweeps that are as many in all of them: leave out "
            "models.pbd.residual, method: leapfrog, and materials with a state of their own"
        )
    if len(piece.model.arrays.hanging.node):
        raise SettingError(f"interfaces.{name}: contact meets no cells of two sizes yet: leave out models.pbd.coarse")
    return found
