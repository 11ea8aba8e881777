"""Bodies that have come to be where others are: because nothing keeps them apart, or through their contact.

Boxes around bodies are enough for that: of two solid ones that are apart neither has its middle in the other's box, but
for a small one in the corner of a large one's box. Of those that touch, which may be pressed out of shape, both have;
of meshes that touch nothing is said, for they lie against one another as boxes cannot.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]


class Overlaps:
    """Watches the b bodies of a scene; reports once of every two that come to overlap, those of a look in one event.

    say  receives kind and text of every event
    """

    def __init__(self, scene: Scene, say: Callable[[str, str], None]) -> None:
        self._names, self._say = tuple(scene.bodies), say
        place, b = {name: number for number, name in enumerate(self._names)}, len(self._names)
        self._free = np.triu(np.full((b, b), scene.contacts != "none"), 1)
        self._touch = np.zeros((b, b), dtype=np.bool_)
        for each in scene.interfaces.values():
            one, other = sorted(place[name] for name in each.between)
            blocks = all(block_of(scene.bodies[name]) is not None for name in each.between)
            self._free[one, other], self._touch[one, other] = False, each.kind == "contact" and blocks
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._left = self._free | self._touch
        self._seen: Floats = np.full((len(self._names), 2, 3), np.nan)

    @property
    def possible(self) -> bool:
        """Whether any two may still come to overlap unsaid."""
        return bool(self._left.any())

    def look(self, step: int, bounds: Floats) -> None:
        """A step was taken, after which bodies have these bounds, lower and upper (b, 2, 3) [m]. Of two that did not
        move since the last look there is nothing new."""
        middle, own = bounds.mean(axis=1), np.flatnonzero((bounds != self._seen).any(axis=(1, 2)))
        self._seen = bounds
        inside = np.zeros((len(bounds), len(bounds)), dtype=np.bool_)
        inside[own] = _inside(middle[own], bounds)
        inside[:, own] = _inside(middle, bounds[own])
        for which, found, why in (
            (self._free, inside | inside.T, _FREE),
            (self._touch, inside & inside.T, _THROUGH),
        ):
            pairs = np.argwhere(self._left & which & found)
            if not len(pairs):
                continue
            self._left[pairs[:, 0], pairs[:, 1]] = False
            one, other = (self._names[number] for number in pairs[0].tolist())
            first = f", the first of {len(pairs)} pairs," if len(pairs) > 1 else ""
            self._say("overlap", f"step {step}: {one} and {other}{first} are where the other is: {why}")


def _inside(places: Floats, bounds: Floats) -> NDArray[np.bool_]:
    """Which of some places (m, 3) are within which bounds (k, 2, 3) [m] (m, k)."""
    found = np.ones((len(places), len(bounds)), dtype=np.bool_)
    for axis in range(3):
        place = places[:, None, axis]
        found &= (place > bounds[:, 0, axis]) & (place < bounds[:, 1, axis])
    return found


_FREE = "nothing keeps them apart; add contacts to the scene where that can be, keep them apart, or say contacts: none"
_THROUGH = "they came through their contact; shorten the step, or let them meet more slowly or press less"
