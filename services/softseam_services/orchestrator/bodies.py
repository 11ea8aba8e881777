"""The bodies of a simulation: which step together, which sleep, and what each is simulated as at present.

A step of theirs is a recipe: wake, climb, advance every island, and once it is measured, fall asleep.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import partial

import numpy as np

from softseam_coupling.islands import islands_of
from softseam_coupling.ladder import Standing
from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages.names import prefix
from softseam_protocol.messages.participant import Bundle, ToolMotion
from softseam_protocol.messages.session import InterfaceReport
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.archive import Arrays, floats, named, under
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.hosting import Hosting
from softseam_services.orchestrator.islands import advance_all
from softseam_services.orchestrator.joined_bodies import Between, JoinedBodies, interfaces_of, joints_of
from softseam_services.orchestrator.ladder import Ladder
from softseam_services.orchestrator.overlaps import Overlaps
from softseam_services.orchestrator.participants import Participants
from softseam_services.orchestrator.parts import resting_state
from softseam_services.orchestrator.pile import Gathered, MemberTransport, Pile, piles_of
from softseam_services.orchestrator.pile_bodies import PileBodies
from softseam_services.orchestrator.probes import share_probes
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.sleeping import Sleeping
from softseam_services.orchestrator.solutions import Solutions
from softseam_services.orchestrator.step_warnings import Tell, naming
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost, Transport
from softseam_services.server import Setup, build_setup

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
        self._bundle = bundle
        self._program, self._clock, self._report = program, clock, report
        self._probes = share_probes({name: setup.body for name, setup in setups.items()}, scene.probes)
        self._ladders = {
            name: Ladder(scene, name, body, bundle.files, partial(self._on_rung, name))
            for name, body in scene.bodies.items()
            if body.said("ladder", ())
        }
        interfaces = scene.interfaces
        self._order = {name: place for place, name in enumerate(interfaces)}
        piled = piles_of(setups, interfaces, self._ladders)
        self._piles = {model: self._pile(model, each) for model, each in piled.items()}
        within = {name for pile in self._piles.values() for name in pile.contact_names}
        self._interfaces = interfaces_of(scene, setups, within)
        guests = [name for pile in self._piles.values() for name in pile.guests]
        self._touched = {name: setups[name].touched().nodes for name in guests}
        self.named = {
            name: self._ladders[name].begin() if name in self._ladders else self._simulated(name, bundle, setup)
            for name, setup in setups.items()
        }
        """by name, in the scene's order"""
        self.piles = [
            PileBodies(pile, self.named, program, setups[pile.names[0]].tools) for pile in self._piles.values()
        ]
        """those whose bodies step as one part"""
        self._apart = [name for name in self.named if not any(name in pile.names for pile in self._piles.values())]
        tied = islands_of(self.named, (between.bodies for between in self._interfaces.values()))
        self._joined: list[JoinedBodies | Hosting] = [self._join(island) for island in tied if len(island) > 1]
        self._joined += [self._host(pile) for pile in self._piles.values() if pile.guests]
        self._lone = {island[0]: self.named[island[0]].participants for island in tied if len(island) == 1}
        for pile in self._piles.values():
            for name in (*pile.names, *pile.guests):
                del self._lone[name]
        mass, tools = {name: setup.body.total_mass for name, setup in setups.items()}, next(iter(setups.values())).tools
        self.overlaps = Overlaps(scene, report)
        weight = {name: mass[name] * setup.body.gravity for name, setup in setups.items()}
        self._sleeping = Sleeping(scene.sleep, tied, weight, mass, self.piles, tools, scene.step, self._woke)
        self._awake: dict[str, SimulatedBody] | None = None  # those that do not sleep, where they are known

    def _simulated(self, name: str, bundle: Bundle, setup: Setup) -> SimulatedBody:
        first = self._program.grips.first
        return SimulatedBody(
            name=name,
            prefix=prefix(name, self._setups),
            bundle=bundle,
            setup=setup,
            program=self._program,
            points=self._probes[name],
            transport=self._transport_of(name),
            clock=self._clock,
            tell=self._report if len(self._setups) == 1 else naming(name, self._report),
            gripped=first is None or first.body is self._setups[name].body,
            joints=self._touched[name] if name in self._touched else joints_of(name, self._interfaces),
        )

    def _pile(self, model: str, gathered: Gathered) -> Pile:
        n_nodes = sum(self._setups[name].body.n_nodes for name in gathered.names)
        about = model, gathered.names, gathered.guests, n_nodes, self._bundle, self._scene
        return Pile(*about, self._transport, self._clock, self._report)

    def _transport_of(self, name: str) -> Transport:
        """How a body by itself is asked."""
        pile = next((pile for pile in self._piles.values() if name in pile.names), None)
        return self._transport if pile is None else MemberTransport(pile, name)

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

    def _host(self, pile: Pile) -> Hosting:
        guests = {name: self.named[name] for name in pile.guests}
        joints = {name: self._touched[name] for name in guests}
        about = self._scene, pile, guests, joints, self._transport, self._clock
        return Hosting(*about, self._report, self._again)

    def _woke(self, whose_and_why: str) -> None:
        self._awake = None
        self._report("sleep", f"step {self._clock.step}: {whose_and_why}")

    # ---- one step

    def reset(self) -> None:
        """Back to the start of the scene."""
        self._sleeping.reset()
        self._awake = None
        for name, ladder in self._ladders.items():
            self._stand_on(name, ladder.begin())
        for each in self._piles.values():
            states = [resting_state(self.named[name].body) for name in each.names]
            each.begin(states, self._clock.step)
        for body in self.named.values():
            body.reset()
        for pile in self.piles:
            pile.begin()
            pile.whereabouts.start()
        for island in self._joined:
            island.begin()

    @property
    def steps_ahead(self) -> bool:
        """Whether a step may begin with the correction of the one before: nothing is decided between them."""
        return len(self.named) == 1 and not self._ladders and not self._sleeping.possible

    @property
    def apart(self) -> dict[str, SimulatedBody]:
        """Those that are in no pile, by name."""
        if not self.piles:
            return self.named
        return {name: self.named[name] for name in self._apart}

    def store(self) -> None:
        """Have each body of a pile know what the steps did to it."""
        for pile in self.piles:
            pile.store()

    @property
    def parts(self) -> set[str]:
        """Ids of the parts that participants hold."""
        own = {part for body in self.apart.values() for part in body.participants.parts.names}
        return own | {pile.part for pile in self._piles.values()}

    def release(self, kept: Collection[str]) -> None:
        """Let go of the parts that are not among these."""
        for body in self.apart.values():
            with suppress(ParticipantLost, ParticipantFailed):  # who is lost holds nothing
                body.participants.release(set(body.participants.parts.names) - set(kept))
        for pile in self._piles.values():
            if pile.part not in kept:
                with suppress(ParticipantLost, ParticipantFailed):
                    pile.release()

    @property
    def awake(self) -> dict[str, SimulatedBody]:
        """Those that do not sleep, by name."""
        if not self._sleeping.any:
            return self.named
        if self._awake is None:
            asleep = set(self._sleeping.names)
            self._awake = {name: body for name, body in self.named.items() if name not in asleep}
        return self._awake

    def advance(self, motion: ToolMotion, fields: bool, then: ToolMotion | None = None) -> Solutions:
        """Take a step, all or none, in the scene's order; see `advance_all`.

        Raises StepFailed, ParticipantLost and ParticipantFailed.
        """
        sleeping = self._sleeping
        sleeping.wake(motion)
        asleep, any_asleep = dict(sleeping.outcomes), sleeping.any
        if self._ladders:
            self._climb(asleep)
        lone: dict[str, Participants | Pile] = {**self._lone}
        joined, again = self._joined, None
        for number, held in enumerate(self._piles.values()):
            if held.lay(*sleeping.of_pile(number)) and not held.guests:
                lone[held.part] = held
        if any_asleep:
            lone = {name: island for name, island in lone.items() if name not in asleep}
            joined = [island for island in joined if not island.rests(asleep)]
            again = partial(self._again, motion)
        taken = asleep | advance_all(lone, joined, self._transport, motion, fields, then, again)
        for pile in self.piles:
            pile.take(taken.get(pile.pile.part))
        return Solutions({name: taken[name] for name in self.named if name in taken}, self.piles)

    def _again(self, motion: ToolMotion, outcomes: Mapping[str, Outcome]) -> list[str]:
        """Piles, by their parts, that are to take the step anew: some of their bodies, or of their guests, wake by what
        they felt in it."""
        if not self._sleeping.any:
            return []
        parts = self._sleeping.feel(outcomes, motion)
        for number, pile in enumerate(self._piles.values()):
            if pile.part in parts:
                pile.lay(*self._sleeping.of_pile(number))
        return parts

    def _climb(self, asleep: Mapping[str, Outcome]) -> None:
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
        """Let bodies sleep from now on that may, after a step that came to this."""
        fell = self._sleeping.follow(solutions, motion)
        if fell:
            self._awake = None
        for island in self._joined:
            if tuple(island.members) in fell:
                island.rest()

    @property
    def interface_reports(self) -> dict[str, InterfaceReport]:
        """Of the last step, by interface between bodies, in the scene's order: of those that it writes, and of others
        that pressed."""
        if not self._order:
            return {}
        found = {name: report for island in self._joined for name, report in island.reports.items()}
        written = self._scene.joints
        found = {name: report for name, report in found.items() if name in written or any(report.total)}
        for name in written.keys() - found.keys():
            found[name] = _APART
        for pile in self.piles:
            found |= pile.interfaces
        return {name: found[name] for name in sorted(found, key=self._order.__getitem__)}

    # ---- snapshots

    def forget_sent(self) -> None:
        """The parts took a snapshot."""
        for island in self._joined:
            island.forget_sent()

    def save(self) -> Arrays:
        """All that evolves."""
        self.store()
        found: Arrays = {}
        for name, body in self.named.items():
            found |= under(f"bodies/{name}/", body.save())
        for island in self._joined:
            found |= under(f"joined/{island.name}/", island.save())
        for pile in self.piles:
            found |= under(f"piles/{pile.pile.part}/", pile.save())
        rungs = {name: np.array([ladder.at]) for name, ladder in self._ladders.items()}
        return found | under("sleeping/", self._sleeping.save()) | under("rung/", rungs)

    def check(self, saved: Arrays) -> None:
        """Raise KeyError, ValueError or IndexError where a state is not these bodies'; changes nothing."""
        for name, body in self._standing(saved).items():
            body.check(named(saved, f"bodies/{name}/"))
        for island in self._joined:
            island.check(floats(named(saved, f"joined/{island.name}/")))
        for pile in self.piles:
            pile.check(floats(named(saved, f"piles/{pile.pile.part}/")))
        self._sleeping.read(named(saved, "sleeping/"))

    def load(self, saved: Arrays) -> None:
        """Continue from `save`, once that is checked, and after the clock."""
        for name, body in self._standing(saved).items():
            self._stand_on(name, body)
            body.load(named(saved, f"bodies/{name}/"))
        for name, ladder in self._ladders.items():
            ladder.at = _rung(saved, name)
        for pile in self.piles:
            pile.pile.restore(self._clock.step)
            pile.begin()
            pile.load(floats(named(saved, f"piles/{pile.pile.part}/")))
        for island in self._joined:
            island.load(floats(named(saved, f"joined/{island.name}/")))
        self._sleeping.load(named(saved, "sleeping/"))
        self._awake = None

    def _standing(self, saved: Arrays) -> dict[str, SimulatedBody]:
        """The bodies on the rungs that were saved."""
        return self.named | {name: ladder.body(_rung(saved, name)) for name, ladder in self._ladders.items()}


_APART = InterfaceReport(0.0, 0, 0, 0.0, 0.0)
"""of an interface at which nothing meets"""


def _rung(saved: Arrays, body: str) -> int:
    return int(saved[f"rung/{body}"].flat[0])
