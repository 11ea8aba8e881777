"""Bodies that nothing keeps apart: whether some of them have come to be where others are.

Boxes around bodies are enough for that: of two solid ones that are apart neither has its middle in the other's box, but
for a small one in the corner of a large one's box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Overlaps:
    """Watches b bodies; reports once of every two that come to overlap, those of a look in one event.

    names  of the bodies
    apart  pairs of names that interfaces join
    say    receives kind and text of every event
    """

    def __init__(self, names: Sequence[str], apart: Iterable[Sequence[str]], say: Callable[[str, str], None]) -> None:
        self._names, self._say = names, say
        place = {name: number for number, name in enumerate(names)}
        self._free = np.triu(np.ones((len(names), len(names)), dtype=np.bool_), 1)
        for one, other in apart:
            self._free[place[one], place[other]] = self._free[place[other], place[one]] = False
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._left = self._free.copy()

    @property
    def possible(self) -> bool:
        """Whether any two may still come to overlap unsaid."""
        return bool(self._left.any())

    def look(self, step: int, bounds: Floats) -> None:
        """A step was taken, after which bodies have these bounds, lower and upper (b, 2, 3) [m]."""
        middle = bounds.mean(axis=1)
        inside = ((middle[:, None] > bounds[None, :, 0]) & (middle[:, None] < bounds[None, :, 1])).all(axis=2)
        found = np.argwhere(self._left & (inside | inside.T))
        if not len(found):
            return
        self._left[found[:, 0], found[:, 1]] = False
        one, other = (self._names[number] for number in found[0].tolist())
        more = f", and {len(found) - 1} other pairs" if len(found) > 1 else ""
        self._say(
            "overlap",
            f"step {step}: {one} and {other} are where the other is{more}: nothing keeps them apart; add contacts to "
            "the scene where that can be, keep them apart, or say contacts: none",
        )
