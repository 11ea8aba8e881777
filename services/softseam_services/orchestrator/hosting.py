"""A pile and its guests, the bodies of other models that touch it: an island, whose contact the pile solves."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.hosted import Hosted
from softseam_coupling.loops.loop import Correction, Outcome, PartRequest, StepDiverged, ask_compliance_of
from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.messages.participant import Advanced, Reply, Request, ToolMotion
from softseam_protocol.messages.pile import Guest, Push
from softseam_protocol.messages.session import InterfaceReport
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.archive import named, under
from softseam_services.orchestrator.body_turn import BodyTurn, keeps_momentum
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.parts import part_mesh, resting_state, side_mass
from softseam_services.orchestrator.pile import Pile
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.transport import Transport

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Arrays = dict[str, Floats]
Again = Callable[[ToolMotion, Mapping[str, Outcome]], Collection[str]]
"""wakes whoever has a reason in what a step came to, by parts, and says which parts are to take it anew"""

_NO_ROWS = np.zeros((0, 3))


class Hosting:
    """A pile with guests.

    scene   with all bodies
    pile    that meets them
    guests  by name, in the pile's order
    joints  nodes of each that others touch, ascending (j,)
    report  receives kind and text of every event
    again   says whether the pile is to take a step anew, for some of its bodies or guests woke in it
    """

    def __init__(
        self,
        scene: Scene,
        pile: Pile,
        guests: Mapping[str, SimulatedBody],
        joints: Mapping[str, Ints],
        transport: Transport,
        clock: Clock,
        report: Tell,
        again: Again,
    ) -> None:
        self.name = "+".join(guests)
        self.pile, self.members = pile, {name: body.participants for name, body in guests.items()}
        """that meets them, and who holds each guest"""
        self._scene, self._transport, self._clock, self._report = scene, transport, clock, report
        self._keeps = {name: keeps_momentum(body.setup.spec, body.scene.models) for name, body in guests.items()}
        self._bodies = {name: cast(Body, body.body) for name, body in guests.items()}
        self._joints, self._again = joints, again
        self._took: list[str] = []  # guests that took the last step
        self.reports: dict[str, InterfaceReport] = {}
        """none of its own: the pile reports of contact"""
        self._before: Arrays | None = None

    def begin(self) -> None:
        """The bodies stand at the start of the scene."""
        self._turns = {name: BodyTurn(keeps) for name, keeps in self._keeps.items()}
        for name, turn in self._turns.items():
            body, parts = self._bodies[name], self.members[name].parts
            turn.start([part_mesh(body, parts, part) for part in parts.names], resting_state(body), self._clock.dt)
        self._tie()

    def _tie(self) -> None:
        able = {part: able for member in self.members.values() for part, able in member.able.items()}
        ask_compliance_of(map(self._part, self.members), able)
        cell = min(body.resolution for body in self._bodies.values())
        mobility = {
            self._part(name): 1.0 / side_mass(body, np.arange(body.n_cells, dtype=np.int32))[self._joints[name]]
            for name, body in self._bodies.items()
        }
        x = {self._part(name): body.x_rest[self._joints[name]] for name, body in self._bodies.items()}
        seam = self._scene.seam
        self._loop = Hosted(x, mobility, seam.tolerance * cell, cell, seam.exchanges)

    def _part(self, body: str) -> str:
        (part,) = self.members[body].parts.names
        return part

    @property
    def _awake(self) -> list[str]:
        """Names of the guests that do not sleep."""
        return [name for name, away in zip(self.members, self.pile.away.tolist(), strict=True) if not away]

    # ---- one step

    def rests(self, asleep: Collection[str]) -> bool:
        """Whether neither the pile nor a guest is to take the next step; asleep: names of those that are in no pile and
        sleep."""
        return bool(self.pile.asleep.all()) and self.members.keys() <= set(asleep)

    def advance(self, motion: ToolMotion, fields: bool, alone: bool) -> dict[str, Outcome]:
        """Advance all by a step: guests by their names, the pile by its part's. Raises StepFailed.

        alone  no other island may fail in this step, after which this one would be withdrawn
        """
        for member in self.members.values():
            member.make_ready()
        self.pile.make_ready()
        began = self._arrays()
        self._before = None if alone else began
        try:
            return self._advance(motion, fields)
        except BaseException as error:
            self._take(began)
            if isinstance(error, StepDiverged):
                raise StepFailed(f"step {self._clock.step}: {error}") from error
            raise

    def _advance(self, motion: ToolMotion, fields: bool) -> dict[str, Outcome]:
        dt, turns = self._clock.dt, {name: turn.said for name, turn in self._turns.items()}
        answered: dict[str, Reply] = {}

        def ask(wanted: dict[str, PartRequest]) -> dict[str, Advanced]:
            requests: dict[str, Request] = {}
            for name in self._awake:
                requests |= self.members[name].asked(wanted, dt, motion, False, turns[name])
            return self._read(requests)

        def ask_pile(guests: list[Guest]) -> list[Push]:
            awake, part = self._awake, self.pile.part
            while True:
                answered.update(self._transport.exchange(self.pile.asked(motion, fields, guests)))
                outcome = Outcome({part: cast(Advanced, answered[part])}, _NO_ROWS, 0.0, 1)
                if part not in self._again(motion, {part: outcome}):
                    return self.pile.on_guests(answered)
                if self._awake != awake:
                    return []

        def correct(corrections: dict[str, Correction]) -> dict[str, Advanced]:
            requests: dict[str, Request] = {}
            for name in self._awake:
                requests |= self.members[name].corrected(corrections, fields)
            return self._read(requests)

        before = dict(self._loop.x)
        solution = self._loop.solve(ask, ask_pile, correct, lambda: list(map(self._part, self._awake)), dt)
        replies, gravity = dict(solution.replies), np.array(self._scene.gravity)
        pushes, self._took = dict(zip(self.members, self.pile.on_guests(answered), strict=True)), self._awake
        for name in self._took:
            member, push, part, turn = self.members[name], pushes[name], self._part(name), self._turns[name]
            joint = {part: (before[part], self._loop.x[part], self._loop.force[part])}
            moment = push.moment if len(push.moment) and push.force is self._loop.force[part] else None
            replies |= turn.end({part: replies[part]}, member.parts.models, motion, dt, gravity, joint, moment)
            if longest := turn.longest_step(joint, dt):
                raise StepDiverged(
                    f"{name} fell over: what squeezes it keeps its direction over a step. Take steps of "
                    f"{1e3 * longest:.2g} ms or shorter, or give it to pbd"
                )
        solutions = {self.pile.part: self.pile.taken(answered)}
        for name in self._took:
            self.members[name].end_step()
            own = replace(solution, replies={self._part(name): replies[self._part(name)]}, note="")
            self.members[name].joined_step(own, None)
            solutions[name] = own
        if solution.note:
            gap = f"{1e6 * solution.gap:.3g} um"
            text = f"forces between guests and pile miss by {gap} after {solution.exchanges} exchanges"
            self._report("seam", f"step {self._clock.step}, {self.name}: {text}", Detail.GAP_KEPT)
        return solutions

    def _read(self, requests: dict[str, Request]) -> dict[str, Advanced]:
        replies = self._transport.exchange(requests) if requests else {}
        return {part: reply for name in self._awake for part, reply in self.members[name].read(replies).items()}

    def rest(self) -> None:
        """The bodies sleep from now on."""

    def withdraw(self) -> None:
        """Take the step back that was taken last: it failed elsewhere."""
        assert self._before is not None
        for name in self._took:
            self.members[name].withdraw()
        self.pile.withdraw()
        self._take(self._before)

    # ---- snapshots

    def forget_sent(self) -> None:
        """The parts took a snapshot."""
        self._loop.forget_sent()

    def save(self) -> Arrays:
        """Everything that evolves, after the bodies have saved themselves."""
        self._loop.forget_sent()
        return self._arrays()

    def check(self, arrays: Mapping[str, Floats]) -> None:
        """Raise KeyError or ValueError where a state is not this island's; changes nothing."""
        for name in self._turns:
            BodyTurn().take(arrays[f"turn.{name}"])
        kept = self._loop.to_arrays()
        self._loop.take(named(arrays, "loop."))
        self._loop.take(kept)

    def load(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `save`, after the bodies. Raises KeyError or ValueError where it is of others."""
        self._tie()
        self._take(arrays)

    def _arrays(self) -> Arrays:
        """All that evolves, in arrays that nobody writes to."""
        turns = {f"turn.{name}": turn.to_array() for name, turn in self._turns.items()}
        return under("loop.", self._loop.to_arrays()) | turns

    def _take(self, arrays: Mapping[str, Floats]) -> None:
        for name, turn in self._turns.items():
            turn.take(arrays[f"turn.{name}"])
        self._loop.take(named(arrays, "loop."))
