"""The regions of a body: which cells are near, and the cuts that follow them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies
from softseam_protocol.messages.participant import Advanced, BodyState, Bundle, Fields, ToolMotion
from softseam_protocol.messages.session import Frame
from softseam_services.body.hardly_filled import HardlyFilled
from softseam_services.body.interpolate import model_functions
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.coupling import Coupling, couple
from softseam_services.orchestrator.cuts import LOOK_EVERY, RETRY, NearCells, NoCells
from softseam_services.orchestrator.energy_balance import SWITCH_LIMIT, EnergyBalance
from softseam_services.orchestrator.error_estimate import GoalError, NoAdjoint
from softseam_services.orchestrator.first_multiplier import first_multiplier
from softseam_services.orchestrator.goal import Goal, GoalWatch
from softseam_services.orchestrator.indicators import measure
from softseam_services.orchestrator.participants import Kept, Participants, Tied
from softseam_services.orchestrator.parts import Parts, merged_state, part_mesh, whole_frame
from softseam_services.orchestrator.seam_faces import tie_parts
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.transport import Transport
from softseam_services.server import Setup

Floats = NDArray[np.float64]


class Regions:
    """The cut of one body, and the rule that it follows.

    name      of the body
    clock     of the simulation
    balance  tell what share of the energy a switch changes
    tell      receives kind and text of every event
    joints    nodes on which interfaces to other bodies act (j,)
    """

    def __init__(
        self,
        name: str,
        bundle: Bundle,
        setup: Setup,
        transport: Transport,
        clock: Clock,
        balance: EnergyBalance,
        tell: Tell,
        joints: NDArray[np.int32] | None = None,
    ) -> None:
        self._joints = np.zeros(0, dtype=np.int32) if joints is None else joints
        self._name, self._setup, self._scene, self._body = name, setup, setup.scene, setup.body
        self._clock, self._balance, self._tell = clock, balance, tell
        body = self._body
        self.rule = NearCells(self._scene, body, setup.tools) if body.has_cells else NoCells(self._scene)
        self._hardly_filled = HardlyFilled(body) if body.has_cells else None
        self._goal = self._watch = None
        if body.has_cells and self._scene.regions.goal is not None:
            self._goal, self._watch = Goal(self._scene, body, setup.tools), GoalWatch(body)
        self.participants = Participants(
            bundle, setup.scene, transport, clock, tell, self._couple, partial(part_mesh, body)
        )
        """that the regions are with"""

    @property
    def parts(self) -> Parts:
        """The present cut."""
        return self.participants.parts

    def start(self, state: BodyState) -> Energies:
        """Cut the body as the scene asks for at the start, its state then; the energies that it begins with."""
        self.rule.reset()
        if self._watch is not None:
            self._watch.reset()
        return self.participants.configure(self._tied(state), state)

    def state(self) -> BodyState:
        """The whole body, which is in cells, as it stands."""
        assert self._body.has_cells
        return merged_state(self._body, self.parts, self.participants.observe())

    def follow(self, replies: Mapping[str, Advanced], motion: ToolMotion) -> Energies | None:
        """Let the cut follow the scene's rule after a step; the energies after a switch, None where none was made.

        A switch that would change the energy by more than its share is taken back, bit for bit, and tried again later.
        """
        if self._clock.step == 1 and (why := self._setup.why or self.rule.enough):
            self._tell("regions", why)
        looks, errors = self.rule.looks_for
        turn = _is_turn(self._clock.step)
        seen = self.participants.observe(errors) if looks and turn else None
        reason = self.rule.follow(self.parts, replies, seen, self._blame(replies, motion, seen) if turn else None)
        if not reason:
            return None
        try:
            kept = self.participants.keep()
            done = self._switch(kept)
        except BaseException:
            self.rule.refused()
            raise
        change = done.total - sum(reply.kinetic + reply.strain + reply.gravity for reply in replies.values())
        share = self._balance.share_of_switch(change)
        cost = f"{reason}; energy {change:+.2g} J, {100.0 * share:.2g} %"
        if share <= SWITCH_LIMIT:
            self._tell("regions", cost)
            return done
        tried = set(self.parts.names)
        self.rule.refused()
        try:
            self.participants.restore(self.tied(kept.seam), kept.states)
        except BaseException:
            self.participants.go_back(kept)
            raise
        self.participants.release(tried - set(self.parts.names))
        self._tell("refused", f"{cost} is too much for a switch; it is tried again in {RETRY} steps")
        return None

    def tell_unmet(self) -> None:
        """Tell, as a run ends, of cells that the rule asked for and never got."""
        unmet = self.rule.unmet
        if unmet.n_never:
            self._tell("not_done", unmet.said(self.rule.model, SWITCH_LIMIT), count=unmet.n_never)

    def looks_after(self, step: int) -> bool:
        """Whether `follow` looks at the fields once so many steps were taken."""
        return _is_turn(step) and (self.rule.looks_for[0] or self.rule.looks_for_goal)

    def _blame(
        self, replies: Mapping[str, Advanced], motion: ToolMotion, seen: Mapping[str, Fields] | None
    ) -> Floats | None:
        """What the goal blames each cell for (C,); None where no rule asks. seen: fields of the step, where observed"""
        if self._watch is None or not self.rule.looks_for_goal:
            return None
        strain = sum(reply.strain for reply in replies.values())
        poses = motion.position_next, motion.orientation_next
        goal = self._goal
        assert goal is not None

        def look() -> GoalError | None:
            return goal.look(self.parts, seen or self.participants.observe(), *poses, blame=True)

        return self._watch.follow(self._clock.step, strain, look)

    def goal_error(self, fields: Mapping[str, Fields], position: Floats, orientation: Floats) -> GoalError | None:
        """What the scene's goal is off by, of these fields, between tools at (t, 3), (t, 4); None where it has none, or
        nothing can be said of it."""
        if self._goal is None:
            return None
        try:
            return self._goal.look(self.parts, fields, position, orientation)
        except NoAdjoint:
            return None

    def near_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What of the cells evolves, for a snapshot."""
        return self.rule.to_arrays() | ({} if self._watch is None else self._watch.to_arrays())

    def take_near(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue with `near_arrays`. Raises KeyError or ValueError where these are others."""
        if self._watch is not None:
            self._watch.take(arrays)
        self.rule.take(arrays)

    def set_near(self, near: NDArray[np.bool_]) -> Energies:
        """Cut the body by hand: cells (C,) that are near from now on; its energies."""
        before = self.rule.to_arrays()
        try:
            kept = self.participants.keep()
            self.rule.mask = near
            return self._switch(kept)
        except BaseException:
            self.rule.take(before)
            raise

    def _switch(self, kept: Kept) -> Energies:
        """Cut the body anew; its energies from now on. Where that fails it is cut as it was."""
        try:
            return self._cut_anew()
        except BaseException:
            self.participants.go_back(kept)
            raise

    def _cut_anew(self) -> Energies:
        old, fields, body = self.parts, self.participants.observe(), self._body
        assert body.has_cells  # others are not divided
        state = merged_state(body, old, fields)
        cauchy = np.empty((body.n_cells, 8, 6))
        for name, side in fields.items():
            cauchy[old.cells[name]] = side.cauchy
        energies = self.participants.configure(self._tied(state, cauchy), state)
        self.participants.release(set(old.names) - set(self.parts.names))
        return energies

    def tied(self, seam: dict[str, Floats]) -> Tied:
        """The near cells as they are, tied as `Participants.seam_arrays` told. Raises KeyError or ValueError where that
        is of others."""
        parts, coupling = self._tied()
        if coupling is not None:
            coupling.take(seam)
        return parts, coupling

    def _tied(self, state: BodyState | None = None, cauchy: Floats | None = None) -> Tied:
        """The parts of the body as the rule cuts it, and what ties them where they share nodes.

        state, cauchy (C, 8, 6)  as the body stands: of both the first multiplier is made
        """
        parts = self.rule.parts(self._name, self._body)
        if len(self._joints):
            parts = replace(parts, joints=self._joints)
        return parts, self._couple(parts, state, cauchy)

    def _couple(self, parts: Parts, state: BodyState | None = None, cauchy: Floats | None = None) -> Coupling | None:
        """What ties these parts; None where they share no nodes."""
        scene, body = self._scene, self._body
        if not len(parts.seam):
            return None
        assert body.has_cells  # others are not divided
        functions = model_functions(scene.models)
        tie = tie_parts(body, parts, self.rule.neighbours, functions)
        first = None
        if state is not None and cauchy is not None:
            first = first_multiplier(body, parts, state, cauchy, tie, functions)
        return couple(self._setup, body, parts, tie, first)

    def frame(
        self, replies: Mapping[str, Advanced], position: Floats, orientation: Floats, indicators: bool = False
    ) -> Frame:
        """The whole body as it stands, with tools at (t, 3), (t, 4); fields that the last replies brought are used.

        indicators  with the body's error indicators
        """
        fields = {name: reply.fields for name, reply in replies.items() if reply.fields is not None}
        if indicators or fields.keys() != self.parts.cells.keys():
            fields = self.participants.observe(indicators)
        parts = self.parts
        multiplier, header = self.participants.multiplier(), self._clock.last_step()
        frame = whole_frame(
            *(header, self._body, parts, fields, self.rule.mask, multiplier, position, orientation, self._hardly_filled)
        )
        if self._clock.step == 0:
            frame = replace(frame, start=True)
        if not indicators:
            return frame
        assert self._body.has_cells  # others have none
        return replace(frame, indicators=measure(self._body, parts, self.rule.neighbours, fields))


def _is_turn(step: int) -> bool:
    """Whether it is time to look at the fields, after so many steps."""
    return step % LOOK_EVERY == 0
