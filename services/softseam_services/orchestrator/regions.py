"""The regions of a body, each with its participant: cut, configured, advanced until the seam closes, cut anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies
from softseam_protocol.messages import (
    Advance,
    Advanced,
    BodyState,
    Bundle,
    Commit,
    Committed,
    Configure,
    Configured,
    Failure,
    Fields,
    Frame,
    Observe,
    Release,
    Reply,
    Request,
    Restore,
    Snapshot,
    SnapshotTaken,
    ToolMotion,
    Worked,
)
from softseam_services.body.body import Body
from softseam_services.body.interpolate import model_functions
from softseam_services.orchestrator.accounts import SWITCH_LIMIT, Accounts
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.first_multiplier import first_multiplier
from softseam_services.orchestrator.goal import Goal
from softseam_services.orchestrator.goal_error import GoalError, NoAdjoint
from softseam_services.orchestrator.goal_watch import GoalWatch
from softseam_services.orchestrator.indicators import measure
from softseam_services.orchestrator.near_cells import LOOK_EVERY, RETRY, NearCells
from softseam_services.orchestrator.parts import CutStep
from softseam_services.orchestrator.seam_answers import (
    SeamDiverged,
    SeamScheme,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
)
from softseam_services.orchestrator.seam_schemes import build_scheme, build_seam_solver
from softseam_services.orchestrator.sides import NEAR, Sides, cut, merged_state, whole_frame
from softseam_services.orchestrator.tie import tie_sides
from softseam_services.orchestrator.transport import ParticipantFailed, Transport
from softseam_services.orchestrator.undivided import Undivided
from softseam_services.server import Setup

Floats = NDArray[np.float64]

_FREE = np.zeros((0, 3))
"""no forces, no anchor, and no force at the start of a step"""
_KEPT = np.zeros((0, 0))
"""stands for the stiffness that the near side has"""


_OLDER = Failure(
    "schema", "it does not tell the energies that it begins with: install the same version of softseam on both sides"
)


class StepFailed(RuntimeError):
    """A step could not be taken, nor is any part of it; the simulation stands at the last committed step and can be
    stepped again. Only what the seam learned in trying may be kept."""


@dataclass(frozen=True, slots=True)
class _Kept:
    """What a step began with."""

    seam: dict[str, Floats]
    """see `Regions.seam_arrays`"""
    states: dict[str, bytes]
    """see `Regions.snapshot`"""


class Regions:
    """The cut of one body, its participants, and the seam between them.

    clock     of the simulation; cuts count its epochs, advances its ticks
    accounts  are told where the time goes
    tell      receives kind and text of every event
    """

    def __init__(
        self,
        bundle: Bundle,
        setup: Setup,
        transport: Transport,
        clock: Clock,
        accounts: Accounts,
        tell: Callable[[str, str], None],
    ) -> None:
        self._scene, self._body, self._bundle = setup.scene, setup.body, bundle
        self._transport, self._clock, self._accounts, self._tell = transport, clock, accounts, tell
        seam = self._scene.seam
        self._solver = build_seam_solver(seam.acceleration, seam.tolerance * self._body.resolution)
        self._loop: SeamScheme | None = None
        self._n_asked = -1  # exchanges of the tick at hand
        self._under_way = False  # a step is, or was when it failed
        self._settle: dict[str, Floats] = {}  # forces that the last step is to be settled by, not sent yet
        self._kept: _Kept | None = None  # while a step is taken in parts, and after it failed
        body = self._body
        self.near = NearCells(self._scene, body, setup.tools) if isinstance(body, Body) else Undivided()
        self._goal = self._watch = None
        if isinstance(body, Body) and self._scene.regions.goal is not None:
            self._goal, self._watch = Goal(self._scene, body, setup.tools), GoalWatch(body)
        self.sides: Sides
        """the present cut"""

    # ---- one step

    def advance(self, motion: ToolMotion, fields: bool) -> SeamSolution:
        """Advance all sides by a step until they agree at the seam; where they will not, in parts of the step.

        fields  ask for the sides' fields in the exchange that is likely to be the last
        """
        self._take_back()
        try:
            solution = (
                self._advance(motion, self._clock.dt, fields) if self._loop is None else self._cut(motion, fields)
            )
        except SeamDiverged as error:
            raise StepFailed(f"step {self._clock.step}: {error}") from error
        if solution.note:
            gap = f"gap {1e6 * solution.gap:.3g} um after {solution.exchanges} exchanges is kept"
            self._tell("seam", f"step {self._clock.step}: {gap}: {solution.note}")
        self._tell_cuts(solution)
        return solution

    def _tell_cuts(self, solution: SeamSolution) -> None:
        """Tell where FEM could not take the step at once; PBD's monitor tells itself."""
        for name, reply in solution.replies.items():
            asked_for = self._scene.models.fem.step_error is not None
            if reply.n_substeps > solution.parts and self.sides.models[name] == "fem" and not asked_for:
                self._tell("step", f"step {self._clock.step}, {name} (fem): taken in {reply.n_substeps} parts")

    def _advance(self, motion: ToolMotion, dt: float, fields: bool, may_cut: bool = False) -> SeamSolution:
        def ask(wanted: dict[str, SideRequest]) -> dict[str, Advanced]:
            self._n_asked += 1
            requests: dict[str, Request] = {}
            for name, side in wanted.items():
                header = self._clock.request(name, self._n_asked)
                last = fields and side.fields and (self._n_asked > 0 or self._loop is None)  # it may well be
                anchor = _FREE if side.anchor is None else side.anchor
                stiffness = _KEPT if side.stiffness is None else side.stiffness
                start = _FREE if side.start is None else side.start
                settle = self._settle.get(name, _FREE)
                requests[name] = Advance(
                    header, dt, side.force, motion, side.compliance, anchor, stiffness, last, start, settle
                )
            replies = self._exchange(requests)
            for name in wanted:
                self._settle.pop(name, None)
            return self._advanced(replies)

        self._under_way = True
        if self._loop is None:
            solution = SeamSolution(ask({name: SideRequest(_FREE) for name in self.sides.names}), _FREE, 0.0, 1, "")
        else:
            solution = self._loop.solve(ask, dt, may_cut)
        self._settle = dict(solution.settle)
        self._clock.tick += 1
        self._n_asked, self._under_way = -1, False
        return solution

    def _cut(self, motion: ToolMotion, fields: bool) -> SeamSolution:
        """Take the step whole, or in parts where it will not settle.

        Each part is committed by the next, so that where one fails the step can only be taken back to a snapshot.
        """
        assert self._loop is not None
        pace, step = self._loop.pace, CutStep(motion, self._clock.dt)
        before = pace.parts
        if before > 1:
            self._keep()
        pace.begin()
        while not step.done:
            parts = pace.parts
            part, dt, may_cut = step.next(parts)
            try:
                step.taken(parts, self._advance(part, dt, fields, may_cut))
            except SeamUnsettled:
                pace.cut()
                if self._kept is None:
                    self._keep()
        pace.end()
        self._kept = None
        solution = step.solution()
        if step.n_parts > 1 and (solution.note or pace.parts != before):
            taken = f"taken in {step.n_parts} parts, {solution.exchanges} exchanges, gap {1e6 * solution.gap:.3g} um"
            self._tell("seam", f"step {self._clock.step}: {taken}{': ' if solution.note else ''}{solution.note}")
            solution = replace(solution, note="")
        return solution

    def _keep(self) -> None:
        """Keep the state before a step, none of whose parts was committed."""
        states = self.snapshot()
        self._kept = _Kept({name: array.copy() for name, array in self.seam_arrays().items()}, states)

    def _take_back(self) -> None:
        """Where a step failed in one of its parts, go back to before it; and again where that fails."""
        kept = self._kept
        if kept is None:
            return
        self._kept = None
        try:
            loop = self._scheme(self.sides)
            if loop is not None:
                loop.take(kept.seam)
            self.restore((self.sides, loop), kept.states)
        except BaseException:
            self._kept = kept
            raise

    def _advanced(self, replies: Mapping[str, Reply]) -> dict[str, Advanced]:
        found = {}
        for name, reply in replies.items():
            assert isinstance(reply, Advanced)
            model = self.sides.models[name]
            if reply.status != "converged":
                text = f"step {self._clock.step}, {name} ({model}): {reply.status}"
                if not math.isfinite(reply.kinetic):
                    raise StepFailed(text)
                self._tell("solver", text)
            found[name] = reply
        return found

    # ---- cuts

    def start(self, state: BodyState) -> Energies:
        """Cut the body as the scene asks for at the start, its state then; the energies that it begins with."""
        self._kept = None
        self.near.reset()
        if self._watch is not None:
            self._watch.reset()
        return self._configure(*self._tied(state), state)

    def follow(self, replies: Mapping[str, Advanced], motion: ToolMotion) -> Energies | None:
        """Let the cut follow the scene's rule after a step; the energies after a switch, None where none was made.

        A switch that would change the energy by more than its share is taken back, bit for bit, and tried again later.
        """
        looks, errors = self.near.looks_for
        turn = self._clock.step % LOOK_EVERY == 0
        seen = self.observe(errors) if looks and turn else None
        reason = self.near.follow(self.sides, replies, seen, self._blame(replies, motion, seen) if turn else None)
        if not reason:
            return None
        seam, states = self.seam_arrays(), self.snapshot()
        done = self.switch()
        change = done.total - sum(reply.kinetic + reply.strain + reply.gravity for reply in replies.values())
        share = self._accounts.share_of_switch(change)
        cost = f"{reason}; energy {change:+.2g} J, {100.0 * share:.2g} %"
        if share <= SWITCH_LIMIT:
            self._tell("regions", cost)
            return done
        tried = set(self.sides.names)
        self.near.refused()
        self.restore(self.tied(seam), states)
        self._release(tried - set(self.sides.names))
        self._tell("refused", f"{cost} is too much for a switch; it is tried again in {RETRY} steps")
        return None

    def _blame(
        self, replies: Mapping[str, Advanced], motion: ToolMotion, seen: Mapping[str, Fields] | None
    ) -> Floats | None:
        """What the goal blames each cell for (C,); None where no rule asks. seen: fields of the step, where observed"""
        if self._watch is None or not self.near.looks_for_goal:
            return None
        strain = sum(reply.strain for reply in replies.values())
        poses = motion.position_next, motion.orientation_next
        goal = self._goal
        assert goal is not None
        return self._watch.follow(
            self._clock.step, strain, lambda: goal.look(self.sides, seen or self.observe(), *poses, blame=True)
        )

    def goal_error(self, fields: Mapping[str, Fields], position: Floats, orientation: Floats) -> GoalError | None:
        """What the scene's goal is off by, of these fields, between tools at (t, 3), (t, 4); None where it has none, or
        nothing can be said of it."""
        if self._goal is None:
            return None
        try:
            return self._goal.look(self.sides, fields, position, orientation)
        except NoAdjoint:
            return None

    def near_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What of the cells evolves, for a snapshot."""
        return self.near.to_arrays() | ({} if self._watch is None else self._watch.to_arrays())

    def take_near(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue with `near_arrays`. Raises KeyError or ValueError where these are others."""
        if self._watch is not None:
            self._watch.take(arrays)
        self.near.take(arrays)

    def switch(self) -> Energies:
        """Cut the body anew; its energies from now on."""
        old, fields, body = self.sides, self.observe(), self._body
        assert isinstance(body, Body)  # others are not divided
        state = merged_state(body, old, fields)
        cauchy = np.empty((body.n_cells, 8, 6))
        for name, side in fields.items():
            cauchy[old.cells[name]] = side.cauchy
        energies = self._configure(*self._tied(state, cauchy), state)
        self._release(set(old.names) - set(self.sides.names))
        return energies

    def _tied(self, state: BodyState | None = None, cauchy: Floats | None = None) -> tuple[Sides, SeamScheme | None]:
        """The sides of the present near cells, and what ties them where they share nodes.

        state, cauchy (C, 8, 6)  as the body stands: of both the first multiplier is made
        """
        sides = cut(self._body, self.near.mask, self.near.model, self._scene.regions.default)
        return sides, self._scheme(sides, state, cauchy)

    def _scheme(self, sides: Sides, state: BodyState | None = None, cauchy: Floats | None = None) -> SeamScheme | None:
        """What ties these sides; None where they share no nodes."""
        scene, body = self._scene, self._body
        if not len(sides.seam):
            return None
        assert isinstance(body, Body)  # others are not divided
        functions = model_functions(scene.models)
        tie = tie_sides(body, sides, self.near.neighbours, functions)
        first = None
        if state is not None and cauchy is not None:
            first = first_multiplier(body, sides, state, cauchy, tie, functions)
        begun = None if state is None else (state.x[sides.seam], self._clock.dt * state.v[sides.seam])
        return build_scheme(scene.seam, self._solver, body, sides, tie, first, begun)

    def _configure(self, sides: Sides, loop: SeamScheme | None, state: BodyState | None) -> Energies:
        """Build both sides in a new epoch; the energies that they begin with."""
        self._clock.epoch += 1
        self._n_asked, self._under_way = -1, False
        self._settle = {}
        self.sides, self._loop = sides, loop
        replies = self._exchange(
            {
                name: Configure(
                    self._clock.request(name),
                    self._bundle,
                    sides.models[name],
                    sides.cells[name],
                    sides.seam,
                    state,
                    name == NEAR,
                )
                for name in sides.names
            }
        )
        begun = {name: reply for name, reply in replies.items() if isinstance(reply, Configured)}
        for name, reply in begun.items():
            if math.isnan(reply.kinetic + reply.strain + reply.gravity):
                raise ParticipantFailed(name, _OLDER)
        return Energies(
            sum(reply.kinetic for reply in begun.values()),
            sum(reply.strain for reply in begun.values()),
            sum(reply.gravity for reply in begun.values()),
        )

    def close(self) -> None:
        """Release the participants and the transport."""
        self._release(self.sides.names)
        self._transport.close()

    def _release(self, names: Sequence[str] | set[str]) -> None:
        if names:
            self._exchange({name: Release(self._clock.request(name)) for name in sorted(names)})

    # ---- what the participants know

    def frame(
        self, replies: Mapping[str, Advanced], position: Floats, orientation: Floats, indicators: bool = False
    ) -> Frame:
        """The whole body as it stands, with tools at (t, 3), (t, 4); fields that the last replies brought are used.

        indicators  with the body's error indicators
        """
        fields = {name: reply.fields for name, reply in replies.items() if reply.fields is not None}
        if indicators or fields.keys() != self.sides.cells.keys():
            fields = self.observe(indicators)
        sides = self.sides
        multiplier = np.zeros((len(sides.seam), 3)) if self._loop is None else self._loop.multiplier()
        header = self._clock.last_step()
        frame = whole_frame(header, self._body, sides, fields, self.near.mask, multiplier, position, orientation)
        if not indicators:
            return frame
        assert isinstance(self._body, Body)  # others have none
        return replace(frame, indicators=measure(self._body, sides, self.near.neighbours, fields))

    def observe(self, indicators: bool = False, own: bool = False) -> dict[str, Fields]:
        """Each side's fields, with its errors where asked for; of them only what its own model errs."""
        settled = self._settle_now(not indicators)
        if settled.keys() == self.sides.cells.keys():  # not where one had settled before, asked for no fields
            return settled
        requests = {name: Observe(self._clock.request(name), indicators, own) for name in self.sides.names}
        replies = self._exchange(requests)
        return {name: reply for name, reply in replies.items() if isinstance(reply, Fields)}

    def snapshot(self) -> dict[str, bytes]:
        """Each side's state, which the transport keeps to recover a participant with."""
        self._settle_now(False)
        if self._loop is not None:
            self._loop.forget_told()
        replies = self._exchange(
            {name: Snapshot(self._clock.request(name, self._n_asked + 1)) for name in self.sides.names}
        )
        return {name: reply.state for name, reply in replies.items() if isinstance(reply, SnapshotTaken)}

    def _settle_now(self, fields: bool) -> dict[str, Fields]:
        """Have the last step settled and committed, where that waits for the next; each side's fields if asked for.

        And one that failed half way taken back, by another exchange of its tick than settled the step before it: what
        has the header of a request that was answered is taken for that request.
        """
        self._take_back()
        if not (self._settle or self._under_way):
            return {}
        replies = self._exchange(
            {
                name: Commit(self._clock.request(name, self._n_asked + 1), self._settle.get(name, _FREE), fields)
                for name in self.sides.names
            }
        )
        self._settle, self._under_way = {}, False
        found = {name: reply.fields for name, reply in replies.items() if isinstance(reply, Committed)}
        return {name: seen for name, seen in found.items() if seen is not None}

    def seam_arrays(self) -> dict[str, Floats]:
        """What of the seam evolves, for a snapshot; empty where there is none."""
        return {} if self._loop is None else self._loop.to_arrays()

    def tied(self, seam: dict[str, Floats]) -> tuple[Sides, SeamScheme | None]:
        """The near cells as they are, tied as `seam_arrays` tells. Raises KeyError or ValueError where it cannot."""
        sides, loop = self._tied()
        if loop is not None:
            loop.take(seam)
        return sides, loop

    def restore(self, tied: tuple[Sides, SeamScheme | None], states: Mapping[str, bytes]) -> None:
        """Continue with what `tied` made and from `snapshot`."""
        self._kept = None
        self._configure(*tied, None)
        restores: dict[str, Request] = {
            name: Restore(self._clock.request(name), states[name]) for name in self.sides.names
        }
        self._exchange(restores)

    def _exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        began = perf_counter()
        replies = self._transport.exchange(requests)
        wall = perf_counter() - began
        work = {name: reply.seconds for name, reply in replies.items() if isinstance(reply, Worked)}
        self._accounts.exchanged(wall, work.values())
        for name, seconds in work.items():
            self._accounts.spent(self.sides.models[name], seconds)
        return replies
