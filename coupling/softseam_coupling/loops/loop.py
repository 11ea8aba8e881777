"""What a coupling loop is: how the parts that meet at interfaces take a step together, and what it asks them for.

A loop is built for one epoch, in which parts and interfaces stay as they are. It names parts by their ids and never
sees a solver: it asks for tentative steps and for corrections of these, by callables, and returns replies, multipliers
and gap. `LOOPS` (`softseam_coupling.loops`) has the loops by the names that `seam.scheme` takes.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.kernels.largest_node import largest_node
from softseam_protocol.messages.participant import Advanced, Capabilities

Floats = NDArray[np.float64]
Ids = NDArray[np.int32]
Mask = NDArray[np.bool_]

__all__ = [
    "Ask",
    "Correct",
    "Correction",
    "First",
    "Loop",
    "LoopSetup",
    "Outcome",
    "PartRequest",
    "StepDiverged",
    "StepRefused",
    "Unsuited",
    "ask_compliance_of",
    "largest",
    "spread_over",
    "wider",
]


@dataclass(frozen=True, slots=True)
class PartRequest:
    """What one part is asked for in one exchange. n coupling nodes."""

    force: Floats
    """on its coupling nodes (n, 3) [N]: over the step, or at its end where `start` is given"""
    renew: bool = False
    """find its compliance anew; where `start` is given that of its velocities"""
    repeat: bool = False
    """report the compliance of the factor at hand, also if that was reported before"""
    target: Floats | None = None
    """where the parts beyond it would have its nodes (n, 3) [m]; None: it is solved without them"""
    impedance: Floats | None = None
    """theirs (3n, 3n) [N/m]; None: as sent before"""
    start: Floats | None = None
    """force at the step's start, from which it goes to `force` linearly in time (n, 3) [N]; None: it is constant"""
    asked: Ids | None = None
    """places among its coupling nodes of those whose answers to forces are wanted (a,); None: all"""
    last: bool = True
    """whether this may be the state that is committed: not where it is likely to be corrected"""


@dataclass(frozen=True, slots=True)
class Correction:
    """By what a part is moved on before its step is committed."""

    push: Floats
    """force on its nodes (n, 3) [N] by whose linear answer it moves, its impedance behind it"""
    force: Floats
    """that acts on them then (n, 3) [N]"""


Ask = Callable[[dict[str, PartRequest]], dict[str, Advanced]]
"""has parts take the step anew, from where it began; their tentative answers"""
First = Callable[[], dict[str, PartRequest]]
"""what a loop asks for first in the step that follows, if that is as long as this one"""
Correct = Callable[[dict[str, Correction], First], dict[str, Advanced]]
"""moves their last tentative answers on, which ends the step; whoever has the tools' next motion may have the parts
take the step that follows at once, and give `Ask` their answers"""


@dataclass(frozen=True, slots=True)
class Outcome:
    """A step that the parts agree on or, where there is a note, the last of the exchanges that were allowed."""

    replies: dict[str, Advanced]
    """as corrected, where they were"""
    multipliers: Floats
    """of all rows (c, 3) [N]"""
    gap: float
    """largest of positions [m]"""
    exchanges: int
    note: str = ""
    """'' or what fell short"""
    parts: int = 1
    """shorter steps that it was taken in"""


MOST_ASKED = 2
"""times as many nodes as are needed that are asked for before those that are needed no more are left out [1]"""
NOT_CONVERGED = "the sides' exchanges did not converge"
"""note of a step that is kept as it is after the most exchanges"""


class StepDiverged(RuntimeError):
    """The parts' answers are not finite, or grow; the text says why."""


class StepRefused(RuntimeError):
    """The parts do not agree within so many exchanges; in shorter steps they may."""

    def __init__(self, exchanges: int) -> None:
        super().__init__(f"not within {exchanges} exchanges")
        self.exchanges = exchanges


class Unsuited(ValueError):
    """A loop cannot couple these parts and interfaces; the text says which can."""


@dataclass(frozen=True)
class LoopSetup:
    """What a loop is built from, for one epoch."""

    interfaces: tuple[Interface, ...]
    """in the order of their rows"""
    mobility: Mapping[str, Floats]
    """1/mass of each part's coupling nodes (n,) [1/kg]: a part's compliance over dt^2 as long as it reported none"""
    tolerance: float
    """largest gap [m]"""
    cell: float
    """edge of the smallest cell [m]"""
    exchanges: int
    """most that a step takes"""
    first: Floats | None = None
    """multipliers that belong to the parts' state (c, 3) [N]; None: zero"""


def ask_compliance_of(parts: Iterable[str], capabilities: Mapping[str, Capabilities]) -> None:
    """Raise Unsuited where one of these parts does not report how it yields."""
    for name in parts:
        able = capabilities.get(name)
        if able is None or not able.compliance:
            raise Unsuited(
                f"part {name!r} reports no compliance, by which it is to be coupled: its participant must report it "
                "(Capabilities.compliance, Coupled.compliance; see docs/guide/write-a-participant.md)"
            )


class Loop(Protocol):
    """Couples parts for one epoch. Everything that evolves goes through `to_arrays` and `take`."""

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """The parts are configured, and can do so much; called after `take`, if at all, and before the first step.

        Raises Unsuited where they cannot do what the loop asks for.
        """

    def multipliers(self) -> Floats:
        """The last committed ones (c, 3) [N]."""

    def solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool = False) -> Outcome:
        """Take a step of length dt [s].

        may_refuse  where the parts do not agree, raise StepRefused and commit nothing; else keep the last exchange

        Raises StepDiverged. A step that fails leaves the loop as it was, but for what it learned of the parts.
        """

    def forget_sent(self) -> None:
        """The parts took a snapshot or were restored: what they keep of one another is sent again."""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, but what the parts report anew, for a snapshot: arrays that it writes to no more."""

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""


def spread_over(root: Floats, asked: Ids | None, n_nodes: int) -> Floats:
    """A root R as a part answered, of all of its coupling nodes (3n, r), where it may be of those alone that were asked
    for (3a, r): the others are taken to stay."""
    if asked is None or len(root) != 3 * len(asked):
        return root
    found = np.zeros((n_nodes, 3, root.shape[1]))
    found[asked] = root.reshape(len(asked), 3, -1)
    return found.reshape(3 * n_nodes, -1)


def wider(asked: Mask, needed: Mask) -> Mask:
    """Nodes to ask for (n,), one at least, where these were (n,) and those are needed (n,): the same as long as it
    serves."""
    if not needed.any():
        return asked if asked.any() else np.arange(len(asked)) == 0
    serves = not (needed & ~asked).any() and asked.sum() <= MOST_ASKED * needed.sum()
    return asked if serves else needed


def largest(vectors: Floats) -> float:
    """Greatest length of vectors (s, 3), 0 for none; NaN where one is."""
    return float(largest_node(vectors.reshape(-1))) if len(vectors) else 0.0
