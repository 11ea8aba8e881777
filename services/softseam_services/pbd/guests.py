"""Bodies of other models that touch a pile, as its contacts meet them; see `kernels.guests` and `kernels.patches`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_protocol.messages.pile import Guest, Push
from softseam_services.body.body import Floats, Ints
from softseam_services.body.contact_faces import Faces
from softseam_services.body.sampled_faces import SampledFaces

from .kernels.gather import BODY, GUEST, GUEST_SLOT, N_INTS, N_NUMBERS, PLACE, SLOT, Patches, gather_patches
from .kernels.guests import Guests as Arrays
from .kernels.touch import Touch

Mask = NDArray[np.bool_]

_ALIKE = 0.001
"""by which weights of patches may differ from those with which a guest's answer was found [1]"""
_NONE = np.zeros((0, 0))
_AROUND = 8
"""patches into which a point is gathered at most"""


class Guests:
    """Those of one pile, in its order; n_own: bodies of the pile."""

    def __init__(self, faces: Sequence[SampledFaces], n_own: int) -> None:
        self.faces, self._n_own = faces, n_own
        g, first = len(faces), np.cumsum([0, *(len(each.area) for each in faces)])
        self._own = [slice(int(a), int(b)) for a, b in pairwise(first)]
        q = int(first[-1])
        self.came, self.goes, self.ahead = np.zeros((3, q, 3))
        """points as the step begins, as it ends under the forces that were thought to act, and where they are looked
        for then (q, 3) [m]"""
        self._among = np.concatenate(
            [np.zeros((0, _AROUND), np.int32), *(np.pad(each.among, _beside(each)) for each in faces)]
        )
        self._part = np.concatenate([np.zeros((0, _AROUND)), *(np.pad(each.part, _beside(each)) for each in faces)])
        self._root = [_no_root(each) for each in faces]
        self._held = [np.zeros((len(each.nodes), 3)) for each in faces]
        self._away = np.zeros(g, dtype=np.bool_)  # those that sleep
        self._weights = [csr_array((0, len(each.nodes))) for each in faces]  # of nodes in patches
        self._sampled = [csr_array((0, len(each.area))) for each in faces]  # and of points
        self._answered: list[csr_array | None] = [None] * g  # weights with which answers were found
        self._answers = [_NONE] * g

    def make_ready(self, n_meetings: int, n_nodes: int, met: Sequence[Faces]) -> None:
        """For patches of so many meetings, and nodes of the pile; met: faces of the pile's bodies, empty of those that
        no points press on."""
        across = [_across(faces) for faces in met]
        ends = np.cumsum([0, *(each.size for each in across)])
        self.patches = _new_patches(
            1,
            n_nodes,
            self._n_own + len(self.faces),
            np.zeros(n_meetings + 1, dtype=np.int32),
            np.zeros(len(self.faces), dtype=np.int32),
            np.concatenate([np.zeros(0, np.int32), *(each.ravel() for each in across)]),
            np.where(np.diff(ends) > 0, ends[:-1], -1),
        )
        """of a step, as kernels take them"""
        self._show(np.zeros((0, 3)))

    def problem_of(self, said: Sequence[Guest]) -> str:
        """What is wrong with what a request says of them; '' where nothing is."""
        if len(said) != len(self.faces):
            return f"the pile was configured with {len(self.faces)} guests: the step is of {len(said)}"
        for place, (one, faces) in enumerate(zip(said, self.faces, strict=True)):
            n, root, awake = len(faces.nodes), one.root, len(one.x_next) > 0
            said_of = (one.x, one.x_next, one.force) if awake else (one.x,)
            if any(each.shape != (n, 3) for each in (*said_of, *((one.x_ahead,) if len(one.x_ahead) else ()))):
                return f"nodes of guest {place} need the shape ({n}, 3)"
            if root.size and len(root) != 3 * n:
                return f"the root of guest {place} has {len(root)} rows in place of {3 * n}"
            if awake and not root.size and not self._root[place].size:
                return f"guest {place} comes without a root, and none came since the last snapshot: send it again"
            if not all(np.isfinite(each).all() for each in (one.x, one.x_next, one.force, root, one.x_ahead)):
                return f"what is said of guest {place} is not finite"
        return ""

    def take(self, said: Sequence[Guest]) -> Mask:
        """A step begins, of which this is said; which of them sleep (g,)."""
        self._away = np.array([not len(one.x_next) for one in said], dtype=np.bool_)
        for place, (one, faces) in enumerate(zip(said, self.faces, strict=True)):
            away, own = self._away[place], self._own[place]
            if one.root.size:
                self._root[place], self._answered[place] = one.root, None
            self._held[place] = one.force
            self.came[own], self.goes[own] = faces.places(one.x), faces.places(one.x if away else one.x_next)
            self.ahead[own] = faces.places(one.x_ahead) if len(one.x_ahead) and not away else self.goes[own]
        return self._away

    def gather(self, touch: Touch, xw: Floats, held: Floats) -> None:
        """Rows were found: make their patches, which begin with forces of these (k, 3) [N], and find how they move one
        another. xw: of the pile, see `Pieces`."""
        while (n := gather_patches(touch, self.patches, xw, self._n_own, self._among, self._part)) < 0:
            p, n_nodes = self.patches, len(xw)
            self.patches = _new_patches(
                2 * len(p.ints), n_nodes, len(p.moved), p.start, p.n_slots, p.across, p.first_across
            )
        patches = self.patches
        slot, share = patches.slot[:n], patches.share[:n]
        for place, faces in enumerate(self.faces):
            own = slot[:, 0] == place
            shape = int(patches.n_slots[place]), len(faces.area)
            weights = csr_array((share[own], (slot[own, 1], slot[own, 2])), shape=shape)
            self._weights[place] = weights @ faces.weights
            self._sampled[place] = weights
            if self._away[place]:  # it does not give
                self._answered[place], self._answers[place] = None, np.zeros((3 * shape[0],) * 2)
                continue
            known = self._answered[place]
            alike = known is not None and known.shape == shape
            if alike and (not shape[0] or abs(known - weights).max() <= _ALIKE):
                continue
            root = self._root[place]
            rows = np.asarray(self._weights[place] @ root.reshape(-1, 3 * root.shape[1]))
            rows = rows.reshape(3 * shape[0], root.shape[1])
            self._answered[place], self._answers[place] = weights, rows @ rows.T
        self._show(held)

    def _show(self, held: Floats) -> None:
        """What patches there are to kernels."""
        g, counts = len(self.faces), [each.shape[0] for each in self._weights]
        first, none = np.cumsum([0, *counts]).astype(np.int32), np.zeros((0, 3))
        ints = self.patches.ints[: self.patches.start[-1]]
        force, begun = held[ints[:, PLACE]], np.zeros((first[-1], 3))
        guest = ints[:, GUEST] >= 0
        begun[first[ints[guest, GUEST]] + ints[guest, GUEST_SLOT]] -= force[guest]
        both = ints[:, SLOT] >= 0
        begun[first[ints[both, BODY] - self._n_own] + ints[both, SLOT]] += force[both]
        came, goes = [none], [none]
        for place, (weights, own) in enumerate(zip(self._weights, self._own, strict=True)):
            root, sampled = self._root[place], self._sampled[place]
            came.append(sampled @ self.came[own])
            if self._away[place]:
                goes.append(came[-1])
                continue
            more = np.asarray(weights.T @ begun[first[place] : first[place + 1]]) - self._held[place]
            moved = (root @ (root.T @ more.ravel())).reshape(-1, 3)
            goes.append(sampled @ self.goes[own] + weights @ moved)
        starts = np.concatenate(came)
        self.arrays = Arrays(
            n_own=np.array([self._n_own], dtype=np.int32),
            first_slot=first,
            came=starts,
            goes=np.concatenate(goes),
            begun=begun,
            answers=np.concatenate([np.zeros(0), *(each.ravel() for each in self._answers)]),
            begin=np.cumsum([0, *(each.size for each in self._answers)]).astype(np.int64),
            at=starts.copy(),  # where those stay that sleep
            now=np.zeros_like(begun),
            felt=np.zeros_like(begun),
            moment=np.zeros((g, 3)),
            lost=np.zeros(g, dtype=np.int32),
        )
        """as kernels take them"""

    def felt(self) -> list[Push]:
        """What acted on them in the last step; what was thought to, where the pile's step was lost."""
        arrays, found = self.arrays, list[Push]()
        for place, weights in enumerate(self._weights):
            own = slice(*arrays.first_slot[place : place + 2])
            force = np.asarray(weights.T @ arrays.felt[own])
            lost = bool(arrays.lost[place])
            nodes = np.unique(weights.indices[weights.data != 0.0]).astype(np.int32)
            moment = np.zeros(0) if lost else arrays.moment[place].copy()
            found.append(Push(self._held[place] if lost else force, moment, nodes))
        return found

    def forget(self) -> None:
        """What was sent of how they answer is sent again."""
        self._root = [_no_root(each) for each in self.faces]
        self._answered = [None] * len(self._answered)


