"""Islands that sleep: they are asked for nothing, and stand in reports as they stood in their last step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.islands import CALM, SLEEP, WAKE, Island
from softseam_coupling.loops.loop import Outcome
from softseam_protocol.errors import DecodeError
from softseam_protocol.messages.outcomes import SPENT, Figure
from softseam_protocol.messages.participant import Advanced, ToolMotion
from softseam_protocol.wire.codec import decode, encode
from softseam_services.body.errors import SettingError
from softseam_services.orchestrator.solutions import Solutions
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
Entries = dict[str, NDArray[np.generic]]
_Seen = tuple[Floats, Floats, frozenset[tuple[str, ...]]]
"""poses of tools (t, 3) [m], (t, 4), and islands"""

_QUIET: dict[str, Any] = {"tool_work": 0.0, "seconds": 0.0, "fields": None, "alarms": {}, "then": None}
"""of a reply in steps that the part sleeps through"""


class _Around(NamedTuple):
    """What an island sees of tools, see `Island`."""

    tools: dict[str, Floats]
    moving: frozenset[str]


class _Bounds(Mapping[str, Floats]):
    """Boxes of an island's bodies, which few rules look at."""

    def __init__(self, names: tuple[str, ...], solutions: Solutions) -> None:
        self._names, self._solutions = names, solutions

    def __getitem__(self, name: str) -> Floats:
        if name not in self._names:
            raise KeyError(name)
        return self._solutions.bounds(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Sleeping:
    """Which islands sleep.

    rule     that the scene names; None: none ever sleeps
    islands  bodies of each
    mass     of each body [kg]
    woke     is told of an island that wakes: its bodies, and why
    """

    def __init__(
        self,
        rule: str | None,
        islands: Sequence[tuple[str, ...]],
        mass: Mapping[str, float],
        tools: ToolSet,
        woke: Callable[[tuple[str, ...], str], None],
    ) -> None:
        if rule is not None and rule not in SLEEP:
            raise SettingError(f"sleep: {SLEEP.problem(rule)}")
        self._rule = None if rule is None else SLEEP[rule]
        self._islands, self._mass, self._woke = islands, mass, woke
        self._names, self._reach = tools.names, dict(zip(tools.names, tools.reach.tolist(), strict=True))
        self.reset()

    def reset(self) -> None:
        """All are awake."""
        self._asleep: dict[tuple[str, ...], dict[str, Outcome]] = {}
        self._seen: _Seen | None = None  # by those that sleep, when none had a reason to wake
        self._calm = dict.fromkeys(self._islands, 0)

    @property
    def possible(self) -> bool:
        """Whether any island may ever sleep."""
        return self._rule is not None

    def outcomes(self) -> dict[str, Outcome]:
        """Of bodies that sleep, what they did in the last step, by name."""
        if not self._asleep:
            return {}
        return {name: outcome for outcomes in self._asleep.values() for name, outcome in outcomes.items()}

    def wake(self, motion: ToolMotion) -> None:
        """A step begins: wake the islands that have a reason. What saw the same tools stand still has none."""
        if not self._asleep:
            return
        around = self._around(motion)
        seen = motion.position_next, motion.orientation_next, frozenset(self._asleep)
        if not around.moving and self._seen is not None and _alike(self._seen, seen):
            return
        self._seen = None if around.moving else seen
        for island in list(self._asleep):
            reason = _reason(self._view(island, Solutions(self._asleep[island]), around))
            if reason:
                del self._asleep[island]
                self._calm[island] = 0
                self._woke(island, reason)

    def follow(self, solutions: Solutions, motion: ToolMotion) -> list[tuple[str, ...]]:
        """A step was taken: the islands that sleep from now on."""
        if self._rule is None:
            return []
        fell: list[tuple[str, ...]] = []
        around = self._around(motion)
        for island in self._islands:
            if island in self._asleep:
                continue
            view = self._view(island, solutions, around)
            self._calm[island] = self._calm[island] + 1 if view.speed < CALM else 0
            if self._rule(replace(view, calm_steps=self._calm[island])) and not _reason(view):
                self._asleep[island] = {name: _quiet(solutions[name]) for name in island}
                fell.append(island)
        return fell

    def _around(self, motion: ToolMotion) -> _Around:
        moves = (motion.position_next != motion.position).any(axis=1) | (
            motion.orientation_next != motion.orientation
        ).any(axis=1)
        return _Around(
            dict(zip(self._names, motion.position_next, strict=True)),
            frozenset(name for name, moving in zip(self._names, moves.tolist(), strict=True) if moving),
        )

    def _view(self, island: tuple[str, ...], solutions: Solutions, around: _Around) -> Island:
        return Island(
            sum(solutions.kinetic(name) for name in island),
            sum(self._mass[name] for name in island),
            self._calm[island],
            _Bounds(island, solutions),
            around.tools,
            self._reach,
            around.moving,
        )

    # ---- snapshots

    def save(self) -> Entries:
        """Which sleep and how they stand, and how long the others were calm."""
        entries: Entries = {"calm": np.array([self._calm[island] for island in self._islands])}
        for body, outcome in self.outcomes().items():
            entries[f"{body}/gap"] = np.array([outcome.gap])
            entries[f"{body}/multipliers"] = outcome.multipliers
            replies = {part: np.frombuffer(encode(reply), np.uint8) for part, reply in outcome.replies.items()}
            entries |= {f"{body}/{part}": reply for part, reply in replies.items()}
        return entries

    def load(self, entries: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from `save`. Raises KeyError or ValueError, and changes nothing, where it is of other islands."""
        self._asleep, self._calm = self.read(entries)
        self._seen = None

    def read(
        self, entries: Mapping[str, NDArray[np.generic]]
    ) -> tuple[dict[tuple[str, ...], dict[str, Outcome]], dict[tuple[str, ...], int]]:
        """What `save` saved: the islands that sleep with what their bodies did, and the calm steps of all. Raises
        KeyError or ValueError where it is of other islands."""
        calm = [int(steps) for steps in entries["calm"].astype(np.int64)]
        if len(calm) != len(self._islands):
            raise ValueError(f"it is of {len(calm)} islands")
        found: dict[str, Outcome] = {}
        for body in dict.fromkeys(name.partition("/")[0] for name in entries if "/" in name):
            own = {
                name.removeprefix(f"{body}/"): entry for name, entry in entries.items() if name.startswith(f"{body}/")
            }
            gap, multipliers = (own.pop(name).astype(np.float64) for name in ("gap", "multipliers"))
            try:
                replies = {part: decode(reply.tobytes(), Advanced) for part, reply in own.items()}
            except DecodeError as error:
                raise ValueError(str(error)) from error
            found[body] = Outcome(replies, multipliers, float(gap[0]), 0)
        asleep = [island for island in self._islands if any(name in found for name in island)]
        sleepers = {island: {name: found[name] for name in island} for island in asleep}
        return sleepers, dict(zip(self._islands, calm, strict=True))


def _alike(one: _Seen, other: _Seen) -> bool:
    return one[2] == other[2] and all(np.array_equal(a, b) for a, b in zip(one[:2], other[:2], strict=True))


def _reason(island: Island) -> str:
    return next((reason for wakes in WAKE.values() if (reason := wakes(island))), "")


def _quiet(outcome: Outcome) -> Outcome:
    replies = {}
    for part, reply in outcome.replies.items():
        stays = {name: value for name, value in reply.extras.items() if name not in {*SPENT, Figure.STEP_ERROR}}
        coupling = replace(reply.coupling, work=0.0)
        replies[part] = replace(reply, coupling=coupling, extras={**stays, Figure.ITERATIONS: 0.0}, **_QUIET)
    return replace(outcome, replies=replies, exchanges=0, note="", parts=1)
