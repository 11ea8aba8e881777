"""The bodies of a pile, measured and booked in arrays: what a step did to each, without a look at each.

What evolves of a body (its ledger, its losses, what its quantities remember) is here while steps are taken, and is the
body's own again after `store`, for whoever looks at it alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Alarm
from softseam_coupling.ledgers import Ledgers
from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import Figure, Status
from softseam_protocol.messages.participant import Advanced, Coupled, Fields
from softseam_protocol.messages.pile import Meetings, Members, no_meetings
from softseam_protocol.messages.session import ErrorEstimate, Frame, InterfaceReport, PartReport
from softseam_services.orchestrator.archive import Arrays
from softseam_services.orchestrator.creep import Creep
from softseam_services.orchestrator.energy_balance import Entry
from softseam_services.orchestrator.pierced import idle_inside
from softseam_services.orchestrator.pile import Pile
from softseam_services.orchestrator.pile_quantities import PileQuantities
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.standing import passed_down, with_more
from softseam_services.orchestrator.step_losses import StepLosses
from softseam_services.orchestrator.whereabouts import LOOK_EVERY, Seen, Whereabouts
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

_FREE = np.zeros((0, 3))
_ARRAYS = [each.name for each in fields(Members) if each.name not in ("notes", "met", "meetings", "on_guests")]
_FIGURES = [each for each in Figure if each in _ARRAYS]
_STILL = {"tool_work": 0, "interface_work": 0, "dissipated": 0, "iterations": 0, "n_substeps": 1}
"""of bodies that sleep through a step"""


class PileBodies:
    """Those of one pile, b bodies between t tools.

    named  all that the simulation has, by name; those of the pile are among them
    """

    def __init__(self, pile: Pile, named: Mapping[str, SimulatedBody], program: Program, tools: ToolSet) -> None:
        self.pile, self._bodies = pile, [named[name] for name in pile.names]
        self._quantities = PileQuantities(self._bodies, program)
        bodies = [body.body for body in self._bodies]
        self._tools, self.whereabouts = tools, Whereabouts(bodies, tools, self._tell)
        self._creep = Creep(bodies, tools, LOOK_EVERY * self._bodies[0].scene.step, self._tell)
        self._losses = StepLosses([body.setup for body in self._bodies])
        self._inelastic = any(body.balance.inelastic for body in self._bodies)
        self._parts: list[tuple[str, tuple[str, str, int, int]]] = []
        written = self._bodies[0].scene.joints
        self._written = np.array([name in written for name in pile.contact_names], dtype=np.bool_)
        self._weights = np.array([body.body.total_mass * body.body.gravity for body in self._bodies])

    def begin(self) -> None:
        """The bodies stand where they are put: at the scene's start, or where they were saved."""
        b, t = len(self._bodies), len(self._tools.names)
        none, flat, ids = np.zeros(b), np.zeros((b, 3)), np.zeros(b, dtype=np.int32)
        self._step = Members(
            *(none, none, none, none, none, flat, flat, none, none, none, ids, ids, ids),
            *(np.zeros((b, t, 6)), flat, flat),
            interface_work=none,
            meetings=no_meetings(),
            fastest=none,
        )
        self._met = no_meetings()
        self.pressed = np.zeros((len(self.pile.contacts), 3))
        """force of the second body of each contact on the first (m, 3) [N]"""
        self._said = np.zeros((len(self.pile.contacts), 7))  # of each contact, in its report
        self._reported = self._met.contact  # those of which there was something
        self._contact_reports: dict[str, InterfaceReport] = {}
        self._asleep = np.zeros(b, dtype=np.bool_)  # those that slept through it
        self._swung = np.zeros((b, t, 6))  # of these, on the tools, as they fell asleep
        self._header = Header(SCHEMA_VERSION, "", self.pile.part, 0, 0, 0, 0.0)
        self._seconds, self._awake, self._part_reports = 0.0, np.arange(b), dict[str, PartReport]()
        self._shown: Sequence[Fields] = ()
        self._alarmed: set[int] = set()
        self._load()
        self.whereabouts.forget()
        self._creep.forget()
        self._parts = []
        for body in self._bodies:
            parts = body.participants.parts
            (name,) = parts.names
            about = parts.body, parts.models[name], len(parts.cells[name]), parts.n_nodes[name]
            self._parts.append((name, about))

    def _load(self) -> None:
        """Go on from what is each body's own."""
        self._ledgers = Ledgers([body.balance.ledger for body in self._bodies], self._bodies[0].balance.limits)
        self._told = np.zeros((2, len(self._bodies)), dtype=np.bool_)
        self._losses.state = np.concatenate([body.losses.state for body in self._bodies], axis=1)
        self._quantities.load()

    def store(self) -> None:
        """Have each body know what the steps did to it."""
        for body, ledger in zip(self._bodies, self._ledgers.states, strict=True):
            body.balance.ledger = ledger
        for body, state in zip(self._bodies, self._losses.state.T, strict=True):
            body.losses.state = state[:, None].copy()
        self._quantities.store()

    def save(self) -> Arrays:
        """What contacts between them came to in the last step."""
        met = {each.name: getattr(self._met, each.name).astype(np.float64) for each in fields(Meetings)}
        return {**met, "asleep": self._asleep, "swung": self._swung[self._asleep]}

    def check(self, saved: Mapping[str, Floats]) -> None:
        """Raise KeyError or ValueError where these are of other contacts."""
        met, m, asleep = [saved[each.name] for each in fields(Meetings)], len(self.pile.contacts), saved["asleep"]
        if len({len(each) for each in met}) != 1 or (len(met[0]) and not 0 <= met[0].max() < m):
            raise ValueError(f"it is of contacts that are none of {m}")
        if asleep.shape != self._asleep.shape:
            raise ValueError(f"it is of {len(asleep)} bodies")
        if saved["swung"].shape != (np.count_nonzero(asleep), *self._swung.shape[1:]):
            raise ValueError("it is of other tools")

    def load(self, saved: Mapping[str, Floats]) -> None:
        """Continue from `save`, after `begin`."""
        kinds = {each.name: getattr(no_meetings(), each.name).dtype for each in fields(Meetings)}
        self._meet(Meetings(*(saved[name].astype(kind) for name, kind in kinds.items())))
        self._asleep[:] = saved["asleep"] != 0.0
        self._swung[self._asleep] = saved["swung"]

    def _meet(self, met: Meetings) -> None:
        self._met, self.pressed = met, self._pressed(met)

    def _pressed(self, met: Meetings) -> Floats:
        """Force of the second body of each contact on the first (m, 3) [N]."""
        pressed = np.zeros((len(self.pile.contacts), 3))
        pressed[met.contact] = met.force
        return pressed

    def pressed_after(self, said: Meetings) -> Floats:
        """The same, if contacts do this in a step that is not taken yet (m, 3) [N]."""
        return self._pressed(self._both(self._met, said))

    # ---- one step

    def take(self, outcome: Outcome | None) -> None:
        """A step was taken: by those that are awake, as their participant says; None where all sleep."""
        asleep = self.pile.asleep.astype(np.bool_)
        self._before, self._awake = self._awake, np.flatnonzero(~asleep)
        reply = None if outcome is None else outcome.replies[self.pile.part]
        self._header = self._header if reply is None else reply.header
        self._seconds = 0.0 if reply is None else reply.seconds / max(1, len(self._awake))
        self._shown = () if reply is None or reply.fields is None else reply.fields.bodies
        said = None if reply is None else reply.members
        self._meet(self._both(self._met, None if said is None else said.meetings))
        if reply is not None and len(self._awake) == len(self._bodies):
            assert reply.members is not None
            self._step = reply.members
            self._asleep = asleep
            return
        step = replace(self._step, **{name: getattr(self._step, name).copy() for name in _ARRAYS}, notes=[])
        for name in _ARRAYS:
            array = getattr(step, name)
            if name in _STILL:
                array[asleep] = _STILL[name]
            if said is not None:
                array[self._awake] = getattr(said, name)
        fell, changed = asleep & ~self._asleep, bool((asleep != self._asleep).any())
        self._swung[fell], self._asleep = self._step.wrench[fell], asleep
        if changed:
            step.wrench[asleep] = self._stand_on_tools(np.flatnonzero(asleep))
        self._step = step if said is None else replace(step, notes=said.notes)

    def _stand_on_tools(self, asleep: NDArray[np.int64]) -> Floats:
        """What bodies that sleep, of these numbers (s,), exert on the tools (s, t, 6), as they stand."""
        swung, weights = self._swung[asleep], self._weights[asleep]
        size = float(np.linalg.norm(self._weights[0]))
        if size == 0.0:
            return swung
        up = -self._weights[0] / size
        by_tools, carried = -swung[:, :, :3] @ up, self.pressed @ up
        upwards = np.bincount(self.pile.pairs.ravel(), np.stack((carried, -carried), axis=1).ravel(), len(self._bodies))
        lacks = -weights @ up - by_tools.sum(axis=1) - upwards[asleep]
        own = np.full(len(self._bodies) + len(self.pile.guests), -1)
        own[asleep] = np.arange(len(asleep))
        pairs = own[self.pile.pairs]
        among, holds = (pairs >= 0).all(axis=1), np.maximum(by_tools, 0.0)
        more = passed_down(lacks, pairs[among], np.abs(carried[among]), holds.sum(axis=1))
        return with_more(swung, (more[:, None] * holds)[:, :, None] * -up)

    def _both(self, before: Meetings, said: Meetings | None) -> Meetings:
        """What contacts did: those of which both bodies sleep stand, and do no work; of others what is said."""
        still = replace(before, work=np.zeros_like(before.work))
        if said is None:
            return still
        sleepers = self.pile.sleepers
        if not sleepers.any():
            return said
        between = sleepers[self.pile.pairs[before.contact]]
        rests, names = between[:, 0] & between[:, 1], [each.name for each in fields(Meetings)]
        order = np.argsort(np.concatenate([before.contact[rests], said.contact]), kind="stable")
        return Meetings(*(np.concatenate([getattr(still, name)[rests], getattr(said, name)])[order] for name in names))

    def stand(self, name: str, reply: Advanced) -> None:
        """A body sleeps, as it stood when it fell asleep."""
        place, step = self.pile.place(name), self._step
        self._step = replace(step, **{each: getattr(step, each).copy() for each in _ARRAYS})
        other = {"low": reply.bounds[0], "high": reply.bounds[1], "interface_work": reply.coupling.work}
        for each in _ARRAYS:
            own = other[each] if each in other else getattr(reply, each, None)
            getattr(self._step, each)[place] = reply.figure(Figure(each)) if each in _FIGURES else own

    def outcome(self, name: str) -> Outcome:
        """What the step did to one body, as of a body by itself. Raises KeyError where the pile has no such body."""
        place, step = self.pile.place(name), self._step
        fields_of = self._shown[place] if len(self._shown) else None
        part, _ = self._parts[place]
        header = replace(self._header, part=part)
        reply = Advanced(
            header,
            Status.CONVERGED,
            step.wrench[place],
            step.kinetic.item(place),
            step.strain.item(place),
            step.gravity.item(place),
            step.tool_work.item(place),
            step.momentum[place],
            step.angular_momentum[place],
            np.stack((step.low[place], step.high[place])),
            self._seconds,
            np.zeros(0),
            Coupled(work=step.interface_work.item(place)),
            {name: float(getattr(step, name).item(place)) for name in _FIGURES},
            fields=fields_of,
        )
        for note in step.notes:
            if self._awake[note.body] == place:
                reply = replace(reply, alarms=note.alarms)
        return Outcome({part: reply}, _FREE, 0.0, 1, "")

    @property
    def step(self) -> Members:
        """What the last step did to all; to those asleep, the last that they took."""
        return self._step

    @property
    def wrench(self) -> Floats:
        """Of all bodies on the tools (t, 6) [N, N m]."""
        return np.asarray(self._step.wrench.sum(axis=0))

    @property
    def interfaces(self) -> dict[str, InterfaceReport]:
        """Of the last step, by contact between its bodies: of those that pressed, those asleep as it was when they fell
        asleep, and of those that the scene writes and that came near enough. What stands is reported by the same
        objects."""
        met, said, reports = self._met, self._said, self._contact_reports
        now = np.column_stack((met.depth, met.n_points, met.largest, met.work, met.force))
        left = np.zeros(len(said), dtype=np.bool_)
        left[self._reported] = True
        left[met.contact] = False
        other = (now != said[met.contact]).any(axis=1)
        for at in np.flatnonzero(left).tolist():
            reports.pop(self.pile.contact_names[at], None)
        said[left] = 0.0
        shown = other & (met.force.any(axis=1) | self._written[met.contact])
        for at in met.contact[other & ~shown].tolist():
            reports.pop(self.pile.contact_names[at], None)
        for at, (depth, n, most, work, *force) in zip(met.contact[shown].tolist(), now[shown].tolist(), strict=True):
            reports[self.pile.contact_names[at]] = InterfaceReport(depth, 0, int(n), most, work, *force)
        said[met.contact], self._reported = now, met.contact
        return dict(reports)

    def measure(
        self, position: Floats, orientation: Floats, frames: Mapping[str, Frame], lifting: bool
    ) -> dict[str, float]:
        """Quantities of all bodies, see `SimulatedBody.measure`."""
        if frames or not self._quantities.known:
            return self._measure_each(position, orientation, frames, lifting)
        return self._quantities.measure(self._step, position, orientation, lifting)

    def _measure_each(
        self, position: Floats, orientation: Floats, frames: Mapping[str, Frame], lifting: bool
    ) -> dict[str, float]:
        """The same with those that need a look at the fields."""
        self._quantities.store()
        found: dict[str, float] = {}
        for name, body, wrench in zip(self.pile.names, self._bodies, self._step.wrench, strict=True):
            replies = self.outcome(name).replies
            found |= body.measure(replies, wrench, position, orientation, frames.get(name), lifting)
        self._quantities.load()
        return found

    def book(self, step_number: int, command: Floats, dt: float) -> Entry:
        """Enter the step into the balances, with what the tools' motion (t, 6) [m/s, rad/s] over dt [s] put in, and
        report what begins in it."""
        step = self._step
        energies = np.stack((step.kinetic, step.strain, step.gravity), axis=1)
        drive_work = 0.0 - dt * np.einsum("btc,tc->b", step.wrench, command)
        work = step.tool_work + step.interface_work
        dissipation, alarms = self._ledgers.step(energies, work, drive_work - step.tool_work, step.dissipated)
        touches = np.asarray(step.wrench.any(axis=(1, 2)))
        losses = np.stack((step.kinetic, step.strain, dissipation, drive_work))
        for place, said in self._losses.follow(losses, touches).items():
            self._bodies[place].report("damped", f"step {step_number}: {said}")
        self._raised: dict[int, list[Alarm]] = {}
        for known, (alarm, raised) in zip(self._told, alarms.items(), strict=True):
            for place in np.flatnonzero(raised & ~known).tolist():
                self._raised.setdefault(place, []).append(alarm)
            known |= raised
        sums = energies.sum(axis=0).tolist()
        energy = {
            **dict(zip(("kinetic", "strain", "gravity"), sums, strict=True)),
            "tool_work": float(step.tool_work.sum()),
            "seam_work": 0.0,
            **({"interface_work": float(step.interface_work.sum())} if self.pile.contacts else {}),
            "dissipation": float(dissipation.sum()),
            "switch": 0.0,
            **({"material": float(step.dissipated.sum())} if self._inelastic else {}),
        }
        momentum, angular = step.momentum.sum(axis=0), step.angular_momentum.sum(axis=0)
        deepest = float(step.penetration.max(initial=0.0))
        return Entry(self._reports(energies), {}, energy, momentum, angular, deepest, float(drive_work.sum()))

    def _reports(self, energies: Floats) -> dict[str, PartReport]:
        """Of the part that each body would be by itself."""
        step, seconds = self._step, np.zeros(len(self._bodies))
        seconds[self._awake] = self._seconds
        new = np.arange(len(seconds)) if not self._part_reports else np.union1d(self._before, self._awake)
        arrays = energies, step.iterations, seconds, step.n_substeps
        rows = zip(new.tolist(), *(array[new].tolist() for array in arrays), strict=True)
        for place, own, *rest in rows:
            part, about = self._parts[place]
            self._part_reports[part] = PartReport(*about, *own, *rest)
        return dict(self._part_reports)

    def notify(self, step_number: int, estimates: Mapping[str, ErrorEstimate]) -> None:
        """Report what of the step is worth an event."""
        alarmed = {int(self._awake[note.body]) for note in self._step.notes if note.alarms}
        odd = alarmed | self._alarmed | self._raised.keys()
        for note in self._step.notes:
            if note.status is not Status.CONVERGED:
                place = int(self._awake[note.body])
                part, about = self._parts[place]
                self._bodies[place].report("solver", f"step {step_number}, {part} ({about[1]}): {note.why}")
        for place in range(len(self._bodies)) if estimates or step_number == 0 else sorted(odd):
            name, raised = self.pile.names[place], self._raised.get(place, ())
            if place in odd or name in estimates or step_number == 0:
                replies = self.outcome(name).replies
                self._bodies[place].warnings.follow(step_number, replies, raised, estimates.get(name))
        self._alarmed = alarmed

    def watch(self, step_number: int, position: Floats, orientation: Floats) -> None:
        """Report what became of the bodies by now, see `SimulatedBody.watch`."""
        step = self._step
        bounds, touches = np.stack((step.low, step.high), axis=1), step.n_contacts > 0
        self.whereabouts.look(step_number, bounds, touches, position, orientation)
        awake = self._awake  # no tool comes to be in one that sleeps
        idle = idle_inside(self._tools, bounds[awake], step.wrench[awake], position).any(axis=1)
        for place in awake[idle].tolist():
            self._bodies[place].look_inside(step_number, bounds[place], step.wrench[place], position, orientation)
        if (step_number + 1) % LOOK_EVERY == 0:
            seen = Seen(bounds, step.momentum, step.angular_momentum, touches)
            self._creep.look(step_number, seen, position, orientation)

    def _tell(self, place: int, kind: str, message: str) -> None:
        self._bodies[place].report(kind, message)