def _new_patches(
    patches: int, n_nodes: int, n_bodies: int, start: Ints, n_slots: Ints, across: Ints, first_across: NDArray[np.int64]
) -> Patches:
    """Room for so many, and for the nodes and points that these may have; of a pile of so many nodes, and bodies with
    guests."""
    nodes, points = 64 * patches, 128 * patches
    return Patches(
        start=start,
        ints=np.zeros((patches, N_INTS), dtype=np.int32),
        rows=np.zeros((patches, N_NUMBERS)),
        began=np.zeros((patches, 2, 3)),
        known=np.zeros(patches, dtype=np.bool_),
        clear=np.zeros(patches),
        moved=np.zeros(n_bodies),
        since=np.zeros((n_nodes, 3)),
        begun=np.zeros((n_nodes, 3)),
        node=np.zeros(nodes, dtype=np.int32),
        weight=np.zeros(nodes),
        bend=np.zeros((points, 3)),
        taken=np.zeros(len(start) - 1),
        slot=np.zeros((points, 3), dtype=np.int32),
        share=np.zeros(points),
        n_slots=n_slots,
        across=across,
        first_across=first_across,
    )


def _beside(faces: SampledFaces) -> tuple[tuple[int, int], tuple[int, int]]:
    """What its arrays of patches lack to be as wide as of all."""
    return (0, 0), (0, _AROUND - faces.among.shape[1])


def _no_root(faces: SampledFaces) -> Floats:
    """Of a guest that has not said how it answers."""
    return np.zeros((3 * len(faces.nodes), 0))


def _across(faces: Faces) -> NDArray[np.int32]:
    """See `Patches.across`: of one body (p, p)."""
    found = np.full((len(faces.area), len(faces.area)), -1, dtype=np.int32)
    third = found.copy()  # of the triangle in which two points follow one another
    x = faces.places
    for k in range(3):
        third[faces.triangles[:, k], faces.triangles[:, (k + 1) % 3]] = faces.triangles[:, (k + 2) % 3]
    for k in range(3):
        i, j, away = (faces.triangles[:, (k + m) % 3] for m in range(3))
        length = [np.linalg.norm(x[a] - x[b], axis=1) for a, b in ((i, j), (j, away), (away, i))]
        longest = (length[0] > length[1] * (1.0 + 1e-6)) & (length[0] > length[2] * (1.0 + 1e-6))
        found[i[longest], j[longest]] = third[j[longest], i[longest]]
    return found
