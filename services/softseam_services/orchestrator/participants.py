"""The participants of one body, and what ties its parts: built for a cut, advanced until they agree, observed, saved.

A step that fails leaves them as they were. What one side took alone is discarded, and a step in parts goes back to a
snapshot; both when they are next asked for anything (docs/decisions/05).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies
from softseam_coupling.loops.loop import Correction, First, Outcome, PartRequest, StepDiverged
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import Detail, FailureKind, Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    BodyState,
    Bundle,
    Capabilities,
    Commit,
    Configure,
    Configured,
    Correct,
    Failure,
    Fields,
    Observe,
    PartMesh,
    Release,
    Reply,
    Request,
    Restore,
    Snapshot,
    SnapshotTaken,
    ToolMotion,
)
from softseam_protocol.models import facts_of
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.coupling import Coupling
from softseam_services.orchestrator.sides import Sides
from softseam_services.orchestrator.step_ahead import StepAhead, advance_request
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.subdivided_step import take_step
from softseam_services.orchestrator.transport import ParticipantFailed, Transport

Floats = NDArray[np.float64]
Tied = tuple[Sides, Coupling | None]
"""sides, and what ties them where they share nodes"""

_NOTHING = np.zeros(0)
_FREE = np.zeros((0, 3))
"""no forces: of a part that nothing ties"""
_OLDER = Failure(
    FailureKind.SCHEMA,
    "it does not tell the energies that it begins with: install the same version of softseam on both sides",
)


class StepFailed(RuntimeError):
    """A step could not be taken, nor is any part of it; the simulation stands at the last committed step and can be
    stepped again. Only what the seam learned in trying may be kept."""


@dataclass(frozen=True, slots=True)
class Kept:
    """What a step or a switch began with."""

    sides: Sides
    seam: dict[str, Floats]
    """see `Participants.seam_arrays`"""
    states: dict[str, bytes]
    """see `Participants.snapshot`"""


class Participants:
    """Those of the present cut of one body, an island: parts that are tied to no others.

    clock     of the simulation; cuts count its epochs
    tell      receives kind and text of every event
    tie       makes what ties sides of which nothing is known yet; None where they share no nodes
    mesh      makes the mesh of one of the sides; None where it has no cells
    """

    def __init__(
        self,
        bundle: Bundle,
        scene: Scene,
        transport: Transport,
        clock: Clock,
        tell: Tell,
        tie: Callable[[Sides], Coupling | None],
        mesh: Callable[[Sides, str], PartMesh | None],
    ) -> None:
        self._bundle, self._scene, self._transport = bundle, scene, transport
        self._clock, self._tell, self._tie, self._mesh = clock, tell, tie, mesh
        self._epoch = self._tick = 0
        self.sides: Sides
        """the present cut"""
        self._coupling: Coupling | None = None
        self._n_asked = self._asked = -1  # exchanges of the tick at hand, and of the one before
        self._under_way = False  # a step is, or was when it failed
        self._ahead: StepAhead | None = None
        self._kept: Kept | None = None  # while a step is taken in parts, and after it failed
        self._able: dict[str, Capabilities] = {}
        self._before: Kept | dict[str, Floats] | None = None  # the last step, where it may be withdrawn

    def configure(self, tied: Tied, state: BodyState | None) -> Energies:
        """Build the sides of another cut in a new epoch: in this state, or to be restored; its energies."""
        self._clock.epoch += 1
        self._epoch = self._clock.epoch
        self._n_asked, self._under_way = -1, False
        self._kept = self._ahead = None
        sides, self._coupling = tied
        self.sides = sides
        meshes = {name: self._mesh(sides, name) for name in sides.names}
        if self._coupling is not None and state is not None:
            self._coupling.turn.start(self._scene, meshes.values(), state, self._clock.dt)
        replies = self._transport.exchange(
            {
                name: Configure(
                    self._header(name),
                    self._bundle,
                    sides.models[name],
                    sides.cells[name],
                    sides.coupling_nodes,
                    state,
                    sides.owns_points(name),
                    sides.body,
                    meshes[name],
                )
                for name in sides.names
            }
        )
        begun = {name: reply for name, reply in replies.items() if isinstance(reply, Configured)}
        for name, reply in begun.items():
            if math.isnan(reply.kinetic + reply.strain + reply.gravity):
                raise ParticipantFailed(name, _OLDER)
        known = {name: reply.capabilities for name, reply in begun.items()}
        self._able = {name: able for name, able in known.items() if able is not None}
        if self._coupling is not None:
            self._coupling.loop.begin(self._able)
        return Energies(
            sum(reply.kinetic for reply in begun.values()),
            sum(reply.strain for reply in begun.values()),
            sum(reply.gravity for reply in begun.values()),
        )

    def stand(self, step: int) -> None:
        """Be about to take the step of this number; before `configure`."""
        self._tick = step

    def _header(self, part: str, exchange: int = 0) -> Header:
        """Names a request of the present cut."""
        return Header(SCHEMA_VERSION, self._clock.session, part, self._epoch, self._tick, exchange, self._clock.time)

    def _next_header(self, part: str) -> Header:
        """Names the first request of the step that follows the present one."""
        clock = self._clock
        return Header(SCHEMA_VERSION, clock.session, part, self._epoch, self._tick + 1, 0, (clock.step + 1) * clock.dt)

    # ---- one step

    @property
    def tied(self) -> bool:
        """Whether there is an interface between its parts."""
        return self._coupling is not None

    @property
    def is_ahead(self) -> bool:
        """Whether the next step has begun."""
        return self._ahead is not None

    def requests(self, motion: ToolMotion, fields: bool) -> dict[str, Request]:
        """What parts that nothing ties are asked for in a step; their replies go to `taken`."""
        self.make_ready()
        free = {name: PartRequest(_FREE) for name in self.sides.names}
        return self.asked(free, self._clock.dt, motion, fields)

    def taken(self, replies: Mapping[str, Reply]) -> Outcome:
        """Parts that nothing ties have answered `requests`. Raises StepFailed."""
        solution = Outcome(self.read(replies), _FREE, 0.0, 1, "")
        self._before = {}
        self.end_step()
        self._tell_cuts(solution)
        return solution

    # ---- one exchange of a step

    @property
    def able(self) -> Mapping[str, Capabilities]:
        """What its parts can do, of those that have coupling nodes."""
        return self._able

    def make_ready(self) -> None:
        """Be about to ask for a step from where the last one ended."""
        self._discard_failed()

    def asked(
        self, wanted: Mapping[str, PartRequest], dt: float, motion: ToolMotion, fields: bool, turn: Floats = _NOTHING
    ) -> dict[str, Request]:
        """What the next exchange of a step of dt [s] asks its parts for."""
        self._n_asked, self._under_way = self._n_asked + 1, True
        return {
            name: advance_request(self._header(name, self._n_asked), dt, motion, wanted[name], fields, turn)
            for name in self.sides.names
        }

    def corrected(self, corrections: Mapping[str, Correction], fields: bool) -> dict[str, Request]:
        """What moves its parts on, as a step ends."""
        self._n_asked += 1
        return {
            name: Correct(self._header(name, self._n_asked), one.push, one.force, fields, None)
            for name, one in corrections.items()
            if name in self.sides.cells
        }

    def read(self, replies: Mapping[str, Reply]) -> dict[str, Advanced]:
        """The answers of its parts. Raises StepFailed."""
        return self._advanced({name: replies[name] for name in self.sides.names})

    def end_step(self) -> None:
        """The last exchange was the step's."""
        self._asked = self._n_asked
        self._tick += 1
        self._n_asked, self._under_way = -1, False

    def joined_step(self, solution: Outcome, before: Kept | None) -> None:
        """A step that it took with other bodies is over; before: where it can only be withdrawn to a snapshot."""
        self._before = {} if before is None else before
        self._tell_cuts(solution)

    # ---- one step of tied parts

    def advance(self, motion: ToolMotion, fields: bool, alone: bool, then: ToolMotion | None = None) -> Outcome:
        """Advance tied parts by a step until they agree; where they will not, in parts of the step.

        fields  ask for the fields in the exchange that is likely to be the last
        alone   no other island may fail in this step, after which this one would be withdrawn
        then    motion of the next step, where that is certain to be taken: it begins in this one's last exchange
        """
        if self._ahead is None or self._ahead.motion is not motion:
            self._discard_failed()
        assert self._coupling is not None
        self._before = None if alone else {name: array.copy() for name, array in self._coupling.to_arrays().items()}
        try:
            solution = self._cut(motion, fields, then)
        except StepDiverged as error:
            raise StepFailed(f"step {self._clock.step}: {error}") from error
        if solution.note:
            gap = f"gap {1e6 * solution.gap:.3g} um after {solution.exchanges} exchanges is kept"
            self._tell("seam", f"step {self._clock.step}: {gap}: {solution.note}", Detail.GAP_KEPT)
        self._tell_cuts(solution)
        return solution

    def withdraw(self) -> None:
        """Take the step back that was taken last: it failed elsewhere."""
        before = self._before
        if isinstance(before, Kept):
            self.go_back(before)
            return
        assert before is not None
        self._tick -= 1
        self._n_asked, self._under_way = self._asked, True
        if self._coupling is not None:
            self._coupling.take(before)
            self._coupling.loop.begin(self._able)
            self._coupling.loop.forget_sent()

    def _tell_cuts(self, solution: Outcome) -> None:
        """Tell where a model could not take the step at once; PBD's monitor tells itself."""
        for name, reply in solution.replies.items():
            asked_for = self._scene.models.fem.step_error is not None
            if reply.n_substeps > solution.parts and facts_of(self.sides.models[name]).cuts_steps and not asked_for:
                taken = (
                    f"step {self._clock.step}, {name} ({self.sides.models[name]}): taken in {reply.n_substeps} parts"
                )
                self._tell("step", taken, count=reply.n_substeps)

    def _advance(
        self, motion: ToolMotion, dt: float, fields: bool, may_cut: bool = False, then: ToolMotion | None = None
    ) -> Outcome:
        assert self._coupling is not None
        turn, then = self._coupling.turn, then if self._coupling.turn.may_go_ahead(dt) else None
        said = turn.said

        def ask(wanted: dict[str, PartRequest]) -> dict[str, Advanced]:
            self._n_asked += 1
            if self._ahead is not None:
                ahead, self._ahead = self._ahead, None
                return self._advanced(ahead.replies | (self._transport.exchange(ahead.left) if ahead.left else {}))
            requests = {}
            for name, part in wanted.items():
                last = fields and part.last and self._n_asked > 0  # it may well be
                requests[name] = advance_request(self._header(name, self._n_asked), dt, motion, part, last, said)
            return self._advanced(self._transport.exchange(requests))

        def correct(corrections: dict[str, Correction], first: First) -> dict[str, Advanced]:
            self._n_asked += 1
            after: dict[str, Advance] = {}
            if then is not None:
                after = {
                    name: advance_request(self._next_header(name), dt, then, part) for name, part in first().items()
                }
            requests = {
                name: Correct(self._header(name, self._n_asked), one.push, one.force, fields, after.get(name))
                for name, one in corrections.items()
            }
            replies = self._advanced(self._transport.exchange(requests))
            if then is not None:
                self._ahead = StepAhead(then, after, {name: reply.then for name, reply in replies.items()})
            return replies

        self._under_way = True
        solution = self._coupling.loop.solve(ask, correct, dt, may_cut)
        gravity = np.array(self._scene.gravity)
        solution = replace(solution, replies=turn.end(solution.replies, self.sides.models, motion, dt, gravity))
        self.end_step()
        return solution

    def _cut(self, motion: ToolMotion, fields: bool, then: ToolMotion | None) -> Outcome:
        """Take the step whole, or in parts where it will not settle.

        Each part is committed by the next, so that where one fails the step can only be taken back to a snapshot.
        """
        assert self._coupling is not None
        pace = self._coupling.pace
        before = pace.parts

        def advance(part: ToolMotion, dt: float, may_cut: bool) -> Outcome:
            return self._advance(part, dt, fields, may_cut, then if pace.parts == 1 else None)

        def keep() -> None:
            self._kept = self.keep() if self._kept is None else self._kept

        solution = take_step(pace, motion, self._clock.dt, advance, keep)
        if self._kept is not None and self._before is not None:
            self._before = self._kept
        self._kept = None
        if solution.parts > 1 and (solution.note or pace.parts != before):
            taken = f"taken in {solution.parts} parts, {solution.exchanges} exchanges, gap {1e6 * solution.gap:.3g} um"
            text = f"step {self._clock.step}: {taken}{': ' if solution.note else ''}{solution.note}"
            self._tell("seam", text, Detail.PARTS, *([Detail.GAP_KEPT] if solution.note else []))
            solution = replace(solution, note="")
        return solution

    def keep(self) -> Kept:
        """The state between two steps, or before a step none of whose parts was committed."""
        states = self.snapshot()
        return Kept(self.sides, {name: array.copy() for name, array in self.seam_arrays().items()}, states)

    def go_back(self, kept: Kept) -> None:
        """Be as then, from when they are next asked for anything."""
        self.sides, self._kept = kept.sides, kept

    def _take_back(self) -> None:
        """Where a step failed in one of its parts, go back to before it; and again where that fails."""
        kept = self._kept
        if kept is None:
            return
        self._kept = None
        try:
            coupling = self._tie(kept.sides)
            if coupling is not None:
                coupling.take(kept.seam)
            self.restore((kept.sides, coupling), kept.states)
        except BaseException:
            self._kept = kept
            raise

    def _advanced(self, replies: Mapping[str, Reply]) -> dict[str, Advanced]:
        found = {}
        for name, reply in replies.items():
            assert isinstance(reply, Advanced)
            model = self.sides.models[name]
            if reply.status is not Status.CONVERGED:
                text = f"step {self._clock.step}, {name} ({model}): {reply.why}"
                if not math.isfinite(reply.kinetic):
                    raise StepFailed(text)
                self._tell("solver", text)
            found[name] = reply
        return found

    # ---- what they know

    def observe(self, indicators: bool = False, own: bool = False) -> dict[str, Fields]:
        """Each side's fields, with its errors where asked for; of them only what its own model errs. Velocities are
        those that the next step begins with."""
        self._discard_failed()
        requests = {name: Observe(self._header(name), indicators, own) for name in self.sides.names}
        replies = self._transport.exchange(requests)
        found = {name: reply for name, reply in replies.items() if isinstance(reply, Fields)}
        return found if self._coupling is None else self._coupling.turn.seen(found)

    def snapshot(self) -> dict[str, bytes]:
        """Each side's state, which the transport keeps to recover a participant with."""
        self._discard_failed()
        if self._coupling is not None:
            self._coupling.loop.forget_sent()
        replies = self._transport.exchange(
            {name: Snapshot(self._header(name, self._n_asked + 1)) for name in self.sides.names}
        )
        return {name: reply.state for name, reply in replies.items() if isinstance(reply, SnapshotTaken)}

    def _discard_failed(self) -> None:
        """Have a step that failed half way, or that was begun and is not wanted, taken back by those that took it."""
        self._take_back()
        if self._ahead is not None:
            self._ahead, self._n_asked, self._under_way = None, 0, True
        if self._under_way:
            self._transport.exchange({name: Commit(self._header(name, self._n_asked + 1)) for name in self.sides.names})
            self._under_way = False

    def multiplier(self) -> Floats:
        """The last committed one, on the near side (s, 3) [N]."""
        return np.zeros((len(self.sides.seam), 3)) if self._coupling is None else self._coupling.loop.multipliers()

    def seam_arrays(self) -> dict[str, Floats]:
        """What of the seam evolves, for a snapshot; empty where there is none."""
        return {} if self._coupling is None else self._coupling.to_arrays()

    def restore(self, tied: Tied, states: Mapping[str, bytes]) -> None:
        """Continue with another cut, tied as `seam_arrays` told of it, from its `snapshot`."""
        self.configure(tied, None)
        restores: dict[str, Request] = {name: Restore(self._header(name), states[name]) for name in self.sides.names}
        self._transport.exchange(restores)

    def release_all(self) -> None:
        """Let go of all."""
        self.release(self.sides.names)

    def release(self, names: Collection[str]) -> None:
        """Let go of participants that the present cut has not."""
        if names:
            self._transport.exchange({name: Release(self._header(name)) for name in sorted(names)})
