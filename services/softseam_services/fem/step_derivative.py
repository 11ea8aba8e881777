"""Derivatives of steps that were taken: of each, what its end says of its start and of its inputs, and the reverse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import SAME, Floats
from softseam_services.differentiable import Near, NotSmooth
from softseam_services.tools.tool_set import ToolSet

from .differential import Differential, build_slopes, no_differential
from .inputs import NO_PUSH, Inputs, NewtonSettings, at_rest, build_result
from .integrators.scheme import Scheme
from .kernels.contact_columns import NORMAL, OPEN, PRESSURE, TRACTION
from .kernels.newton import CONVERGED, N_CANDIDATES
from .kernels.step import N_OUT, RETRACE, advance
from .kernels.step_derivative import begin_back, begin_forward, differentiate, finish_back, finish_forward, solve_whole
from .state import FemState
from .structures import Tables
from .turning import TurningDerivative, free_to_turn
from .work import build_work

if TYPE_CHECKING:  # which makes tapes
    from .solver import FemSolver

FORCES = 3
"""columns of a contact state that are forces"""
_LOOKS = NewtonSettings(0.0, 0, False), NewtonSettings(0.0, 1, False)
"""without and with a factor"""
_WORTH_A_FACTOR = 8
"""iterations of a solution after which the next step gets a factor of its own"""


class Augmentation(NamedTuple):
    """A solution of a step that was solved again, as points were in deep."""

    state: FemState
    """of it x counts"""
    multiplier: Floats
    """what it was solved again with (p, t, 3) [N]"""


class Passage(NamedTuple):
    """One step that was taken."""

    now: FemState
    end: FemState
    augmented: Sequence[Augmentation]
    """of the step, in their order"""
    position: Floats
    """of the tools when it begins (t, 3) [m]"""
    position_next: Floats
    """(t, 3) [m]"""
    orientation: Floats
    """over the step (t, 4)"""


Passages = Callable[[int], Passage]


class StepDerivative:
    """Looks at one step after the other, in any order, each with the factor of one near by while that serves."""

    def __init__(
        self, scheme: Scheme, tables: Tables, tools: ToolSet, dt: float, tolerance: float, passages: Passages
    ) -> None:
        """tolerance: relative, of what is solved for; passages: the steps by their number, from 0"""
        self._passages, self._n_tools = passages, len(tools.names)
        self._scheme, self._tables, self._dt, self._tolerance = scheme, tables, dt, tolerance
        self._work = build_work(*tables, len(tools.names))
        self._slopes = build_slopes(self._work)
        turning = free_to_turn(scheme.kind, *tables)
        self._turning = None if turning is None else TurningDerivative(turning, tables, dt)
        self._turned = False  # whether the step that is looked at gave a rotation back
        self._tools = at_rest(tools)
        self._inputs = Inputs(dt, self._tools, np.zeros((0, 3)), dt, 1.0, NO_PUSH)
        self._unused = build_result(len(tables.model.cell_nodes), 0, len(tools.names), N_OUT)
        self._wants_factor = True
        self._step, self._count = -1, 0
        self._passage: Passage  # looked at
        self._at = 0  # its solution that was linearised
        self.iterations = 0
        """of all solutions"""
        self.factors = 0
        """that were made"""

    def zero(self) -> Differential:
        """What nothing is owed to, or nothing changes."""
        return no_differential(self._tables.model, self._n_tools)

    def look(self, step: int, near: float) -> list[Near]:
        """Linearise a step; returns contacts within `near` of a change.

        Raises NotSmooth, with the number `step` in its text.
        """
        tools, passage = self._tools, self._passages(step)
        tools.position[:], tools.position_next[:] = passage.position, passage.position_next
        tools.orientation[:] = tools.orientation_next[:] = passage.orientation
        begun = None if self._turning is None else self._turning.look(passage.now, passage.end)
        self._turned = begun is not None
        self._step, self._passage = step, passage if begun is None else passage._replace(now=begun)
        self._linearise(len(passage.augmented), self._wants_factor)
        if not self._finds_forces():
            raise NotSmooth(f"step {step} came to forces that are not found again: shorten `step`")
        margin = self._slopes.margin[: self._count]
        return [Near(int(self._work.pair[c, 1]), float(margin[c])) for c in np.flatnonzero(margin < near)]

    def pull(self, owed: Differential) -> None:
        """What is owed to the end of the step looked at becomes what is owed to its start, in place."""
        if self._turned and self._turning is not None:
            self._turning.end_back(owed)
        self._pull(owed)
        for number in reversed(range(len(self._passage.augmented))):
            # what the last solution owes to its multipliers, the one before it owes to the forces that it came to
            carried = self._carried()
            kept = [np.where(carried, 0.0, owed.force), owed.anchor.copy(), owed.x.copy(), owed.v.copy()]
            owed.force[~carried[:, :, 0]] = 0.0
            for array in (owed.anchor, owed.x, owed.v, owed.tool_force):
                array[:] = 0.0
            self._linearise(number, False)
            self._pull(owed)
            for array, more in zip((owed.force, owed.anchor, owed.x, owed.v), kept, strict=True):
                array += more
        if self._turned and self._turning is not None:
            self._turning.start_back(owed)

    def push(self, change: Differential) -> None:
        """A change of the start of the step looked at, and of inputs, becomes one of its end, in place."""
        if self._turned and self._turning is not None:
            self._turning.start_forward(change)
        n_augmented = len(self._passage.augmented)
        for number in range(n_augmented):
            kept = [change.force.copy(), change.anchor.copy(), change.x.copy(), change.v.copy()]
            self._linearise(number, False)
            self._push(change)
            kept[0] = np.where(self._carried(), change.force, kept[0])
            for array, before in zip((change.force, change.anchor, change.x, change.v), kept, strict=True):
                array[:] = before
        if n_augmented:
            self._linearise(n_augmented, False)
        self._push(change)
        if self._turned and self._turning is not None:
            self._turning.end_forward(change)

    def _pull(self, owed: Differential) -> None:
        begin_back(*self._tables, self._dt, self._count, owed, self._work, self._slopes)
        self._solve(True, owed)
        finish_back(*self._tables, self._dt, self._count, owed, self._work, self._slopes)

    def _push(self, change: Differential) -> None:
        begin_forward(*self._tables, self._dt, self._count, change, self._work, self._slopes)
        self._solve(False, change)
        finish_forward(*self._tables, self._dt, self._count, change, self._work, self._slopes)

    def _linearise(self, number: int, with_factor: bool) -> None:
        """At the solution of this number of the step that is looked at; the last one is its end."""
        now, augmented, work = self._passage.now, self._passage.augmented, self._work
        self._at = number
        self._end = end = self._passage.end if number == len(augmented) else augmented[number].state
        work.augmentations[0] = number
        if number > 0:
            work.augmented_force[number - 1] = augmented[number - 1].multiplier
        status = advance(
            *(self._scheme, *self._tables, now.arrays, end.arrays, self._inputs, _LOOKS[with_factor]),
            *(work, self._unused, RETRACE),
        )
        self._count = int(work.memo[N_CANDIDATES])
        if with_factor:
            self.factors += 1
            self._wants_factor = False
        if status != CONVERGED:
            raise NotSmooth(f"step {self._step} has an indefinite matrix, as of what buckles: shorten `step`")
        if work.mixed[0] > 0:
            raise NotSmooth(
                f"step {self._step} has cells squeezed to nearly half: squeeze less, or make `body.cell` larger"
            )
        differentiate(*self._tables, now.arrays, end.arrays, *self._common)

    @property
    def _common(self) -> tuple[Any, ...]:
        return self._tools, self._dt, self._count, self._work, self._slopes

    def _finds_forces(self) -> bool:
        """Whether contact comes to the same forces as in the step that was taken."""
        work, there = self._work, self._passage.end.contact[:, :, :FORCES]
        found = np.zeros_like(there)
        touching = np.flatnonzero(work.state[: self._count] != OPEN)
        row = work.contact[touching]
        force = row[:, PRESSURE, None] * row[:, NORMAL : NORMAL + 3] + row[:, TRACTION : TRACTION + 3]
        found[work.pair[touching, 0], work.pair[touching, 1]] = force
        return bool(np.abs(found - there).max(initial=0.0) <= SAME * np.abs(there).max(initial=0.0))

    def _carried(self) -> NDArray[np.bool_]:
        """Points and tools whose forces go over into the multipliers of the next solution of the step (p, t, 1)."""
        work, carried = self._work, np.zeros((*self._passage.now.contact.shape[:2], 1), dtype=np.bool_)
        own = np.flatnonzero(work.hold[: self._count, 1] == 1.0)
        carried[work.pair[own, 0], work.pair[own, 1]] = True
        return carried

    def _solve(self, transposed: bool, differential: Differential) -> None:
        for attempt in range(2):
            iterations = solve_whole(
                *(transposed, *self._tables, self._end.x, self._dt, self._count, self._tolerance),
                *(self._work, self._slopes, differential.w),
            )
            if iterations >= 0:
                self.iterations += iterations
                self._wants_factor = self._wants_factor or iterations > _WORTH_A_FACTOR
                return
            differential.w[:] = 0.0
            if attempt == 0:
                self._linearise(self._at, True)
        raise NotSmooth(f"step {self._step}: its linear equations were not solved; shorten `step`")


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
