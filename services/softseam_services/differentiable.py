"""What a solver offers whose steps can be differentiated, so that who asks for gradients knows no solver."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

from softseam_services.body.body import Floats
from softseam_services.tools.tool_set import ToolSet


class NotSmooth(ValueError):
    """A step has no derivative here; the text says which, and what helps."""


class Near(NamedTuple):
    """A contact that is about to change its state when a step ends."""

    tool: int
    margin: float
    """relative change of forces that it takes [1]"""


class Differential(Protocol):
    """Of n nodes, t tools. Backward, derivatives of a number by each entry; forward, their change. Written in place.

    x, v                  positions and velocities (n, 3)
    tool_force            of the body on tools in the step (t, 3)
    tool_start, tool_end  places of tools when the step begins, and when it ends (t, 3)
    friction              coefficients of tools (t,)
    young                 logarithm of Young's modulus (1,)
    """

    x: Floats
    v: Floats
    tool_force: Floats
    tool_start: Floats
    tool_end: Floats
    friction: Floats
    young: Floats


D = TypeVar("D", bound=Differential)


class Derivatives(Protocol[D]):
    """Of the steps of a tape, looked at one after the other, in any order."""

    iterations: int
    """of all solutions"""
    factors: int
    """that were made"""

    def zero(self) -> D:
        """What nothing is owed to, or nothing changes."""

    def look(self, step: int, near: float) -> Sequence[Near]:
        """Linearise a step, from 0; contacts within `near` of a change. Raises NotSmooth."""

    def pull(self, owed: D) -> None:
        """What is owed to a step's end becomes what is owed to its start, in place. Raises NotSmooth."""

    def push(self, change: D) -> None:
        """A change of the start of the step looked at, and of inputs, becomes one of its end, in place."""


class Tape(Protocol):
    """A run that is kept whole: the states between its steps, and where tools were."""

    @property
    def positions(self) -> Floats:
        """Of all nodes, before the first step and after each (s + 1, n, 3) [m]."""

    @property
    def tool_position(self) -> Floats:
        """Likewise (s + 1, t, 3) [m]."""

    def keep(self, tool_position: Floats) -> None:
        """A step was taken, and left the tools at (t, 3) [m]."""

    def derivatives(self, tolerance: float) -> Derivatives[Any]:
        """Of its steps; tolerance: of their linear equations, relative."""


@runtime_checkable
class Differentiable(Protocol):
    """A solver whose steps can be differentiated."""

    def begin_tape(self, tools: ToolSet, dt: float) -> Tape:
        """Of a run from here, in steps of dt [s], between tools that stand where they are now and never turn."""
