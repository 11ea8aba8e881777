"""What a step did to the bodies of a simulation; of those in a pile, made when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.loop import Outcome
from softseam_services.orchestrator.pile_bodies import PileBodies

Floats = NDArray[np.float64]


class Solutions(dict[str, Outcome]):
    """By body.

    known  of those that are in no pile, or sleep
    piles  that hold the others
    """

    def __init__(self, known: Mapping[str, Outcome], piles: Sequence[PileBodies] = ()) -> None:
        super().__init__(known)
        self._piles = piles

    def __missing__(self, name: str) -> Outcome:
        for each in self._piles:
            if each.pile.holds(name):
                return each.outcome(name)
        raise KeyError(name)

    def bounds(self, name: str) -> Floats:
        """Of a body, lower and upper (2, 3) [m]."""
        for each in self._piles:
            if each.pile.holds(name):
                place = each.pile.place(name)
                return np.array([each.step.low[place], each.step.high[place]])
        boxes = np.array([reply.bounds for reply in self[name].replies.values()])
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
