"""A run of FEM that is kept whole, so that it can be differentiated: see `differentiable.Tape`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.tools.tool_set import ToolSet

from .integrators.scheme import Scheme
from .state import FemState
from .step_derivative import Augmentation, Passage, StepDerivative

if TYPE_CHECKING:  # which makes tapes
    from .solver import FemSolver


class FemTape:
    """s steps of one body with n nodes between t tools."""

    def __init__(self, solver: FemSolver, scheme: Scheme, tools: ToolSet, dt: float) -> None:
        self._solver, self._scheme, self._tools, self._dt = solver, scheme, tools, dt
        self._places, self._orientation = [tools.position.copy()], tools.orientation.copy()
        self.states: list[FemState] = [solver.state.copy()]
        """before the first step and after each (s + 1)"""
        self.augmented: list[Sequence[Augmentation]] = []
        """of each step"""

    def keep(self, tool_position: Floats) -> None:
        """A step was taken, and left the tools at (t, 3) [m]."""
        self.states.append(self._solver.state.copy())
        self.augmented.append(self._solver.augmented)
        self._places.append(tool_position.copy())

    @property
    def positions(self) -> Floats:
        """Of all nodes, before the first step and after each (s + 1, n, 3) [m]."""
        return np.stack([state.x for state in self.states])

    @property
    def tool_position(self) -> Floats:
        """Likewise (s + 1, t, 3) [m]."""
        return np.stack(self._places)

    def passage(self, step: int) -> Passage:
        """One of its steps, from 0."""
        now, end = self.states[step : step + 2]
        begin, stop = self._places[step : step + 2]
        return Passage(now, end, self.augmented[step], begin, stop, self._orientation)

    def derivatives(self, tolerance: float) -> StepDerivative:
        """Of its steps; tolerance: of their linear equations, relative."""
        tables = self._solver.tables.whole
        return StepDerivative(self._scheme, tables, self._tools, self._dt, tolerance, self.passage)
