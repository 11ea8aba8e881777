"""When the cells that the goal blames are looked for, and what was found last.

A look costs two to four steps (docs/decisions/07), so it is due when the body has four times the strain energy that
it had at the last one, and every hundred steps; in between, the last look counts. Where there is no goal yet, because
nothing is gripped or strained, it is asked for every few steps, which costs next to nothing. Where there is one but no
adjoint, the look has cost what it costs: the one before it counts until the next is due.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body
from softseam_services.orchestrator.error_estimate import model_shares
from softseam_services.orchestrator.goal_error import GoalError, NoAdjoint

Floats = NDArray[np.float64]

EVERY = 100
"""steps between looks"""
_MORE = 4.0
"""strain energy over that of the last look at which the next one is due [1]"""


class GoalWatch:
    """The last look of one run."""

    def __init__(self, body: Body) -> None:
        self._share = model_shares(body)
        self.reset()

    def reset(self) -> None:
        """Nothing was looked at."""
        self._step, self._strain = -EVERY, 0.0
        self._cells = np.zeros(len(self._share))

    def follow(self, step: int, strain: float, look: Callable[[], GoalError | None]) -> Floats:
        """What PBD in each cell does to the goal, at most, relative to it (C,) [1], after a look where one is due.

        step, strain  the last step's number, and the body's strain energy after it [J]
        """
        if strain > _MORE * self._strain or step >= self._step + EVERY:
            try:
                found = look()
            except NoAdjoint:
                self._step, self._strain = step, strain
                return self._cells
            self._step, self._strain = (step, strain) if found is not None else (-EVERY, 0.0)
            self._cells = np.zeros(len(self._share)) if found is None else self._share * found.cells
        return self._cells

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What evolves, for a snapshot."""
        return {"goal_cells": self._cells.copy(), "goal_look": np.array([self._step, self._strain])}

    def take(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError, and has changed nothing, where these are others."""
        cells, look = arrays["goal_cells"].astype(np.float64), arrays["goal_look"].astype(np.float64)
        if cells.shape != self._cells.shape or look.shape != (2,):
            raise ValueError(f"it is not of {len(self._cells)} cells")
        self._cells, self._step, self._strain = cells, int(look[0]), float(look[1])
