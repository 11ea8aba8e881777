"""One body of a simulation: who holds its parts, what is measured of it, and how far that is to be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies
from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages.participant import Advanced, BodyState, Bundle, ToolMotion
from softseam_protocol.messages.session import ErrorEstimate, Frame
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import bounding_points
from softseam_services.orchestrator.archive import Arrays, as_bytes, floats, named, under
from softseam_services.orchestrator.breaking import Breaking
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.creep import Creep
from softseam_services.orchestrator.energy_balance import EnergyBalance, Entry
from softseam_services.orchestrator.error_estimate import ErrorEstimator
from softseam_services.orchestrator.participants import Tied
from softseam_services.orchestrator.parts import resting_state
from softseam_services.orchestrator.pierced import Pierced
from softseam_services.orchestrator.probes import Probes
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.quantities import Quantities
from softseam_services.orchestrator.regions import Regions
from softseam_services.orchestrator.step_lead import StepLead
from softseam_services.orchestrator.step_losses import StepLosses
from softseam_services.orchestrator.step_warnings import StepWarnings, Tell
from softseam_services.orchestrator.transport import Transport
from softseam_services.orchestrator.whereabouts import LOOK_EVERY, Seen, Whereabouts
from softseam_services.server import Setup

Floats = NDArray[np.float64]


class SimulatedBody:
    """One body while it is simulated.

    name     of the body
    prefix   of the names of its quantities, '' in a scene of one body
    setup    the scene with this body alone, the body, and the tools
    program  of the tools
    points   probes that are in this body (see `Probes`)
    tell     receives the events of this body
    gripped  whether the tools that close do so on this body
    joints   nodes on which interfaces to other bodies act (j,)
    """

    def __init__(
        self,
        name: str,
        prefix: str,
        bundle: Bundle,
        setup: Setup,
        program: Program,
        points: Mapping[str, tuple[float, float, float]],
        transport: Transport,
        clock: Clock,
        tell: Tell,
        gripped: bool = True,
        joints: NDArray[np.int32] | None = None,
    ) -> None:
        self.name, self.setup, self.scene, self.body = name, setup, setup.scene, setup.body
        self._prefix, self._clock, self._tell = prefix, clock, tell
        inelastic = self.body.has_cells and self.body.material.n_state > 0
        self.balance = EnergyBalance(_standing(self.body), inelastic)
        self.regions = Regions(name, bundle, setup, transport, clock, self.balance, tell, joints)
        """its parts, as the rule cuts them"""
        self.participants = self.regions.participants
        """that hold the parts"""
        self.errors = ErrorEstimator(self.body, self.scene)
        self.warnings = StepWarnings(self.scene, tell)
        self.losses, self._lead = StepLosses([setup]), StepLead(setup, clock.dt)
        self.whereabouts = Whereabouts([self.body], setup.tools, self._tell_of)
        self.pierced = Pierced(self.body, setup.tools, tell)
        self.creep = Creep([self.body], setup.tools, LOOK_EVERY * self.scene.step, self._tell_of)
        self._quantities = Quantities(self.body, program, self.scene.quantities, gripped)
        self.breaking = Breaking(self.body, self._quantities.rest.strength, self._tell)
        self._probes = Probes(self.body, points) if self.body.has_cells else None
        self.wants_fields = bool(points) or self._quantities.need_fields
        """whether some of its quantities need fields"""
        self.wants_indicators = self._quantities.need_indicators
        """whether some need the participants' error indicators"""
        self._near = np.flatnonzero(setup.tools.followed).tolist()
        self._lift_base, self._slip, self._felt = 0.0, 0.0, False
        self._numbers, self._touches = np.zeros((4, 1)), np.zeros(1, dtype=np.bool_)
        """of the last step: energies and work [J], and whether tools touched it, as `losses` takes them"""

    def reset(self) -> None:
        """Back to the start of the scene."""
        self._lift_base, self._slip, self._felt = 0.0, 0.0, False
        self.errors.reset()
        self.losses.forget()
        self._lead.start()
        self.balance.reset()
        self.whereabouts.start()
        self.creep.forget()
        self.pierced.forget()
        self.breaking.forget()
        self.participants.stand(self._clock.step)
        self.balance.begun = self.regions.start(resting_state(self.body))

    def take_over(self, other: SimulatedBody, state: BodyState) -> None:
        """Go on in this state for the same body on another rung, whose parts it takes; what was measured stays.

        The other's books, which it goes on with, are as they were until its parts are all there and the other's gone.
        """
        self._lift_base, self._slip, self._felt = other._lift_base, other._slip, other._felt
        self.errors.reset()
        self._lead.forget()
        self.participants.stand(self._clock.step)
        energies = self.regions.start(state)
        other.participants.release(set(other.participants.parts.names) - set(self.participants.parts.names))
        self.balance.take_over(other.balance)
        self.balance.switched(energies)

    @property
    def memory(self) -> tuple[float, float, bool]:
        """What its quantities remember: where its lift began [m], its last slip [m], whether tools had it then."""
        return self._lift_base, self._slip, self._felt

    @memory.setter
    def memory(self, known: tuple[float, float, bool]) -> None:
        self._lift_base, self._slip, self._felt = known

    @property
    def quantities(self) -> Quantities:
        """What is measured of it."""
        return self._quantities

    @property
    def felt_tools(self) -> list[int]:
        """Tools whose touch counts for its slip."""
        return self._near

    @property
    def prefix(self) -> str:
        """Of its quantities' names."""
        return self._prefix

    def report(self, kind: str, message: str) -> None:
        """Make an event of this body."""
        self._tell(kind, message)

    # ---- one step

    def goes_on(self, step: int, look: bool) -> bool:
        """Whether its parts are tied, and asked nothing between so many steps and the next; look: at their fields."""
        asked = (look and self.wants_indicators) or self.regions.looks_after(step)
        return self.participants.tied and not asked

    def watch(
        self, step: int, replies: Mapping[str, Advanced], wrench: Floats, position: Floats, orientation: Floats
    ) -> None:
        """Tell what became of the body by now, after a step that had this wrench on the tools (t, 6) [N, N m]."""
        seen = Seen.of(list(replies.values()))
        self.whereabouts.look(step, seen.bounds, seen.touches, position, orientation)
        self.look_inside(step, seen.bounds[0], wrench, position, orientation)
        if (step + 1) % LOOK_EVERY == 0:
            self.creep.look(step, seen, position, orientation)

    def look_inside(self, step: int, bounds: Floats, wrench: Floats, position: Floats, orientation: Floats) -> None:
        """Tell of tools that are inside the body, which has these bounds (2, 3) [m], and do not feel it."""
        self.pierced.look(
            step, bounds, wrench, position, orientation, lambda: self.look({}, position, orientation).point_x
        )

    def _tell_of(self, place: int, kind: str, message: str) -> None:
        self._tell(kind, message)

    def look(self, replies: Mapping[str, Advanced], position: Floats, orientation: Floats) -> Frame:
        """The body as it stands, between tools at (t, 3), (t, 4)."""
        return self.regions.frame(replies, position, orientation, self.wants_indicators)

    def measure(
        self,
        replies: Mapping[str, Advanced],
        wrench: Floats,
        position: Floats,
        orientation: Floats,
        frame: Frame | None,
        lifting: bool,
    ) -> dict[str, float]:
        """Quantities after a step, by name.

        wrench   of this body on the tools (t, 6) [N, N m]
        lifting  whether a tool has risen that touched a body; before, its height is that from which its lift counts

        What the body had slipped by when tools lost it stays until they touch it again.
        """
        height = self._quantities.height(replies)
        if not lifting:
            self._lift_base = height
        grip_force = self._quantities.grip_force(wrench, orientation)
        rise = height - self._lift_base
        found = self._quantities.measure(replies, grip_force, position, orientation, frame, rise)
        forces = wrench.tolist()
        felt = any(any(forces[tool]) for tool in self._near)
        if felt and (found["slip"] > 0.0 or not self._felt):  # else it was lost within the step
            self._slip = found["slip"]
        found["slip"], self._felt = self._slip, felt
        found = self._named(found)
        if frame is not None:
            self.breaking.look(self._clock.step - 1, self._clock.time, frame)
        if frame is not None and self._probes is not None:
            found |= self._probes.measure(frame, self.regions.rule.models)
        return found

    def at_rest(self, position: Floats, orientation: Floats, frame: Frame | None) -> dict[str, float]:
        """Quantities before the first step; those that need fields only with a frame."""
        found = self._named(self._quantities.at_rest(position, orientation, frame))
        return found if self._probes is None else found | self._probes.at_rest()

    def judge(
        self, replies: Mapping[str, Advanced], position: Floats, orientation: Floats, done: bool
    ) -> ErrorEstimate | None:
        """Look at the errors where that is due, as a phase ends; how far the run can be trusted, where it is done."""
        if self.errors.due(sum(reply.strain for reply in replies.values()), done):
            fields = self.participants.observe(indicators=True, own=True)
            goal = self.regions.goal_error(fields, position, orientation)
            self.errors.look(self._clock.time, self.regions.parts, fields, goal)
        if done and (swings := self.losses.swings()):
            self._tell("damped", f"step {self._clock.step - 1}: {swings}")
        if done and (ahead := self._lead.said()):
            self._tell("accuracy", f"step {self._clock.step - 1}: {ahead}")
        estimate = self.errors.estimate() if done else None
        return None if estimate is None else self._with_losses(estimate)

    def _with_losses(self, estimate: ErrorEstimate) -> ErrorEstimate:
        """With what steps damped, and by how much they carried it ahead, of which fields know nothing."""
        said = "; ".join(filter(None, (estimate.text, self.losses.said(), self._lead.said())))
        return replace(estimate, text=said)

    def estimate(self, position: Floats, orientation: Floats) -> ErrorEstimate | None:
        """How far the answer may be off as the body stands; None of particles."""
        if not self.body.has_cells:
            return None
        fields = self.participants.observe(indicators=True, own=True)
        goal = self.regions.goal_error(fields, position, orientation)
        return self._with_losses(self.errors.now(self._clock.time, self.regions.parts, fields, goal))

    def follow(self, replies: Mapping[str, Advanced], motion: ToolMotion) -> Energies | None:
        """Let the cut follow its rule after a step; the energies after a switch."""
        return self.regions.follow(replies, motion)

    def book(self, replies: Mapping[str, Advanced], solution: Outcome, drive_work: float) -> Entry:
        """Enter a step into the balance, with the cut that it was taken with, and what the tools' motion put in [J]."""
        entry = self.balance.book(self.regions.parts, replies, solution, drive_work)
        self._lead.follow(replies)
        if not self.losses.watches:
            return entry
        self._touches[0] = any(reply.wrench.any() for reply in replies.values())
        energy, numbers = entry.energy, self._numbers
        numbers[0], numbers[1], numbers[2] = energy["kinetic"], energy["strain"], energy["dissipation"]
        numbers[3] = drive_work
        for said in self.losses.follow(numbers, self._touches).values():
            self._tell("damped", f"step {self._clock.step - 1}: {said}")
        return entry

    def _named(self, quantities: dict[str, float]) -> dict[str, float]:
        if not self._prefix:
            return quantities
        return {self._prefix + name: value for name, value in quantities.items()}

    # ---- snapshots

    def save(self) -> Arrays:
        """All that evolves."""
        participants = self.participants.snapshot()
        return {
            "memory": np.array(self.memory, dtype=np.float64),
            **self.balance.save(),
            "errors": self.errors.to_array(),
            **under("regions.", self.regions.near_arrays()),
            **under("seam.", self.participants.seam_arrays()),
            **under("part.", as_bytes(participants)),
        }

    def check(self, saved: Arrays) -> None:
        """Raise KeyError, ValueError or IndexError where a state is not this body's; changes nothing."""
        memory, near, errors, balance = (
            self.memory,
            self.regions.near_arrays(),
            self.errors.to_array(),
            self.balance.save(),
        )
        try:
            parts, _ = self._take(saved)
            missing = set(parts.names) - named(saved, "part.").keys()
            if missing:
                raise KeyError(*sorted(missing))
        finally:
            self.regions.take_near(near)
            self.errors.take(errors)
            self.balance.load(balance)
            self.memory = memory

    def load(self, saved: Arrays) -> None:
        """Continue from `save`, after the clock."""
        tied = self._take(saved)
        self._lead.forget()
        self.participants.stand(self._clock.step)
        self.participants.restore(tied, {name: state.tobytes() for name, state in named(saved, "part.").items()})

    def _take(self, saved: Arrays) -> Tied:
        """Continue with all but the parts; how these are tied. Raises KeyError, ValueError or IndexError."""
        self.regions.take_near(named(saved, "regions."))
        self.errors.take(saved["errors"].astype(np.float64))
        self.balance.load(saved)
        base, slip, felt = saved["memory"].astype(np.float64).tolist()
        self.memory = base, slip, bool(felt)
        return self.regions.tied(floats(named(saved, "seam.")))


def _standing(body: AnyBody) -> float:
    """Weight of a body in cells times the height of its centre above its lowest point, against gravity, at rest [J]."""
    if not body.has_cells:
        return 0.0
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    height, lowest = -(body.x_rest @ body.gravity), -float((bounding_points(body) @ body.gravity).max())
    return float(mass @ (height - lowest))
