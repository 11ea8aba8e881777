"""Bodies that sleep: they are asked for nothing, and stand in reports as they stood in their last step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.loop import Outcome
from softseam_coupling.sleep import SLEEP, STRICT, TOLERANCES, WAKE, Neighbourhood, Reasons
from softseam_protocol.errors import DecodeError
from softseam_protocol.messages.outcomes import SPENT, Figure
from softseam_protocol.messages.participant import Advanced, ToolMotion
from softseam_protocol.wire.codec import decode, encode
from softseam_services.body.errors import SettingError
from softseam_services.orchestrator.pile_bodies import PileBodies
from softseam_services.orchestrator.solutions import Solutions
from softseam_services.orchestrator.standing import standing_on_tools
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Entries = dict[str, NDArray[np.generic]]
Saved = Mapping[str, NDArray[np.generic]]

_QUIET: dict[str, Any] = {"tool_work": 0.0, "seconds": 0.0, "fields": None, "alarms": {}, "then": None}
"""of a reply in steps that the part sleeps through"""

_SAID = 8
"""of islands that wake in a step, of how many an event says why"""


@dataclass(slots=True)
class _Known:
    """What is known of b bodies, and of m contacts between those of piles; updated in place."""

    asleep: Mask
    """(b,)"""
    calm: NDArray[np.int64]
    """steps in a row in which each was calm, see `Neighbourhood` (b,)"""
    kinetic: Floats
    """(b,) [J]"""
    speed: Floats
    """of the fastest node (b,) [m/s]"""
    low: Floats
    """lower corner of each one's box (b, 3) [m]"""
    high: Floats
    way: Floats
    """how far these went in the last step that each took (b, 2, 3) [m]"""
    held: Floats
    """of each contact, force of its second body on the first as either fell asleep, or became calm (m, 2, 3) [N]"""
    changed: Floats
    """by how much forces on each body changed since (b,) [N]"""
    load: Floats
    """and sizes of all that pressed it then, added up (b,) [N]"""
    by_tools: Floats
    """of these, what tools press it with as it is (b,) [N]"""

    @classmethod
    def nothing(cls, b: int, m: int) -> _Known:
        flat, ids = np.zeros((b, 3)), np.zeros(b, dtype=np.int64)
        still = np.zeros((m, 2, 3)), np.zeros(b), np.zeros(b), np.zeros(b)
        boxes = flat, flat.copy(), np.zeros((b, 2, 3))
        return cls(np.zeros(b, dtype=np.bool_), ids, np.zeros(b), np.zeros(b), *boxes, *still)


