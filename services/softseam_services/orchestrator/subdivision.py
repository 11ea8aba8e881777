"""How finely the steps of a seam are cut at present.

Within a step the far side bears a multiplier that does not follow it: a dead load. A region that its seam presses from
two sides by F, of length L and moment of inertia I, then falls over as a pencil on its tip does, by exp(omega dt) with
omega = sqrt(F L/I), and the near side, which would hold it, is asked only once a step. The compliance of such a far
side is that of the fall: of a cube of 20 mm, 1 MPa, squeezed by a tenth the middle third yields 200 times as far as by
its mass over 5 ms, and 1e9 times as far over 20 ms. No multiplier can be found there, but over a quarter of the step
the exponent is a quarter. So a step that will not settle is cut, and the next ones as finely, with a coarser cut tried
now and then.
"""

from __future__ import annotations

from collections.abc import Sequence

FINEST = 128
"""most parts of a step"""
_FIRST = 4
"""parts of a step that would not settle whole"""
_LONGEST = 64
"""most steps between tries of a coarser one"""


class Subdivision:
    """Parts of the steps to come: one until a step fails, then four, eight ... `FINEST`."""

    def __init__(self) -> None:
        self.parts = 1
        """of a step, at present"""
        self._wait = 0  # steps until a coarser one is tried
        self._patience = 0  # what it is set to where that fails
        self._tries = False  # whether the step at hand is such a try

    def begin(self) -> None:
        """A step begins: where it is time, try a coarser one."""
        self._tries = self.parts > 1 and self._wait == 0
        if self._tries:
            self.parts = self.parts // 2 if self.parts > _FIRST else 1
        elif self.parts > 1:
            self._wait -= 1

    def cut(self) -> None:
        """A part would not settle."""
        self.parts = min(2 * self.parts, FINEST) if self.parts > 1 else _FIRST
        if self._tries:
            self._patience = min(2 * self._patience + 1, _LONGEST)
            self._tries = False
        self._wait = self._patience

    def end(self) -> None:
        """The step was taken."""
        if self._tries:
            self._patience, self._tries = 0, False

    def to_list(self) -> list[float]:
        """For a snapshot between two steps."""
        return [self.parts, self._wait, self._patience]

    def take(self, numbers: Sequence[float]) -> None:
        """Continue from `to_list`."""
        self.parts, self._wait, self._patience = (int(number) for number in numbers)
        self._tries = False
