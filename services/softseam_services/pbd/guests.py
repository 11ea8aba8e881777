"""Bodies of other models that touch a pile, as its contacts meet them; see `kernels.guests`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.pile import Guest, Push
from softseam_services.body.body import Ints
from softseam_services.body.sampled_faces import SampledFaces

from .kernels.between import Touch
from .kernels.guests import Guests as Arrays
from .kernels.guests import list_points

Mask = NDArray[np.bool_]


class Guests:
    """Those of one pile, in its order, the first after so many rows of nodes."""

    def __init__(self, faces: Sequence[SampledFaces], first_row: int) -> None:
        self.faces = faces
        g, first = len(faces), np.cumsum([0, *(len(each.area) for each in faces)])
        q = int(first[-1])
        self.arrays = Arrays(
            first=first.astype(np.int32),
            row=np.array([first_row], dtype=np.int32),
            came=np.zeros((q, 3)),
            goes=np.zeros((q, 3)),
            answers=np.zeros(0),
            begin=np.zeros(g + 1, dtype=np.int64),
            listed=np.zeros(q, dtype=np.int32),
            n_listed=np.zeros(g, dtype=np.int32),
            slot=np.full(q, -1, dtype=np.int32),
            now=np.zeros((q, 3)),
            felt=np.zeros((q, 3)),
            moment=np.zeros((g, 3)),
            lost=np.zeros(g, dtype=np.int32),
        )
        """as kernels take them"""
        self.goes = np.zeros((q, 3))
        """where points are as the step ends, under the forces that were thought to act (q, 3) [m]"""
        self._own = [slice(int(a), int(b)) for a, b in pairwise(first)]
        self._root = [np.zeros((0, 0))] * g
        self._held = [np.zeros((0, 3))] * g
        self._listed: list[Ints | None] = [None] * g
        self._answers = [np.zeros((0, 0))] * g

    @property
    def rows(self) -> list[int]:
        """First row of each in the pile's nodes."""
        return [int(self.arrays.row[0] + first) for first in self.arrays.first[:-1]]

    def problem_of(self, said: Sequence[Guest]) -> str:
        """What is wrong with what a request says of them; '' where nothing is."""
        if len(said) != len(self.faces):
            return f"the pile was configured with {len(self.faces)} guests: the step is of {len(said)}"
        for place, (one, faces) in enumerate(zip(said, self.faces, strict=True)):
            if not len(one.x):
                continue
            n, root = len(faces.nodes), one.root
            if any(each.shape != (n, 3) for each in (one.x, one.x_next, one.force)):
                return f"nodes of guest {place} need the shape ({n}, 3)"
            if root.size and len(root) != 3 * n:
                return f"the root of guest {place} has {len(root)} rows in place of {3 * n}"
            if not root.size and not self._root[place].size:
                return f"guest {place} comes without a root, and none came since the last snapshot: send it again"
            if not all(np.isfinite(each).all() for each in (one.x, one.x_next, one.force, root)):
                return f"what is said of guest {place} is not finite"
        return ""

    def take(self, said: Sequence[Guest]) -> Mask:
        """A step begins, of which this is said; which of them sleep (g,)."""
        arrays = self.arrays
        arrays.felt[:] = arrays.moment[:] = 0.0
        arrays.lost[:] = 0
        for place, (one, faces) in enumerate(zip(said, self.faces, strict=True)):
            if not len(one.x):
                continue
            if one.root.size:
                self._root[place], self._listed[place] = one.root, None
            own, root = self._own[place], self._root[place]
            back = (root @ (root.T @ one.force.ravel())).reshape(-1, 3)
            arrays.came[own], self.goes[own] = faces.places(one.x), faces.places(one.x_next)
            arrays.goes[own] = self.goes[own] - faces.weights @ back
            self._held[place] = one.force
        return np.array([not len(one.x) for one in said], dtype=np.bool_)

    def answer(self, touch: Touch, n_own: int) -> None:
        """Rows were found: how the points that they name move one another, A = W R (W R)^T."""
        arrays, changed = self.arrays, False
        list_points(arrays, touch, n_own)
        for place, faces in enumerate(self.faces):
            first = arrays.first[place]
            listed = arrays.listed[first : first + arrays.n_listed[place]]
            known = self._listed[place]
            if known is not None and np.array_equal(known, listed):
                continue
            root, n = self._root[place], len(faces.nodes)
            width = root.shape[1]
            rows = np.asarray(faces.weights[listed] @ root.reshape(n, 3 * width)).reshape(3 * len(listed), width)
            self._answers[place], self._listed[place], changed = rows @ rows.T, listed.copy(), True
        if changed:
            begin = np.cumsum([0, *(each.size for each in self._answers)])
            self.arrays = arrays._replace(answers=np.concatenate([each.ravel() for each in self._answers]), begin=begin)

    def felt(self) -> list[Push]:
        """What acted on them in the last step; what was thought to, where the pile's step was lost."""
        arrays, found = self.arrays, []
        for place, faces in enumerate(self.faces):
            own = self._own[place]
            force, moment = np.asarray(faces.weights.T @ arrays.felt[own]), arrays.moment[place].copy()
            found.append(Push(self._held[place], np.zeros(0)) if arrays.lost[place] else Push(force, moment))
        return found

    def forget(self) -> None:
        """What was sent of how they answer is sent again."""
        self._root = [np.zeros((0, 0))] * len(self._root)
        self._listed = [None] * len(self._listed)
