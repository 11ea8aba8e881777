"""A step in parts: how finely it is cut at present, the tools' motion cut up, the replies put together again.

Within a step the far side bears a multiplier that does not follow it: a dead load. A region that its seam presses from
two sides by F, of length L and moment of inertia I, then falls over as a pencil on its tip does, by exp(omega dt) with
omega = sqrt(F L/I), and the near side, which would hold it, is asked only once a step. The compliance of such a far
side is that of the fall: of a cube of 20 mm, 1 MPa, squeezed by a tenth the middle third yields 200 times as far as by
its mass over 5 ms, and 1e9 times as far over 20 ms. No multiplier can be found there, but over a quarter of the step
the exponent is a quarter. So a step that will not settle is cut, and the next ones as finely, with a coarser cut tried
now and then.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from softseam_coupling.loops.loop import Outcome, StepRefused
from softseam_protocol.messages.outcomes import SPENT, Figure
from softseam_protocol.messages.participant import Advanced, ToolMotion

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


_LARGEST = (Figure.PENETRATION, Figure.RESIDUAL, Figure.STEP_ERROR)
"""figures of a step that are the largest of its parts'"""
_POSES = ("position", "orientation", "position_next", "orientation_next")


def part_of(motion: ToolMotion, first: int, last: int, whole: int) -> ToolMotion:
    """The motion from first/whole to last/whole of its time; quaternions along the straight line, normalised."""
    if last - first == whole:
        return motion

    def at(i: int) -> tuple[np.ndarray, np.ndarray]:
        if i == 0:
            return motion.position, motion.orientation
        if i == whole:
            return motion.position_next, motion.orientation_next
        f = i / whole
        turn = motion.orientation + f * (motion.orientation_next - motion.orientation)
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        return motion.position + f * (motion.position_next - motion.position), turn

    return replace(motion, **dict(zip(_POSES, (*at(first), *at(last)), strict=True)))


def sum_replies(parts: Sequence[Mapping[str, Advanced]]) -> dict[str, Advanced]:
    """The last part's replies, with the work and effort of all parts and their mean wrench."""
    return {
        name: replace(
            last,
            tool_work=sum(part[name].tool_work for part in parts),
            coupling=replace(last.coupling, work=sum(part[name].coupling.work for part in parts)),
            seconds=sum(part[name].seconds for part in parts),
            extras={
                **last.extras,
                **{each: sum(part[name].figure(each) for part in parts) for each in sorted(SPENT)},
                **{each: max(part[name].figure(each) for part in parts) for each in _LARGEST},
            },
            alarms=next((part[name].alarms for part in parts if part[name].alarms), {}),
            wrench=np.mean([part[name].wrench for part in parts], axis=0),
        )
        for name, last in parts[-1].items()
    }


class SubdividedStep:
    """One step as it is being taken: how much of it is done, and what its parts gave."""

    def __init__(self, motion: ToolMotion, dt: float) -> None:
        self._motion, self._whole = motion, dt
        self._begin = 0  # in FINEST-ths of the step
        self._solutions: list[Outcome] = []
        self._in_vain = 0  # exchanges of parts that were to be shorter

    @property
    def done(self) -> bool:
        return self._begin == FINEST

    @property
    def n_parts(self) -> int:
        """Parts taken so far."""
        return len(self._solutions)

    def next(self, parts: int) -> tuple[ToolMotion, float, bool]:
        """Motion and length [s] of the next part where the step has so many; whether it could be shorter still."""
        length = FINEST // parts
        return part_of(self._motion, self._begin, self._begin + length, FINEST), self._whole / parts, length > 1

    def taken(self, parts: int, solution: Outcome) -> None:
        """The part that `next` described is the participants' tentative state."""
        self._begin += FINEST // parts
        self._solutions.append(solution)

    def given_up(self, exchanges: int) -> None:
        """The part that `next` described is to be shorter, as so many exchanges have shown."""
        self._in_vain += exchanges

    def solution(self) -> Outcome:
        """The whole step, as its last part left the seam."""
        last = self._solutions[-1]
        if len(self._solutions) == 1:
            return last
        replies: Sequence[Mapping[str, Advanced]] = [solution.replies for solution in self._solutions]
        exchanges = self._in_vain + sum(solution.exchanges for solution in self._solutions)
        return Outcome(sum_replies(replies), last.multipliers, last.gap, exchanges, last.note, self.n_parts)


def take_step(
    pace: Subdivision,
    motion: ToolMotion,
    dt: float,
    advance: Callable[[ToolMotion, float, bool], Outcome],
    keep: Callable[[], None],
) -> Outcome:
    """Take a step of dt [s] whole, or in parts where it will not settle.

    Each part is committed by the next, so that where one fails the step can only be taken back to what was kept.

    advance  takes a part of this motion and length [s]; the last says whether it may raise StepRefused
    keep     keeps what the step began with; called before any part is committed, perhaps more than once
    """
    step = SubdividedStep(motion, dt)
    if pace.parts > 1:
        keep()
    pace.begin()
    while not step.done:
        parts = pace.parts
        try:
            step.taken(parts, advance(*step.next(parts)))
        except StepRefused as fault:
            step.given_up(fault.exchanges)
            pace.cut()
            keep()
    pace.end()
    return step.solution()
