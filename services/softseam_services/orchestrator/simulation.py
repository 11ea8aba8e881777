"""One simulation: the scene's clock and motion, what each step measures, and its state in a few bytes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import Detail, EventKind
from softseam_protocol.messages.participant import Advanced, Bundle
from softseam_protocol.messages.session import ErrorEstimate, Event, Frame, StepReport
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.accounts import Accounts
from softseam_services.orchestrator.archive import ArchiveError
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.drives import Drives
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.grip import grips_by_phase
from softseam_services.orchestrator.notices import Notices
from softseam_services.orchestrator.probes import Probes
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.orchestrator.quantities import Quantities
from softseam_services.orchestrator.recovery import RecoveringTransport
from softseam_services.orchestrator.regions import Regions
from softseam_services.orchestrator.saved_state import SavedState
from softseam_services.orchestrator.sides import resting_state
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost, Transport
from softseam_services.orchestrator.trust import Trust
from softseam_services.server import build_setup
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.travel import beyond_middle

T = TypeVar("T")
Floats = NDArray[np.float64]
Emit = Callable[[StepReport | Frame | Event], None]

_CHECKPOINT_STEPS = 50
_FIELDS_EVERY = 5
"""steps between looks at the fields for quantities that need them, where nobody asks for every frame"""
_FARTHEST = 100.0
"""way of a tool in a step beyond which nobody meant it [m]"""


class Simulation:
    """Steps one scene. Owns the clock, the tools' motion, the regions and the checkpoints.

    bundle     the scene and its files
    transport  how to reach the participants; closed with the simulation
    session    names this simulation among others on the same bus
    emit       receives every StepReport and Event, and a Frame a step where `fields` are asked for
    """

    def __init__(
        self, bundle: Bundle, transport: Transport, *, session: str = "local", emit: Emit | None = None
    ) -> None:
        setup = build_setup(bundle)
        self.scene, self.body, self.tools = setup.scene, setup.body, setup.tools
        self._bundle = bundle
        self._emit = emit
        if isinstance(transport, EmbeddedTransport):
            transport.adopt(bundle, setup)
        grips = grips_by_phase(self.scene, self.tools, self.body.x_rest)
        self._drives = Drives(self.scene, self.body, grips)
        self._program = Program(self.scene.motion, self.scene.step, self.tools, grips, self._drives.phases)
        self._quantities = Quantities(self.body, self._program, self.scene.quantities)
        self._probes = Probes(self.body, self.scene.probes) if isinstance(self.body, Body) else None
        self._wants_fields = bool(self.scene.probes) or self._quantities.need_fields
        self._wants_indicators = self._quantities.need_indicators
        self._duration = self.scene.duration
        self._trust = Trust(self.body, self.scene)
        self._notices = Notices(self.scene, self._event)
        self._clock = Clock(session, self.scene.step)
        self._accounts = Accounts(self.scene.step, _standing(self.body))
        recovering = RecoveringTransport(transport, on_event=self._event)
        self._regions = Regions(bundle, setup, recovering, self._clock, self._accounts, self._event)
        self._participants = self._regions.participants
        self.events: list[Event] = []
        """events since the last reset, oldest first"""
        self.reset(self.scene.seed)

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
        return self._program.done(self._progress)

    @property
    def expected_steps(self) -> int | None:
        """Steps of the whole run, where that can be foreseen."""
        length = self._duration if self._duration is not None else self._program.duration()
        return None if length is None else math.ceil(length / self.scene.step - 1e-6)

    @property
    def report(self) -> StepReport | None:
        """The last committed step's report; None before the first step."""
        return self._report

    @property
    def regions(self) -> Regions:
        """The body as it is cut, and who holds it."""
        return self._regions

    def reset(self, seed: int | None = None) -> None:
        """Back to the start of the scene."""
        self._seed = self.scene.seed if seed is None else seed
        self._clock.start(0)
        self._progress = Progress()
        self._drives.reset()
        self._position = self.tools.position.copy()
        self._orientation = self.tools.orientation.copy()
        self._gripping = np.zeros(len(self.tools.names), dtype=np.int8)
        self._lift_base = 0.0
        self._lifting = False
        self._forget()
        self._trust.reset()
        self.events.clear()
        self._accounts.reset()
        self._accounts.begun = self._regions.start(resting_state(self.body))

    def _forget(self) -> None:
        """The last step is another's."""
        self._notices.forget()
        self._report: StepReport | None = None
        self._frame: Frame | None = None
        self._unseen = False  # its fields were asked for, and lost

    # ---- stepping

    def step(self, velocities: Mapping[str, Sequence[float]] | None = None, fields: bool = False) -> StepReport:
        """Advance by one step of the scene.

        velocities  of tools [m/s], with three more numbers also angular ones about their positions [rad/s]; tools left
                    out stand still; a seventh makes the tool hold the particles within reach (1), or let go (0).
                    None follows the scene's motion.
        fields      also make a Frame (see `frame`)
        Raises StepFailed, ParticipantLost, and ValueError for velocities that are no such thing.
        """
        began = perf_counter()
        ongoing = not self.done
        if velocities is None:
            command, progress = self._program.step(self._progress, self._position, self._orientation)
            self._drives.apply(command, self._progress, self._orientation)
            gripping = self._program.gripping(self._progress, self._gripping)
        else:
            command, gripping = self._commanded(velocities)
            progress = self._progress
        motion = tool_motion(self.tools, self._position, self._orientation, command, self.scene.step)
        if any(gripping.tolist()):
            motion = replace(motion, gripping=gripping.copy())
        self._accounts.begin(began)
        too_far = beyond_middle(self.tools, motion)
        look = fields or (self._wants_fields and (self._clock.step + 1) % _FIELDS_EVERY == 0)
        solution = self._participants.advance(motion, look)
        replies = solution.replies
        first, *others = (reply.wrench for reply in replies.values())
        wrench = sum(others, first)
        self._position, self._orientation, self._gripping = motion.position_next, motion.orientation_next, gripping
        self._clock.step += 1
        grip_force = self._quantities.grip_force(wrench, self._orientation)
        if velocities is None:
            self._drives.measured(wrench, self._orientation)
        if progress is None:
            closing = self._program.closing_force(self._progress, wrench, self._orientation)
            progress = self._program.after(self._progress, self._position, self._orientation, closing)
            missed = self._program.missed(self._progress, closing) if progress.phase > self._progress.phase else ""
            if missed:
                self._event("force", f"step {self._clock.step - 1}: {missed}")
        phase = self._program.phase_of(self._progress, progress)
        phase_ends = progress.phase > self._progress.phase
        self._progress = progress
        height = self._quantities.height(replies)
        self._follow_lift(command, height)
        frame = None
        asked = look or (self._wants_fields and self.done)
        if asked:
            indicators = self._wants_indicators
            frame = self._told(lambda: self._regions.frame(replies, self._position, self._orientation, indicators))
        self._frame, self._unseen = frame, asked and frame is None
        quantities = self._quantities.measure(
            replies, grip_force, self._position, self._orientation, frame, height - self._lift_base
        )
        if frame is not None:
            if self._probes is not None:
                quantities |= self._probes.measure(frame, self._regions.near.model, self.scene.regions.default)
        header, sides = self._clock.last_step(), self._regions.sides
        switched = self._told(lambda: self._regions.follow(replies, motion))
        if self._clock.step % _CHECKPOINT_STEPS == 0:
            self._told(self._participants.snapshot)
        done, estimate = self.done, None
        if velocities is None and ongoing and (phase_ends or done):
            estimate = self._told(lambda: self._judge(replies, done))
        report = self._accounts.report(
            header=header,
            sides=sides,
            replies=replies,
            phase=phase,
            tool_position=self._position.copy(),
            tool_orientation=self._orientation.copy(),
            wrench=wrench,
            quantities=quantities,
            seam=solution,
            done=done,
            command=command,
            gripping=motion.gripping,
            estimate=estimate,
        )
        if switched is not None:
            self._frame = None
            self._accounts.switched(switched)
        met = self._program.met(quantities["compression"])
        self._notices.follow(self._clock.step - 1, replies, self._accounts.raised, estimate, too_far, met)
        self._report = report
        if self._emit is not None:
            self._emit(report)
            if frame is not None:
                self._emit(frame)
        return report

    def at_rest(self, frame: Frame | None) -> dict[str, float]:
        """Quantities before the first step; those that need fields only with a frame."""
        found = self._quantities.at_rest(self.tools.position, self.tools.orientation, frame)
        return found if self._probes is None else found | self._probes.at_rest()

    def frame(self) -> Frame:
        """The whole body as it stands."""
        if self._frame is None:
            self._frame = self._regions.frame({}, self._position, self._orientation, self._wants_indicators)
        return self._frame

    def seen(self) -> Frame | None:
        """The whole body after the last step; None, and told, where a participant is lost: the step counts then, too.

        What the step itself waited for in vain is not waited for again.
        """
        return None if self._unseen and self._frame is None else self._told(self.frame)

    def estimate(self) -> ErrorEstimate | None:
        """How far the answer may be off as the body stands; None of a body of particles."""
        if not isinstance(self.body, Body):
            return None
        fields = self._participants.observe(indicators=True, own=True)
        goal = self._regions.goal_error(fields, self._position, self._orientation)
        return self._trust.now(self.time, self._regions.sides, fields, goal)

    def set_near(self, near: NDArray[np.bool_]) -> float:
        """Cut the body by hand: cells (C,) that are near from now on; returns the kinetic energy change [J]."""
        energies = self._regions.set_near(near)
        self._frame = None
        return self._accounts.switched(energies)

    def close(self) -> None:
        """Release the participants and the transport."""
        self._participants.close()

    # ---- snapshots

    def save(self) -> bytes:
        """State of the whole simulation; `load` continues from it bit for bit."""
        participants = self._participants.snapshot()
        state = SavedState(
            scene=self._bundle.scene,
            step=self._clock.step,
            progress=self._progress,
            lift_base=self._lift_base,
            lifting=self._lifting,
            seed=self._seed,
            position=self._position,
            orientation=self._orientation,
            ledger=self._accounts.ledger,
            begun=self._accounts.begun,
            drives=self._drives.state,
            gripping=self._gripping,
            trust=self._trust.to_array(),
            cells=self._regions.near_arrays(),
            seam=self._participants.seam_arrays(),
            participants=participants,
        )
        return state.pack()

    def load(self, state: bytes) -> None:
        """Continue from `save`. Raises ArchiveError, and has changed nothing, where that is no state of this scene."""
        saved = SavedState.unpack(state)
        if saved.scene != self._bundle.scene:
            raise ArchiveError("this state was saved from another scene: open that scene to restore it")
        near, trust = self._regions.near_arrays(), self._trust.to_array()
        try:
            position = saved.position.reshape(self._position.shape)
            orientation = saved.orientation.reshape(self._orientation.shape)
            drives = saved.drives.reshape(self._drives.state.shape)
            gripping = saved.gripping.reshape(self._gripping.shape)
            self._regions.take_near(saved.cells)
            self._trust.take(saved.trust)
            tied = self._regions.tied(saved.seam)
        except (KeyError, ValueError, IndexError) as error:
            self._regions.take_near(near)
            self._trust.take(trust)
            raise ArchiveError(f"the saved state is incomplete ({error}); pass what `snapshot` returned") from error
        self._clock.start(saved.step)
        self._progress, self._seed = saved.progress, saved.seed
        self._lift_base, self._lifting = saved.lift_base, saved.lifting
        self._position, self._orientation = position, orientation
        self._drives.state[:] = drives
        self._gripping = gripping
        self._accounts.ledger, self._accounts.begun = saved.ledger, saved.begun
        self._forget()
        self._participants.restore(tied, saved.participants)

    # ---- parts of a step

    def _commanded(self, velocities: Mapping[str, Sequence[float]]) -> tuple[Floats, NDArray[np.int8]]:
        """What tools do (t, 6) [m/s, rad/s], and 1 for those that hold particles (t,)."""
        command = np.zeros((len(self.tools.names), 6))
        gripping = self._gripping.copy()
        for name, velocity in velocities.items():
            if name not in self.tools.names:
                raise ValueError(f"no tool is called {name!r}; the scene has: {', '.join(self.tools.names) or 'none'}")
            value = np.asarray(velocity, dtype=np.float64)
            if value.shape not in ((3,), (6,), (7,)) or not np.isfinite(value).all():
                raise ValueError(
                    f"the velocity of {name!r} must be three finite numbers [m/s], or six with its turning [rad/s], "
                    f"or seven with its grip (1 or 0), not {velocity!r}"
                )
            if np.abs(value[:3]).max() * self.scene.step > _FARTHEST:
                raise ValueError(
                    f"the velocity of {name!r} is {value.tolist()}, more than {_FARTHEST:g} m in a step: give m/s"
                )
            if len(value) == 7 and value[6] != 0.0 and isinstance(self.body, Body):
                raise ValueError(
                    f"the velocity of {name!r} has a grip, its seventh number: tools grip particles only, and this "
                    "body is of cells, which friction holds: give six"
                )
            tool = self.tools.names.index(name)
            command[tool, : len(value[:6])] = value[:6]
            if len(value) == 7:
                gripping[tool] = value[6] != 0.0
        return command, gripping

    def _told(self, act: Callable[[], T]) -> T | None:
        """What follows a step that is taken: where a participant is lost in it, that is told, and the step counts."""
        try:
            return act()
        except (ParticipantLost, ParticipantFailed) as error:
            self._event("lost", f"step {self._clock.step - 1} is taken, but what follows it was not done: {error}")
            return None

    def _follow_lift(self, command: Floats, height: float) -> None:
        """The lift is measured from where the body was before a tool first rises; height of this step [m]."""
        self._lifting = self._lifting or max(command[:, 2].tolist(), default=0.0) > 0.0
        if not self._lifting:
            self._lift_base = height

    def _judge(self, replies: Mapping[str, Advanced], done: bool) -> ErrorEstimate | None:
        """Look at the errors where that is due, as a phase ends; how far the run can be trusted, where it is done."""
        if self._trust.due(sum(reply.strain for reply in replies.values()), done):
            fields = self._participants.observe(indicators=True, own=True)
            goal = self._regions.goal_error(fields, self._position, self._orientation)
            self._trust.look(self.time, self._regions.sides, fields, goal)
        return self._trust.estimate() if done else None

    def _event(self, kind: str, message: str, *details: Detail, count: int = 0) -> None:
        event = Event(self._clock.now(), EventKind(kind), message, list(details), count)
        self.events.append(event)
        if self._emit is not None:
            self._emit(event)


def _standing(body: AnyBody) -> float:
    """Weight of a body in cells times the height of its centre above its lowest node, against gravity, at rest [J]."""
    if not isinstance(body, Body):
        return 0.0
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    height = -(body.x_rest @ body.gravity)
    return float(mass @ (height - height.min()))