class Sleeping:
    """Which bodies sleep.

    rule     that the scene names; None: none ever sleeps
    islands  bodies of each: those of one sleep and wake together
    weight   of each body (3,) [N]
    mass     [kg]
    piles    in which some are
    dt       length of a step [s]
    woke     receives, where bodies wake, whose and why
    """

    def __init__(
        self,
        rule: str | None,
        islands: Sequence[tuple[str, ...]],
        weight: Mapping[str, Floats],
        mass: Mapping[str, float],
        piles: Sequence[PileBodies],
        tools: ToolSet,
        dt: float,
        woke: Callable[[str], None],
    ) -> None:
        if rule is not None and rule not in SLEEP:
            raise SettingError(f"sleep: {SLEEP.problem(rule)}")
        self._rule = None if rule is None else SLEEP[rule]
        self._tolerance = STRICT if rule is None else TOLERANCES.get(rule, STRICT)
        self._names, self._piles, self._woke, self._dt = list(mass), piles, woke, dt
        self._weights, self._mass = (np.array([of[name] for name in self._names]) for of in (weight, mass))
        self._weight = np.sqrt((self._weights * self._weights).sum(axis=1))
        self._tools = tools
        places = {name: place for place, name in enumerate(self._names)}
        self._islands = islands
        self._island = np.zeros(len(self._names), dtype=np.int64)
        for number, island in enumerate(islands):
            self._island[[places[name] for name in island]] = number
        self._rows = [np.array([places[name] for name in each.pile.names]) for each in piles]
        self._apart = sorted(set(places.values()).difference(*(rows.tolist() for rows in self._rows)))
        self._guests = [np.array([places[name] for name in each.pile.guests], dtype=np.int64) for each in piles]
        met = [np.concatenate(each) for each in zip(self._rows, self._guests, strict=True)]
        pairs = [ids[each.pile.pairs] for ids, each in zip(met, piles, strict=True)]
        self._pairs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs])
        self.reset()

    def reset(self) -> None:
        """All are awake."""
        self._known = _Known.nothing(len(self._names), len(self._pairs))
        self._seen_contacts = np.zeros(len(self._pairs), dtype=np.bool_)  # those that came near: others do not press
        self._live = np.zeros(0, dtype=np.int64)  # their numbers
        self._kept: dict[str, Outcome] = {}  # of those that sleep and are in no pile, their last steps
        self._of_tools: tuple[ToolMotion | None, Mask, Floats] = None, np.zeros(0, np.bool_), np.zeros((0, 3))
        self._seen: tuple[bytes, ...] = ()  # of tools and sleepers, when none had a reason to wake and none was awake

    @property
    def possible(self) -> bool:
        """Whether any body may ever sleep."""
        return self._rule is not None

    @property
    def any(self) -> bool:
        """Whether one sleeps."""
        return self._rule is not None and bool(self._known.asleep.any())

    @property
    def names(self) -> list[str]:
        """Of those that sleep."""
        return [self._names[place] for place in np.flatnonzero(self._known.asleep).tolist()]

    @property
    def outcomes(self) -> Mapping[str, Outcome]:
        """Of bodies that sleep and are in no pile, what they did in the last step, by name."""
        return self._kept

    def of_pile(self, number: int) -> tuple[Mask, Mask]:
        """Which bodies of a pile sleep (b,), and which of its guests (g,)."""
        asleep = self._known.asleep
        return asleep[self._rows[number]], asleep[self._guests[number]]

    # ---- a step

    def wake(self, motion: ToolMotion) -> None:
        """A step begins: wake whoever has a reason. Where all sleep and saw the same tools stand still, none has."""
        if not self.any:
            return
        known, around = self._known, self._around(motion)
        seen: tuple[bytes, ...] = ()
        if known.asleep.all() and not around.moving.any():
            seen = motion.position_next.tobytes(), motion.orientation_next.tobytes()
            if seen == self._seen:
                return
        self._seen = seen
        self._wake(_reasons(around))

    def feel(self, outcomes: Mapping[str, Outcome], motion: ToolMotion) -> list[str]:
        """A step came to this, and is not committed yet: wake whoever has a reason in what others press it with; the
        parts of the piles in which one does, or that are its hosts."""
        if not len(self._pairs):
            return []
        pressed = self._pressed.copy()
        begin = 0
        for pile in self._piles:
            outcome, n = outcomes.get(pile.pile.part), len(pile.pressed)
            said = None if outcome is None else outcome.replies[pile.pile.part].members
            if said is not None:
                pressed[begin : begin + n] = pile.pressed_after(said.meetings)
                self._see(begin + said.meetings.contact.astype(np.int64))
            begin += n
        woken = self._wake(_reasons(replace(self._around(motion), changed=self._changes(pressed))))
        piles = zip(self._rows, self._guests, self._piles, strict=True)
        return [pile.pile.part for rows, guests, pile in piles if woken[rows].any() or woken[guests].any()]

    def _wake(self, reasons: Reasons) -> Mask:
        """Wake whoever sleeps and has a reason, and those of its island; who woke (b,)."""
        known = self._known
        woken: dict[int, str] = {}
        for place, reason in reasons.items():
            if known.asleep[place]:
                woken.setdefault(int(self._island[place]), reason)
        if not woken:
            return np.zeros_like(known.asleep)
        self._seen = ()
        wakes = np.isin(self._island, list(woken)) & known.asleep
        known.asleep[wakes], known.calm[wakes] = False, 0
        self._hold(wakes)
        said = []
        for number, reason in sorted(woken.items()):
            for name in self._islands[number]:
                self._kept.pop(name, None)
            said.append(f"{', '.join(self._islands[number])}: {reason}")
        more = [f"and {len(said) - _SAID} more"] if len(said) > _SAID else []
        self._woke("; ".join(said[:_SAID] + more))
        return np.asarray(wakes)

    def follow(self, solutions: Solutions, motion: ToolMotion) -> list[tuple[str, ...]]:
        """A step was taken: the islands that sleep from now on."""
        if self._rule is None:
            return []
        known = self._known
        self._look(solutions)
        around = self._around(motion)
        calm = (known.speed < self._tolerance.speed) & (known.changed <= around.allowed)
        known.calm[:] = np.where(known.asleep, known.calm, np.where(calm, known.calm + 1, 0))
        self._hold(known.calm == 0)
        may = np.asarray(self._rule(around)) & ~known.asleep
        if not may.any():
            return []
        may[list(_reasons(around))] = False
        stays = np.unique(self._island[~may])
        falls = ~np.isin(self._island, stays)
        known.asleep |= falls
        self._hold(falls)
        islands = [self._islands[number] for number in np.unique(self._island[falls]).tolist()]
        guests = np.concatenate([np.zeros(0, dtype=np.int64), *self._guests])
        for place in self._apart:
            if falls[place]:
                outcome = _quiet(solutions[self._names[place]])
                alone = len(self._islands[self._island[place]]) == 1 and place not in guests
                self._kept[self._names[place]] = standing_on_tools(outcome, self._weights[place]) if alone else outcome
        return islands

    def _hold(self, of: Mask) -> None:
        """From now on changes of what presses these bodies (b,) count."""
        pressed, known, live = self._pressed, self._known, self._live
        for side in (0, 1):
            begins = live[of[self._pairs[live, side]]]
            known.held[begins, side] = pressed[begins]
        known.changed[of] = 0.0
        sizes = _sizes(pressed[live])
        by_others = np.bincount(self._pairs[live].ravel(), np.repeat(sizes, 2), len(self._names))
        known.load[of] = np.maximum(by_others + known.by_tools, self._weight)[of]

    @property
    def _pressed(self) -> Floats:
        """Force of the second body of each contact on the first (m, 3) [N]."""
        if len(self._piles) == 1:
            return self._piles[0].pressed
        return np.concatenate([np.zeros((0, 3)), *(pile.pressed for pile in self._piles)])

    def _look(self, solutions: Solutions) -> None:
        """See where bodies are after a step, and what presses those that sleep."""
        known = self._known
        low, high = known.low.copy(), known.high.copy()
        for rows, pile in zip(self._rows, self._piles, strict=True):
            step = pile.step
            known.kinetic[rows], known.speed[rows] = step.kinetic, step.fastest
            known.low[rows], known.high[rows] = step.low, step.high
            known.by_tools[rows] = _sizes(step.wrench[:, :, :3]).sum(axis=1)
        for place in self._apart:
            if not known.asleep[place]:
                replies = solutions[self._names[place]].replies.values()
                boxes = np.array([reply.bounds for reply in replies])
                known.low[place], known.high[place] = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
                known.kinetic[place] = sum(reply.kinetic for reply in replies)
                known.speed[place] = max(reply.figure(Figure.FASTEST) for reply in replies)
                known.by_tools[place] = sum(_sizes(reply.wrench[:, :3]).sum() for reply in replies)
        known.way[:, 0], known.way[:, 1] = known.low - low, known.high - high
        self._see(np.flatnonzero(self._pressed.any(axis=1)))
        mean = np.sqrt(2.0 * known.kinetic / self._mass)
        np.maximum(known.speed, mean, out=known.speed)  # of models that do not say how fast their nodes are
        known.changed[:] = self._changes(self._pressed)

    def _see(self, contacts: NDArray[np.int64]) -> None:
        """Contacts of these numbers came near enough to press."""
        seen = self._seen_contacts
        if not seen[contacts].all():
            seen[contacts] = True
            self._live = np.flatnonzero(seen)

    def _changes(self, pressed: Floats) -> Floats:
        """By how much what presses each body (b,) [N] is another than it held, if contacts press so (m, 3) [N]."""
        live = self._live
        size = _sizes(pressed[live, None] - self._known.held[live])
        found = np.bincount(self._pairs[live].ravel(), size.ravel(), len(self._names))
        return found.astype(np.float64, copy=False)

    def _around(self, motion: ToolMotion) -> Neighbourhood:
        known, tools = self._known, self._tools
        if motion is not self._of_tools[0]:
            turns = (motion.orientation_next != motion.orientation).any(axis=1)
            moves = (motion.position_next != motion.position).any(axis=1) | turns
            self._of_tools = motion, moves, tools.half_around(motion.orientation_next)
        _, moves, half = self._of_tools
        return Neighbourhood(
            *(self._names, known.kinetic, known.speed, known.low, known.high, known.way, self._weight, known.load),
            *(
                known.calm,
                known.asleep,
                self._pairs,
                known.changed,
                tools.names,
                motion.position_next,
                tools.reach,
                half,
            ),
            *(moves, self._dt, self._tolerance),
        )

    # ---- snapshots

    def save(self) -> Entries:
        """All that is known, and of those that sleep how they stand."""
        known = self._known
        entries: Entries = {name: np.array(getattr(known, name)) for name in _Known.__slots__}
        for place in np.flatnonzero(known.asleep).tolist():
            body = self._names[place]
            outcome = self._kept[body] if body in self._kept else _quiet(self._of_pile(place))
            entries[f"{body}/gap"] = np.array([outcome.gap])
            entries[f"{body}/multipliers"] = outcome.multipliers
            replies = {part: np.frombuffer(encode(reply), np.uint8) for part, reply in outcome.replies.items()}
            entries |= {f"{body}/{part}": reply for part, reply in replies.items()}
        return entries

    def _of_pile(self, place: int) -> Outcome:
        """What a step did to a body of a pile."""
        pile = next(pile for rows, pile in zip(self._rows, self._piles, strict=True) if place in rows)
        return pile.outcome(self._names[place])

    def load(self, entries: Saved) -> None:
        """Continue from `save`, after the piles. Raises KeyError or ValueError, and changes nothing, where it is of
        other bodies."""
        self._known, found = self.read(entries)
        self._seen_contacts[:] = False
        self._see(np.flatnonzero(self._pressed.any(axis=1) | self._known.held.any(axis=(1, 2))))
        self._seen, self._kept = (), {}
        for name, outcome in found.items():
            holder = next((pile for pile in self._piles if name in pile.pile.names), None)
            if holder is None:
                self._kept[name] = outcome
            else:
                (reply,) = outcome.replies.values()
                holder.stand(name, reply)

    def read(self, entries: Saved) -> tuple[_Known, dict[str, Outcome]]:
        """What `save` saved: what is known, and what those that sleep did. Raises KeyError or ValueError where it is of
        other bodies."""
        known = _Known.nothing(len(self._names), len(self._pairs))
        for name in _Known.__slots__:
            own = getattr(known, name)
            if entries[name].shape != own.shape:
                raise ValueError(f"it is of {len(entries[name])} bodies or contacts, not of {len(own)}: {name}")
            own[:] = entries[name]
        found: dict[str, Outcome] = {}
        for place in np.flatnonzero(known.asleep).tolist():
            body = self._names[place]
            own = {
                name.removeprefix(f"{body}/"): entry for name, entry in entries.items() if name.startswith(f"{body}/")
            }
            gap, multipliers = (own.pop(name).astype(np.float64) for name in ("gap", "multipliers"))
            try:
                replies = {part: decode(reply.tobytes(), Advanced) for part, reply in own.items()}
            except DecodeError as error:
                raise ValueError(str(error)) from error
            found[body] = Outcome(replies, multipliers, float(gap[0]), 0)
        return known, found


def _sizes(forces: Floats) -> Floats:
    """Of vectors (..., 3), (...)."""
    return np.asarray(np.sqrt(np.einsum("...c,...c->...", forces, forces)))


def _reasons(around: Neighbourhood) -> Reasons:
    """Of each body that has one, the first."""
    found: dict[int, str] = {}
    for wakes in WAKE.values():
        for place, reason in wakes(around).items():
            found.setdefault(place, reason)
    return found


def _quiet(outcome: Outcome) -> Outcome:
    replies = {}
    for part, reply in outcome.replies.items():
        stays = {name: value for name, value in reply.extras.items() if name not in {*SPENT, Figure.STEP_ERROR}}
        coupling = replace(reply.coupling, work=0.0)
        replies[part] = replace(reply, coupling=coupling, extras={**stays, Figure.ITERATIONS: 0.0}, **_QUIET)
    return replace(outcome, replies=replies, exchanges=0, note="", parts=1)
