"""One simulation: the scene's clock and motion, what each step measures, and its state in a few bytes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.outcomes import Detail, EventKind
from softseam_protocol.messages.participant import Bundle, ToolMotion
from softseam_protocol.messages.session import ErrorEstimate, Event, Frame, StepReport
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.command import Command
from softseam_protocol.scene.file import scene_from_bundle
from softseam_protocol.scene.scene import SeveralBodies
from softseam_services.body.build import AnyBody
from softseam_services.meshes_apart import check_meshes_apart
from softseam_services.orchestrator.after_step import CHECKPOINT_STEPS, AfterStep, Taken
from softseam_services.orchestrator.archive import ArchiveError, as_bytes, pack, unpack
from softseam_services.orchestrator.bodies import Bodies
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.grip import AT_REST, Placement
from softseam_services.orchestrator.moving_tools import Move, MovingTools
from softseam_services.orchestrator.recovery import RecoveringTransport
from softseam_services.orchestrator.regions import Regions
from softseam_services.orchestrator.reports import step_report, worst, wrench_of
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.solutions import Solutions
from softseam_services.orchestrator.stopwatch import Stopwatch, TimedTransport
from softseam_services.orchestrator.transport import Transport
from softseam_services.server import Setup, build_setup

Floats = NDArray[np.float64]
Emit = Callable[[StepReport | Frame | Event], None]

_FIELDS_EVERY = 5
"""steps between looks at the fields for quantities that need them, where nobody asks for every frame"""


class Simulation:
    """Steps one scene. Owns the clock, the tools' motion, the bodies and the checkpoints.

    bundle     the scene and its files
    transport  how to reach the participants; closed with the simulation
    session    names this simulation among others on the same bus
    emit       receives every StepReport and Event, and a Frame of each body a step where `fields` are asked for
    seed       in place of the scene's
    clock      of the simulation before this one in the same session, see `with_scene`
    """

    def __init__(
        self,
        bundle: Bundle,
        transport: Transport,
        *,
        session: str = "local",
        emit: Emit | None = None,
        seed: int | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.scene = scene_from_bundle(bundle)
        setups = {name: build_setup(bundle, name) for name in self.scene.bodies}
        bodies = [setup.body for setup in setups.values()]
        check_meshes_apart(self.scene, {name: setup.body for name, setup in setups.items()})
        self.tools = next(iter(setups.values())).tools
        self._bundle, self._emit, self._participants = bundle, emit, transport
        if isinstance(transport, EmbeddedTransport):
            transport.adopt(bundle, setups)
        self._moving = MovingTools(self.scene, self.tools, bodies, self._placed)
        self._duration = self.scene.duration
        self._clock = Clock(session, self.scene.step) if clock is None else clock.at_pace(self.scene.step)
        self._stopwatch = Stopwatch()
        recovering = RecoveringTransport(transport, on_event=self._event)
        self._transport = TimedTransport(recovering, self._stopwatch)
        adopt = transport.adopt if isinstance(transport, EmbeddedTransport) else _nobody
        self._bodies = Bodies(
            self.scene, bundle, setups, self._transport, adopt, self._moving.program, self._clock, self._event
        )
        self._after = AfterStep(self._bodies, self._moving, self._clock, self._duration, self._event)
        self._wants_fields = any(body.wants_fields for body in self.bodies.values())
        self.events: list[Event] = []
        """events since the last reset, oldest first"""
        self.reset(seed)

    # ---- state of the run

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self._clock.time

    @property
    def done(self) -> bool:
        """Whether the scene's duration, or without one its motion, is over."""
        if self._duration is not None:
            return self._clock.step >= round(self._duration / self.scene.step)
        return self._moving.done

    @property
    def expected_steps(self) -> int | None:
        """Steps of the whole run, where that can be foreseen."""
        length = self._duration if self._duration is not None else self._moving.program.duration()
        return None if length is None else math.ceil(length / self.scene.step - 1e-6)

    @property
    def report(self) -> StepReport | None:
        """The last committed step's report; None before the first step."""
        return self._report

    @property
    def bodies(self) -> Mapping[str, SimulatedBody]:
        """By name, in the scene's order."""
        return self._bodies.named

    @property
    def only(self) -> SimulatedBody:
        """The body of a scene that has one. Raises SeveralBodies."""
        if len(self.bodies) > 1:
            raise SeveralBodies(f"the scene has several bodies: {', '.join(self.bodies)}; see `bodies`")
        return next(iter(self.bodies.values()))

    @property
    def body(self) -> AnyBody:
        """That body as it is built."""
        return self.only.body

    @property
    def solver(self) -> Solver | None:
        """What computes that body; None where it is in several parts, or in another process."""
        names = self.only.participants.parts.names
        if len(names) > 1 or not isinstance(self._participants, EmbeddedTransport):
            return None
        return self._participants.solver(self._clock.session, names[0])

    @property
    def regions(self) -> Regions:
        """That body as it is cut, and who holds it."""
        return self.only.regions

    def reset(self, seed: int | None = None) -> None:
        """Back to the start of the scene."""
        self._seed = self.scene.seed if seed is None else seed
        self._clock.start(0)
        self._moving.reset()
        self._forget()
        self.events.clear()
        self._bodies.reset()

    def with_scene(self, bundle: Bundle, seed: int | None = None) -> Simulation:
        """A simulation of another scene in place of this one, with its participants, which keep what both scenes share.

        Raises what a new simulation does; this one stands at its start then.
        """
        clock = self._clock
        try:
            other = Simulation(bundle, self._participants, emit=self._emit, seed=seed, clock=clock)
        except BaseException:
            clock.at_pace(self.scene.step)
            self.reset(self._seed)
            raise
        self._bodies.release(other.parts)
        return other

    @property
    def parts(self) -> set[str]:
        """Ids of the parts that participants hold."""
        return self._bodies.parts

    def _forget(self) -> None:
        """The last step is another's."""
        self._after.forget()
        self._report: StepReport | None = None
        self._frames: dict[str, Frame] | None = None
        self._unseen = False  # their fields were asked for, and lost

    # ---- stepping

    def step(self, velocities: Command | None = None, fields: bool = False, more: bool = False) -> StepReport:
        """Advance by one step of the scene.

        velocities  of tools, as `checked_command` gives them: they are not looked at again; tools left out stand still.
                    None follows the scene's motion.
        fields      also make a Frame of each body (see `frames`)
        more        another step of the scene's motion follows for certain: with participants on a bus it comes sooner
        Raises StepFailed and ParticipantLost.
        """
        began, ongoing = perf_counter(), not self.done
        move = self._moving.next(velocities)
        self._stopwatch.begin(began)
        look = fields or (self._wants_fields and (self._clock.step + 1) % _FIELDS_EVERY == 0)
        then = self._ahead(move, look) if more else None
        solutions = self._bodies.advance(move.motion, look, then)
        wrenches = {name: wrench_of(solutions[name].replies) for name in self._bodies.apart}
        first, *others = (*wrenches.values(), *(pile.wrench for pile in self._bodies.piles))
        wrench = sum(others, first)
        moved = self._moving.take(move, wrench)
        self._clock.step += 1
        taken = Taken(solutions, wrenches, move, moved, ongoing, self.done)
        frames = self._look(solutions, look or (self._wants_fields and taken.done))
        quantities = self._after.measure(taken, frames or {})
        entries = self._after.book(taken, self.scene.step)
        switched = self._after.adapt(taken)
        self._bodies.fall_asleep(solutions, move.motion)
        estimates = self._after.judge(taken)
        report = step_report(
            header=self._clock.last_step(),
            phase=moved.phase,
            motion=move.motion,
            wrench=wrench,
            quantities=quantities,
            entries=entries,
            interfaces=self._bodies.interface_reports,
            command=move.command,
            seconds=self._stopwatch.read(),
            done=taken.done,
            estimate=worst(estimates),
        )
        if switched:
            self._frames = None
        self._after.warn(taken, estimates)
        self._report = report
        if self._emit is not None:
            self._emit(report)
            for frame in (frames or {}).values():
                self._emit(frame)
        return report

    def _ahead(self, move: Move, look: bool) -> ToolMotion | None:
        """How the tools move in the step after `move`, where nothing else is asked of the participants in between."""
        step, body = self._clock.step + 1, next(iter(self.bodies.values()))
        last = self._duration is not None and step >= round(self._duration / self.scene.step)
        if last or not self._bodies.steps_ahead or step % CHECKPOINT_STEPS == 0 or not body.goes_on(step, look):
            return None
        return self._moving.ahead(move)

    def _look(self, solutions: Solutions, asked: bool) -> dict[str, Frame] | None:
        """The bodies' fields where they are asked for; None where they are not, or are lost."""
        frames = None
        if asked:
            at = self._moving.poses
            frames = self._after.try_to(
                lambda: {name: body.look(solutions[name].replies, *at) for name, body in self.bodies.items()}
            )
        self._frames, self._unseen = frames, asked and frames is None
        return frames

    # ---- what is known

    def at_rest(self, frames: Mapping[str, Frame]) -> dict[str, float]:
        """Quantities before the first step; those that need fields only of bodies with a frame."""
        found: dict[str, float] = {}
        for name, body in self.bodies.items():
            found |= body.at_rest(self.tools.position, self.tools.orientation, frames.get(name))
        return found

    def frames(self) -> dict[str, Frame]:
        """The bodies as they stand."""
        if self._frames is None:
            at = self._moving.poses
            self._frames = {name: body.look({}, *at) for name, body in self.bodies.items()}
        return self._frames

    def frame(self) -> Frame:
        """The body of a scene that has one, as it stands."""
        return self.frames()[self.only.name]

    def seen(self) -> dict[str, Frame] | None:
        """The bodies after the last step; None, and told, where a participant is lost: the step counts then, too.

        What the step itself waited for in vain is not waited for again.
        """
        return None if self._unseen and self._frames is None else self._after.try_to(self.frames)

    def estimate(self) -> ErrorEstimate | None:
        """How far the answer may be off as the bodies stand, of the one that is off most; None of particles."""
        self._bodies.store()
        found = {name: body.estimate(*self._moving.poses) for name, body in self.bodies.items()}
        return worst({name: estimate for name, estimate in found.items() if estimate is not None})

    def set_near(self, near: NDArray[np.bool_]) -> float:
        """Cut the only body by hand: cells (C,) that are near from now on; returns the kinetic energy change [J]."""
        body = self.only
        energies = body.regions.set_near(near)
        self._frames = None
        return body.balance.switched(energies)

    def close(self) -> None:
        """Release the participants and the transport."""
        self._bodies.release(())
        self._transport.close()

    # ---- snapshots

    def save(self) -> bytes:
        """State of the whole simulation; `load` continues from it bit for bit."""
        numbers = {"schema": np.array([SCHEMA_VERSION]), "numbers": np.array([self._clock.step, self._seed])}
        texts = as_bytes({"scene": self._bundle.scene.encode()})
        return pack(numbers | texts | self._moving.save() | self._bodies.save())

    def load(self, state: bytes) -> None:
        """Continue from `save`. Raises ArchiveError, and has changed nothing, where that is no state of this scene."""
        saved = unpack(state)
        schema = int(saved["schema"].flat[0]) if "schema" in saved and saved["schema"].size else 0
        if schema != SCHEMA_VERSION:
            raise ArchiveError(
                f"this state has schema version {schema}, this softseam reads {SCHEMA_VERSION}: load it with the "
                "softseam that saved it, or run the scene again and save it anew"
            )
        try:
            if saved["scene"].tobytes().decode() != self._bundle.scene:
                raise ArchiveError("this state was saved from another scene: open that scene to restore it")
            step, seed = saved["numbers"].astype(np.int64).tolist()
            self._bodies.check(saved)
            self._moving.load(saved)
        except ArchiveError:
            raise
        except (KeyError, ValueError, TypeError, IndexError) as error:
            raise ArchiveError(f"the saved state is incomplete ({error}); pass what `snapshot` returned") from error
        self._clock.start(step)
        self._seed = seed
        self._forget()
        self._bodies.load(saved)

    # ---- small parts

    def _placed(self, of: AnyBody) -> Placement:
        """Where a body stands."""
        if self._clock.step == 0:
            return AT_REST
        name = next(name for name, body in self.bodies.items() if body.body is of)
        return Placement.fitted(of.x_rest, self.frames()[name].x)

    def _event(self, kind: str, message: str, *details: Detail, count: int = 0) -> None:
        event = Event(self._clock.now(), EventKind(kind), message, list(details), count)
        self.events.append(event)
        if self._emit is not None:
            self._emit(event)


def _nobody(bundle: Bundle, setups: Mapping[str, Setup]) -> None:
    """Participants in other processes build bodies themselves."""
