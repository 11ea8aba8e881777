"""The bodies of a simulation: which step together, which sleep, and what each is simulated as at present.

A step of theirs is a recipe: wake, climb, advance every island, and once it is measured, fall asleep.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from softseam_coupling.islands import islands_of
from softseam_coupling.ladder import Standing
from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages.names import prefix
from softseam_protocol.messages.participant import Bundle, ToolMotion
from softseam_protocol.messages.session import InterfaceReport
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.islands import advance_all
from softseam_services.orchestrator.joined_bodies import Between, JoinedBodies, interfaces_of, joints_of
from softseam_services.orchestrator.ladder import Ladder
from softseam_services.orchestrator.probes import share_probes
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.saved_state import SavedBodies
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.sleeping import Sleeping
from softseam_services.orchestrator.step_warnings import Tell, naming
from softseam_services.orchestrator.transport import Transport
from softseam_services.server import Setup, build_setup

Solutions = dict[str, Outcome]
"""of a step, by body"""
Adopt = Callable[[Bundle, Mapping[str, Setup]], None]


class Bodies:
    """Of one scene.

    setups     what its bundle describes of each body, by name
    transport  how to reach the participants
    adopt      lets participants of this process share what is built here
    program    of the tools
    report     receives the events
    """

    def __init__(
        self,
        scene: Scene,
        bundle: Bundle,
        setups: Mapping[str, Setup],
        transport: Transport,
        adopt: Adopt,
        program: Program,
        clock: Clock,
        report: Tell,
    ) -> None:
        self._scene, self._setups, self._transport, self._adopt = scene, setups, transport, adopt
        self._program, self._clock, self._report = program, clock, report
        self._probes = share_probes({name: setup.body for name, setup in setups.items()}, scene.probes)
        self._interfaces = interfaces_of(scene, {name: setup.body for name, setup in setups.items()})
        self._ladders = {
            name: Ladder(scene, name, body, bundle.files, partial(self._on_rung, name))
            for name, body in scene.bodies.items()
            if body.said("ladder", ())
        }
        self.named = {
            name: self._ladders[name].begin() if name in self._ladders else self._simulated(name, bundle, setup)
            for name, setup in setups.items()
        }
        """by name, in the scene's order"""
        islands = islands_of(self.named, (between.bodies for between in self._interfaces.values()))
        self._joined = [self._join(island) for island in islands if len(island) > 1]
        self._lone = {island[0]: self.named[island[0]].participants for island in islands if len(island) == 1}
        mass, tools = {name: setup.body.total_mass for name, setup in setups.items()}, next(iter(setups.values())).tools
        self._sleeping = Sleeping(scene.sleep, islands, mass, tools, self._woke)

    def _simulated(self, name: str, bundle: Bundle, setup: Setup) -> SimulatedBody:
        first = self._program.grips.first
        return SimulatedBody(
            name=name,
            prefix=prefix(name, self._setups),
            bundle=bundle,
            setup=setup,
            program=self._program,
            points=self._probes[name],
            transport=self._transport,
            clock=self._clock,
            tell=self._report if len(self._setups) == 1 else naming(name, self._report),
            gripped=first is None or first.body is self._setups[name].body,
            joints=joints_of(name, self._interfaces),
        )

    def _on_rung(self, name: str, bundle: Bundle) -> SimulatedBody:
        setup = build_setup(bundle, name)
        self._adopt(bundle, {name: setup})
        return self._simulated(name, bundle, setup)

    def _join(self, island: tuple[str, ...]) -> JoinedBodies:
        own: dict[str, Between] = {
            name: between for name, between in self._interfaces.items() if between.bodies[0] in island
        }
        bodies = {name: self.named[name] for name in island}
        return JoinedBodies(self._scene, bodies, own, self._transport, self._clock, self._report)

    def _woke(self, island: tuple[str, ...], reason: str) -> None:
        self._report("sleep", f"step {self._clock.step}: {', '.join(island)}: {reason}")

    # ---- one step

    def reset(self) -> None:
        """Back to the start of the scene."""
        self._sleeping.reset()
        for name, ladder in self._ladders.items():
            self._stand_on(name, ladder.begin())
        for body in self.named.values():
            body.reset()
        for island in self._joined:
            island.begin()

    @property
    def steps_ahead(self) -> bool:
        """Whether a step may begin with the correction of the one before: nothing is decided between them."""
        return len(self.named) == 1 and not self._ladders and not self._sleeping.possible

    @property
    def awake(self) -> dict[str, SimulatedBody]:
        """Those that do not sleep, by name."""
        asleep = self._sleeping.outcomes()
        return {name: body for name, body in self.named.items() if name not in asleep} if asleep else self.named

    def advance(self, motion: ToolMotion, fields: bool, then: ToolMotion | None = None) -> Solutions:
        """Take a step, all or none, in the scene's order; see `advance_all`.

        Raises StepFailed, ParticipantLost and ParticipantFailed.
        """
        lone, joined = self._lone, self._joined
        self._sleeping.wake(motion)
        asleep = self._sleeping.outcomes()
        if self._ladders:
            self._climb(asleep)
        if asleep:
            lone = {name: island for name, island in lone.items() if name not in asleep}
            joined = [island for island in joined if island.members.keys().isdisjoint(asleep)]
        taken = asleep | advance_all(lone, joined, self._transport, motion, fields, then)
        return {name: taken[name] for name in self.named}  # sums in one order have one rounding

    def _climb(self, asleep: Solutions) -> None:
        """Let bodies that are awake go to the rungs that they are to be on in the step that begins."""
        for name, ladder in self._ladders.items():
            old = self.named[name]
            if name in asleep:
                continue
            energies = old.balance.energies
            rung = ladder.due(Standing(self._clock.time, energies.kinetic, energies.strain))
            if rung == ladder.at:
                continue
            kept = old.participants.keep()
            try:
                state = ladder.carried(rung, old)
                ladder.body(rung).take_over(old, state)
            except BaseException:
                old.participants.go_back(kept)
                raise
            ladder.at = rung
            self._stand_on(name, ladder.body(rung))

    def _stand_on(self, name: str, body: SimulatedBody) -> None:
        """A body is simulated as this from now on."""
        self.named[name] = body
        if name in self._lone:
            self._lone[name] = body.participants

    def fall_asleep(self, solutions: Solutions, motion: ToolMotion) -> None:
        """Let islands sleep from now on that may, after a step that came to this."""
        fell = self._sleeping.follow(solutions, motion)
        for island in self._joined:
            if tuple(island.members) in fell:
                island.rest()

    @property
    def interface_reports(self) -> dict[str, InterfaceReport]:
        """Of the last step, by interface between bodies."""
        return {name: report for island in self._joined for name, report in island.reports.items()}

    # ---- snapshots

    def forget_sent(self) -> None:
        """The parts took a snapshot."""
        for island in self._joined:
            island.forget_sent()

    def save(self) -> SavedBodies:
        """All that evolves."""
        return SavedBodies(
            {name: body.save() for name, body in self.named.items()},
            {island.name: island.save() for island in self._joined},
            self._sleeping.save(),
            {name: ladder.at for name, ladder in self._ladders.items()},
        )

    def check(self, saved: SavedBodies) -> None:
        """Raise KeyError, ValueError or IndexError where a state is not these bodies'; changes nothing."""
        for name, body in self._standing(saved).items():
            body.check(saved.named[name])
        for island in self._joined:
            island.check(saved.joined[island.name])
        self._sleeping.read(saved.sleeping)

    def load(self, saved: SavedBodies) -> None:
        """Continue from `save`, once that is checked, and after the clock."""
        for name, body in self._standing(saved).items():
            self._stand_on(name, body)
        for name, ladder in self._ladders.items():
            ladder.at = saved.rungs[name]
        for name, body in self.named.items():
            body.load(saved.named[name])
        for island in self._joined:
            island.load(saved.joined[island.name])
        self._sleeping.load(saved.sleeping)

    def _standing(self, saved: SavedBodies) -> dict[str, SimulatedBody]:
        """The bodies on the rungs that were saved."""
        return self.named | {name: ladder.body(saved.rungs[name]) for name, ladder in self._ladders.items()}
