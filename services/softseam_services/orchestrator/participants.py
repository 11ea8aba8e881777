"""The parts of one body as an island: built for a cut, advanced until they agree, observed, saved.

A step that fails leaves them as they were. What one part took alone is discarded, and a step in parts goes back to a
snapshot; both when they are next asked for anything (docs/decisions/05).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies
from softseam_coupling.loops.loop import Correction, First, Outcome, PartRequest, StepDiverged
from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.outcomes import Detail, Figure
from softseam_protocol.messages.participant import ToolMotion
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.coupling import Coupling
from softseam_services.orchestrator.part_client import PartClient, StepFailed
from softseam_services.orchestrator.parts import Parts
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.subdivided_step import take_step
from softseam_services.orchestrator.transport import Transport

Floats = NDArray[np.float64]
Tied = tuple[Parts, Coupling | None]
"""parts, and what ties them where they share nodes"""

_NOTHING = np.zeros(0)
_FREE = np.zeros((0, 3))
"""no forces: of a part that nothing ties"""
_UNTIED = PartRequest(_FREE)


@dataclass(frozen=True, slots=True)
class Kept:
    """What a step or a switch began with."""

    parts: Parts
    seam: dict[str, Floats]
    """see `Participants.seam_arrays`"""
    states: dict[str, bytes]
    """see `Participants.snapshot`"""


@dataclass(frozen=True, slots=True)
class StepAhead:
    """A step that is begun with the correction of the one before, in the same messages, where it follows for certain.

    A correction ends a step, and says nothing that the loop does not know: the multipliers are found, and where parts
    are moved to is their linear answer. So what the parts are asked for first in the step that follows is known, too,
    and goes with it; over the bus that is one round of messages a step in place of two. Bits are those of steps begun
    one by one.
    """

    motion: ToolMotion
    asked: dict[str, messages.Advance]
    told: dict[str, messages.Advanced | None]
    """None of those who left it"""

    @property
    def replies(self) -> dict[str, messages.Reply]:
        """Of those who have begun it."""
        return {name: reply for name, reply in self.told.items() if reply is not None}

    @property
    def left(self) -> dict[str, messages.Request]:
        """What is still to be asked of the others."""
        return {name: self.asked[name] for name, reply in self.told.items() if reply is None}


class Participants:
    """Those of the present cut of one body, an island: parts that are tied to no others.

    clock     of the simulation; cuts count its epochs
    tell      receives kind and text of every event
    tie       makes what ties parts of which nothing is known yet; None where they share no nodes
    mesh      makes the mesh of one of the parts; None where it has no cells
    """

    def __init__(
        self,
        bundle: messages.Bundle,
        scene: Scene,
        transport: Transport,
        clock: Clock,
        tell: Tell,
        tie: Callable[[Parts], Coupling | None],
        mesh: Callable[[Parts, str], messages.PartMesh | None],
    ) -> None:
        self._client = PartClient(bundle, transport, clock, tell)
        self._scene, self._clock, self._tell, self._tie, self._mesh = scene, clock, tell, tie, mesh
        self.stand, self.end_step, self.release = self._client.stand, self._client.end_step, self._client.release
        self._coupling: Coupling | None = None
        self._ahead: StepAhead | None = None
        self._kept: Kept | None = None  # while a step is taken in parts, and after it failed
        self._before: Kept | dict[str, Floats] | None = None  # the last step, where it may be withdrawn

    @property
    def parts(self) -> Parts:
        """The present cut."""
        return self._client.parts

    def configure(self, tied: Tied, state: messages.BodyState | None) -> Energies:
        """Build the parts of another cut in a new epoch: in this state, or to be restored; its energies."""
        self._kept = self._ahead = None
        parts, self._coupling = tied
        meshes = {name: self._mesh(parts, name) for name in parts.names}
        if self._coupling is not None and state is not None:
            self._coupling.turn.start(meshes.values(), state, self._clock.dt)
        energies = self._client.build(parts, state, meshes)
        if self._coupling is not None:
            self._coupling.loop.begin(self._client.able)
        return energies

    # ---- one step

    @property
    def tied(self) -> bool:
        """Whether there is an interface between its parts."""
        return self._coupling is not None

    @property
    def is_ahead(self) -> bool:
        """Whether the next step has begun."""
        return self._ahead is not None

    def requests(self, motion: ToolMotion, fields: bool) -> dict[str, messages.Request]:
        """What parts that nothing ties are asked for in a step; their replies go to `taken`."""
        self.make_ready()
        free = dict.fromkeys(self.parts.names, _UNTIED)
        return self._client.advance(free, self._clock.dt, motion, fields)

    def taken(self, replies: Mapping[str, messages.Reply]) -> Outcome:
        """Parts that nothing ties have answered `requests`. Raises StepFailed."""
        solution = Outcome(self.read(replies), _FREE, 0.0, 1, "")
        self._before = {}
        self.end_step()
        self._tell_cuts(solution)
        return solution

    # ---- one exchange of a step

    @property
    def able(self) -> Mapping[str, messages.Capabilities]:
        """What its parts can do, of those that have coupling nodes."""
        return self._client.able

    def make_ready(self) -> None:
        """Be about to ask for a step from where the last one ended."""
        self._discard_failed()

    def asked(
        self,
        wanted: Mapping[str, PartRequest],
        dt: float,
        motion: ToolMotion,
        fields: bool,
        turn: Floats = _NOTHING,
    ) -> dict[str, messages.Request]:
        """What the next exchange of a step of dt [s] asks its parts for."""
        mine = {name: wanted[name] for name in self.parts.names}
        return self._client.advance(mine, dt, motion, fields, turn)

    def corrected(self, corrections: Mapping[str, Correction], fields: bool) -> dict[str, messages.Request]:
        """What moves its parts on, as a step ends."""
        return self._client.correct(corrections, fields, {})

    def read(self, replies: Mapping[str, messages.Reply]) -> dict[str, messages.Advanced]:
        """The answers of its parts. Raises StepFailed."""
        return self._client.read({name: replies[name] for name in self.parts.names})

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
        self._before = None if alone else self._coupling.to_arrays()
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
        self._client.reopen()
        if self._coupling is not None:
            self._coupling.take(before)
            self._coupling.loop.begin(self.able)
            self._coupling.loop.forget_sent()

    def _tell_cuts(self, solution: Outcome) -> None:
        """Say where a model could not take the step at once; PBD's monitor says it itself."""
        if self._scene.models.fem.step_error is not None:
            return  # that is asked for
        for name in self.parts.cut_steps:
            count = int(solution.replies[name].figure(Figure.SUBSTEPS))
            if count > solution.parts:
                taken = f"step {self._clock.step}, {name} ({self.parts.models[name]}): taken in {count} parts"
                self._tell("step", taken, count=count)

    def _advance(
        self,
        motion: ToolMotion,
        dt: float,
        fields: bool,
        may_cut: bool = False,
        then: ToolMotion | None = None,
    ) -> Outcome:
        assert self._coupling is not None
        client, turn, then = self._client, self._coupling.turn, then if self._coupling.turn.may_go_ahead(dt) else None
        said = turn.said

        def ask(wanted: dict[str, PartRequest]) -> dict[str, messages.Advanced]:
            if self._ahead is not None:
                ahead, self._ahead = self._ahead, None
                client.skip()
                return client.exchange(ahead.left, ahead.replies)
            again = not client.begins
            requests = client.advance(wanted, dt, motion, fields and again, said)
            return client.exchange(requests)

        def correct(corrections: dict[str, Correction], first: First) -> dict[str, messages.Advanced]:
            after = {} if then is None else client.advance_next(first(), dt, then)
            replies = client.exchange(client.correct(corrections, fields, after))
            if then is not None:
                self._ahead = StepAhead(then, after, {name: reply.then for name, reply in replies.items()})
            return replies

        solution = self._coupling.loop.solve(ask, correct, dt, may_cut)
        gravity = np.array(self._scene.gravity)
        solution = replace(solution, replies=turn.end(solution.replies, self.parts.models, motion, dt, gravity))
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
        return Kept(self.parts, self.seam_arrays(), states)

    def go_back(self, kept: Kept) -> None:
        """Be as then, from when they are next asked for anything."""
        self._client.parts, self._kept = kept.parts, kept

    def _take_back(self) -> None:
        """Where a step failed in one of its parts, go back to before it; and again where that fails."""
        kept = self._kept
        if kept is None:
            return
        self._kept = None
        try:
            coupling = self._tie(kept.parts)
            if coupling is not None:
                coupling.take(kept.seam)
            self.restore((kept.parts, coupling), kept.states)
        except BaseException:
            self._kept = kept
            raise

    # ---- what they know

    def observe(self, indicators: bool = False, own: bool = False) -> dict[str, messages.Fields]:
        """Each part's fields, with its errors where asked for; of them only what its own model errs. Velocities are
        those that the next step begins with."""
        self._discard_failed()
        found = self._client.observe(indicators, own)
        return found if self._coupling is None else self._coupling.turn.seen(found)

    def snapshot(self) -> dict[str, bytes]:
        """Each part's state, which the transport keeps to recover a participant with."""
        self._discard_failed()
        if self._coupling is not None:
            self._coupling.loop.forget_sent()
        return self._client.snapshot()

    def _discard_failed(self) -> None:
        """Have a step that failed half way, or that was begun and is not wanted, taken back by those that took it."""
        self._take_back()
        if self._ahead is not None:
            self._ahead = None
            self._client.began_ahead()
        self._client.give_up()

    def multiplier(self) -> Floats:
        """The last committed one, on the first part (s, 3) [N]."""
        return np.zeros((len(self.parts.seam), 3)) if self._coupling is None else self._coupling.loop.multipliers()

    def seam_arrays(self) -> dict[str, Floats]:
        """What of the seam evolves, in arrays that nobody writes to, for a snapshot; empty where there is none."""
        return {} if self._coupling is None else self._coupling.to_arrays()

    def restore(self, tied: Tied, states: Mapping[str, bytes]) -> None:
        """Continue with another cut, tied as `seam_arrays` says, from its `snapshot`."""
        self.configure(tied, None)
        self._client.restore(states)

    def release_all(self) -> None:
        """Let go of all."""
        self.release(self.parts.names)
