"""One simulation: the clock, the tools, the seam and the regions, over any transport."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.seam import SeamSolver
from softseam_protocol.messages import (
    SCHEMA_VERSION,
    Advance,
    Advanced,
    BodyState,
    Bundle,
    Configure,
    Configured,
    Event,
    Fields,
    Frame,
    Header,
    Observe,
    Release,
    Reply,
    Request,
    Restore,
    Snapshot,
    SnapshotTaken,
    StepReport,
    ToolMotion,
)
from softseam_services.body.interpolate import model_functions
from softseam_services.orchestrator.accounts import Accounts
from softseam_services.orchestrator.archive import ArchiveError, pack, unpack
from softseam_services.orchestrator.drives import Drives
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.first_multiplier import first_multiplier
from softseam_services.orchestrator.near_cells import NearCells
from softseam_services.orchestrator.parts import parts_of, sum_replies
from softseam_services.orchestrator.probes import Probes
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.orchestrator.quantities import NEEDS_FIELDS, Quantities
from softseam_services.orchestrator.recovery import RecoveringTransport
from softseam_services.orchestrator.seam_loop import SeamDiverged, SeamLoop, SeamSolution, SeamUnsettled, SideRequest
from softseam_services.orchestrator.sides import NEAR, Sides, cut, merged_state, resting_state, whole_frame
from softseam_services.orchestrator.tie import tie_sides
from softseam_services.orchestrator.transport import Transport
from softseam_services.server import build_setup
from softseam_services.tools.motion import tool_motion

Floats = NDArray[np.float64]
Emit = Callable[[StepReport | Frame | Event], None]

_CHECKPOINT_STEPS = 50
_FREE = np.zeros((0, 3))
"""no forces, and no anchor"""
_KEPT = np.zeros((0, 0))
"""stands for the stiffness that the near side has"""
_PARTS = 4
"""of a step whose seam will not settle"""
_FIELDS_EVERY = 5
"""steps between looks at the fields for quantities that need them, where nobody asks for every frame"""


class StepFailed(RuntimeError):
    """A step could not be taken; the simulation stands at the last committed step and can be stepped again."""


class Simulation:
    """Steps one scene. Owns the clock, the tools' motion, the multipliers, the regions and the checkpoints.

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
        self._session = session
        self._emit = emit
        if isinstance(transport, EmbeddedTransport):
            transport.adopt(bundle, setup)
        self._transport = RecoveringTransport(transport, on_event=self._event)
        self._program = Program(self.scene, self.tools, self.body.x_rest)
        self._drives = Drives(self.scene, self.body, self._program)
        self._quantities = Quantities(self.body, self._program, self.scene.quantities)
        self._probes = Probes(self.body, self.scene.probes)
        self._wants_fields = bool(self.scene.probes) or not NEEDS_FIELDS.isdisjoint(self.scene.quantities)
        self._duration = self.scene.duration
        self._near = NearCells(self.scene, self.body, self.tools)
        self._seam = SeamSolver(tolerance=self.scene.seam.tolerance * float(self.body.edges.min()))
        self._accounts = Accounts()
        self._epoch = -1
        self._step = self._tick = 0
        self.events: list[Event] = []
        """events since the last reset, oldest first"""
        self.reset(self.scene.seed)

    # ---- state of the run

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self._step * self.scene.step

    @property
    def done(self) -> bool:
        """Whether the scene's duration, or without one its motion, is over."""
        if self._duration is not None:
            return self._step >= round(self._duration / self.scene.step)
        return self._program.done(self._progress)

    @property
    def expected_steps(self) -> int | None:
        """Steps of the whole run, where that can be foreseen."""
        length = self._duration if self._duration is not None else self._program.duration()
        return None if length is None else round(length / self.scene.step)

    @property
    def report(self) -> StepReport | None:
        """The last committed step's report; None before the first step."""
        return self._report

    def reset(self, seed: int | None = None) -> None:
        """Back to the start of the scene."""
        self._seed = self.scene.seed if seed is None else seed
        self._step = 0
        self._tick = 0  # steps that participants have taken; more than `_step` where steps were cut
        self._n_asked = -1
        self._ask_fields = False
        self._progress = Progress()
        self._drives.reset()
        self._position = self.tools.position.copy()
        self._orientation = self.tools.orientation.copy()
        self._lift_base = 0.0
        self._lifting = False
        self._crushed = 0
        self._report: StepReport | None = None
        self._frame: Frame | None = None
        self.events.clear()
        self._accounts.reset()
        self._near.reset()
        self._configure(resting_state(self.body), None)

    # ---- stepping

    def step(self, velocities: Mapping[str, Sequence[float]] | None = None, fields: bool = False) -> StepReport:
        """Advance by one step of the scene.

        velocities  of tools [m/s], with three more numbers also angular ones about their positions [rad/s]; tools left
                    out stand still. None follows the scene's motion.
        fields      also make a Frame (see `frame`)
        Raises StepFailed, ParticipantLost, and ValueError for velocities that are no such thing.
        """
        began = perf_counter()
        command = self._command(velocities)
        motion = tool_motion(self.tools, self._position, self._orientation, command, self.scene.step)
        self._accounts.begin(began)
        self._ask_fields = fields or (self._wants_fields and (self._step + 1) % _FIELDS_EVERY == 0)
        solution = self._solve(motion)
        replies = solution.replies
        first, *others = (reply.wrench for reply in replies.values())
        wrench = sum(others, first)
        self._position, self._orientation = motion.position_next, motion.orientation_next
        phase = -1 if self._program.done(self._progress) else self._progress.phase
        self._step += 1
        grip_force = self._quantities.grip_force(wrench, self._orientation)
        if velocities is None:
            self._drives.measured(wrench, self._orientation)
            self._progress = self._program.after(self._progress, self._position, self._orientation, grip_force)
        height = self._quantities.height(replies)
        self._follow_lift(command, height)
        frame = None
        self._frame = None
        if self._ask_fields or (self._wants_fields and self.done):
            frame = self._frame = self._gather(self._fields_of(replies), self._sides)
        quantities = self._quantities.measure(
            replies, grip_force, self._position, self._orientation, frame, height - self._lift_base
        )
        if frame is not None:
            quantities |= self._probes.measure(frame, self._near.model, self.scene.regions.default)
        header, sides = self._last_header(), self._sides
        switched = self._follow_tools(replies)
        if self._step % _CHECKPOINT_STEPS == 0:
            self._snapshot()
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
            done=self.done,
            command=command,
        )
        if switched is not None:
            self._accounts.switched(*switched)
        for alarm in self._accounts.raised:
            self._event("energy", f"step {self._step - 1}: {alarm.value}")
        crushed = sum(reply.n_crushed for reply in replies.values())
        if crushed and not self._crushed:
            self._event("cells", f"step {self._step - 1}: {crushed} cells are squeezed beyond half: full quadrature")
        self._crushed = crushed
        self._report = report
        if self._emit is not None:
            self._emit(report)
            if frame is not None:
                self._emit(frame)
        return report

    def frame(self) -> Frame:
        """The whole body as it stands."""
        if self._frame is None:
            self._frame = self._gather(self._observe(), self._sides)
        return self._frame

    # ---- snapshots

    def save(self) -> bytes:
        """State of the whole simulation; `load` continues from it bit for bit."""
        snapshots = self._snapshot()
        numbers = [self._step, self._progress.phase, self._progress.elapsed, self._lift_base, self._lifting, self._seed]
        entries: dict[str, NDArray[np.generic] | bytes] = {
            "scene": self._bundle.scene.encode(),
            "numbers": np.array(numbers, dtype=np.float64),
            "position": self._position,
            "orientation": self._orientation,
            "ledger": self._accounts.to_array(),
            "drives": self._drives.state,
        }
        entries.update({f"regions.{k}": v for k, v in self._near.to_arrays().items()})
        if self._loop is not None:
            entries.update({f"seam.{k}": v for k, v in self._loop.to_arrays().items()})
        entries.update({f"participant.{name}": snapshot.state for name, snapshot in snapshots.items()})
        return pack(entries)

    def load(self, state: bytes) -> None:
        """Continue from `save`. Raises ArchiveError where the state is not one of this scene."""
        entries = unpack(state)
        try:
            if entries["scene"].tobytes() != self._bundle.scene.encode():
                raise ArchiveError("this state was saved from another scene: open that scene to restore it")
            numbers = entries["numbers"]
            masks = {k[8:]: v.astype(np.int32) for k, v in entries.items() if k.startswith("regions.")}
            seam = {k[5:]: v.astype(np.float64) for k, v in entries.items() if k.startswith("seam.")}
            position, orientation = entries["position"], entries["orientation"]
            ledger = entries["ledger"]
            drives = entries["drives"].reshape(self._drives.state.shape)
        except (KeyError, ValueError, IndexError) as error:
            if isinstance(error, ArchiveError):
                raise
            raise ArchiveError(f"the saved state is incomplete ({error}); pass what `snapshot` returned") from error
        self._step, phase = int(numbers[0]), int(numbers[1])
        self._tick, self._n_asked = self._step, -1
        self._progress = Progress(phase, float(numbers[2]))
        self._lift_base, self._lifting, self._seed = float(numbers[3]), bool(numbers[4]), int(numbers[5])
        self._position, self._orientation = np.array(position), np.array(orientation)
        self._drives.state[:] = drives
        self._near.take(masks)
        self._report, self._frame = None, None
        self._accounts.from_array(ledger)
        self._configure(None, None)
        if self._loop is not None:
            self._loop.take(seam)
        restores: dict[str, Request] = {
            name: Restore(self._header(name), entries[f"participant.{name}"].tobytes()) for name in self._sides.names
        }
        self._exchange(restores)

    def close(self) -> None:
        """Release the participants and the transport."""
        self._release(self._sides.names)
        self._transport.close()

    # ---- one step

    def _solve(self, motion: ToolMotion) -> SeamSolution:
        """Advance all sides until they agree at the seam; where they will not, in parts of the step."""
        try:
            try:
                solution = self._advance(motion, self.scene.step, may_cut=True)
            except SeamUnsettled:
                return self._cut(motion)
        except SeamDiverged as error:
            raise StepFailed(f"step {self._step}: {error}") from error
        if solution.note:
            gap = f"gap {1e6 * solution.gap:.3g} um after {solution.exchanges} exchanges is kept"
            self._event("seam", f"step {self._step}: {gap}: {solution.note}")
        return solution

    def _advance(self, motion: ToolMotion, dt: float, may_cut: bool) -> SeamSolution:
        sides = self._sides

        def ask(wanted: dict[str, SideRequest]) -> dict[str, Advanced]:
            self._n_asked += 1
            requests: dict[str, Request] = {}
            for name, side in wanted.items():
                header = self._header(name, self._tick, self._n_asked)
                last = self._ask_fields and (self._n_asked > 0 or self._loop is None)  # it may well be
                anchor = _FREE if side.anchor is None else side.anchor
                stiffness = _KEPT if side.stiffness is None else side.stiffness
                requests[name] = Advance(header, dt, side.force, motion, side.compliance, anchor, stiffness, last)
            return self._advanced(self._exchange(requests))

        if self._loop is None:
            solution = SeamSolution(ask({name: SideRequest(_FREE) for name in sides.names}), _FREE, 0.0, 1, "")
        else:
            solution = self._loop.solve(ask, may_cut)
        self._tick += 1
        self._n_asked = -1
        return solution

    def _cut(self, motion: ToolMotion) -> SeamSolution:
        """Take the step in parts; each is committed by the next."""
        assert self._loop is not None
        self._loop.change_step()
        parts = [self._advance(part, self.scene.step / _PARTS, may_cut=False) for part in parts_of(motion, _PARTS)]
        self._loop.change_step()
        gap, exchanges = parts[-1].gap, sum(part.exchanges for part in parts)
        text = f"step {self._step}: taken in {_PARTS} parts, {exchanges} exchanges, gap {1e6 * gap:.3g} um"
        self._event("seam", f"{text}{': ' if parts[-1].note else ''}{parts[-1].note}")
        return SeamSolution(sum_replies([part.replies for part in parts]), parts[-1].lambda_, gap, exchanges, "")

    def _advanced(self, replies: Mapping[str, Reply]) -> dict[str, Advanced]:
        found = {}
        for name, reply in replies.items():
            assert isinstance(reply, Advanced)
            if reply.status != "converged":
                if not math.isfinite(reply.kinetic):
                    raise StepFailed(f"step {self._step}, {name} ({self._sides.models[name]}): {reply.status}")
                self._event("solver", f"step {self._step}, {name} ({self._sides.models[name]}): {reply.status}")
            found[name] = reply
            self._accounts.spent(self._sides.models[name], reply.seconds)
        return found

    def _command(self, velocities: Mapping[str, Sequence[float]] | None) -> Floats:
        if velocities is None:
            command = self._program.velocities(self._progress, self._position, self._orientation)
            self._drives.apply(command, self._progress, self._orientation)
            return command
        command = np.zeros((len(self.tools.names), 6))
        for name, velocity in velocities.items():
            if name not in self.tools.names:
                raise ValueError(f"no tool is called {name!r}; the scene has: {', '.join(self.tools.names) or 'none'}")
            value = np.asarray(velocity, dtype=np.float64)
            if value.shape not in ((3,), (6,)) or not np.isfinite(value).all():
                raise ValueError(
                    f"the velocity of {name!r} must be three finite numbers [m/s], or six with its turning [rad/s], "
                    f"not {velocity!r}"
                )
            command[self.tools.names.index(name), : len(value)] = value
        return command

    def _follow_lift(self, command: Floats, height: float) -> None:
        """The lift is measured from where the body was before a tool first rises; height of this step [m]."""
        self._lifting = self._lifting or max(command[:, 2].tolist(), default=0.0) > 0.0
        if not self._lifting:
            self._lift_base = height

    # ---- regions

    def _follow_tools(self, replies: Mapping[str, Advanced]) -> tuple[float, float] | None:
        """Let the regions follow the tools; what a switch did (see `_switch`), None where there was none."""
        reason = self._near.follow(self._sides, replies)
        if not reason:
            return None
        done = self._switch()
        self._event("regions", reason)
        return done

    def set_near(self, near: NDArray[np.bool_]) -> float:
        """Cut the body by hand: cells (C,) that are near from now on; returns the kinetic energy change [J]."""
        self._near.mask = near
        kinetic_change, strain = self._switch()
        self._accounts.switched(kinetic_change, strain)
        return kinetic_change

    def _switch(self) -> tuple[float, float]:
        """Cut the body anew; by how much that changed the kinetic energy, and the strain energy from now on [J]."""
        old, fields = self._sides, self._observe()
        state, kinetic_change = merged_state(self.body, old, fields)
        cauchy = np.empty((self.body.n_cells, 8, 6))
        for name, side in fields.items():
            cauchy[old.cells[name]] = side.cauchy
        strain = self._configure(state, cauchy)
        self._release(set(old.names) - set(self._sides.names))
        self._frame = None
        return kinetic_change, strain

    def _configure(self, state: BodyState | None, cauchy: Floats | None) -> float:
        """Build both sides for the present cut in a new epoch; their strain energy [J].

        cauchy (C, 8, 6) as the body stands, None for none.
        """
        self._epoch += 1
        self._sides: Sides = cut(self.body, self._near.mask, self._near.model, self.scene.regions.default)
        sides = self._sides
        replies = self._exchange(
            {
                name: Configure(
                    self._header(name),
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
        self._loop = None
        if len(sides.seam):
            functions = model_functions(self.scene.models)
            tie = tie_sides(self.body, sides, self._near.neighbours, functions)
            first = None
            if state is not None and cauchy is not None:
                first = first_multiplier(self.body, sides, state, cauchy, tie, functions)
            condensable = sides.models[NEAR] == "fem"
            self._loop = SeamLoop(
                self._seam, tie, len(sides.seam), first, condensable, max(self.scene.seam.exchanges, 1)
            )
        return sum(reply.strain for reply in replies.values() if isinstance(reply, Configured))

    def _release(self, names: Sequence[str] | set[str]) -> None:
        if names:
            self._exchange({name: Release(self._header(name)) for name in sorted(names)})

    # ---- messages

    def _header(self, participant: str, step: int | None = None, exchange: int = 0) -> Header:
        at = step
        if at is None:
            at = self._tick if participant else self._step
        return Header(SCHEMA_VERSION, self._session, participant, self._epoch, at, exchange, self.time)

    def _last_header(self) -> Header:
        """Names the last step by its number and the time at its start."""
        at = max(self._step - 1, 0)
        return Header(SCHEMA_VERSION, self._session, "", self._epoch, at, 0, at * self.scene.step)

    def _exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        began = perf_counter()
        replies = self._transport.exchange(requests)
        self._accounts.exchanged(perf_counter() - began, replies)
        return replies

    def _fields_of(self, replies: Mapping[str, Advanced]) -> dict[str, Fields]:
        """Fields that came with the last replies, or that are asked for now."""
        found = {name: reply.fields for name, reply in replies.items() if reply.fields is not None}
        return found if len(found) == len(replies) else self._observe()

    def _observe(self) -> dict[str, Fields]:
        replies = self._exchange({name: Observe(self._header(name)) for name in self._sides.names})
        return {name: reply for name, reply in replies.items() if isinstance(reply, Fields)}

    def _snapshot(self) -> dict[str, SnapshotTaken]:
        if self._loop is not None:
            self._loop.forget_told()
        replies = self._exchange({name: Snapshot(self._header(name)) for name in self._sides.names})
        return {name: reply for name, reply in replies.items() if isinstance(reply, SnapshotTaken)}

    def _gather(self, fields: Mapping[str, Fields], sides: Sides) -> Frame:
        multiplier = np.zeros((len(sides.seam), 3)) if self._loop is None else self._loop.multiplier()
        return whole_frame(
            self._last_header(),
            self.body,
            sides,
            fields,
            self._near.mask,
            multiplier,
            self._position,
            self._orientation,
        )

    def _event(self, kind: str, message: str) -> None:
        event = Event(self._header(""), kind, message)
        self.events.append(event)
        if self._emit is not None:
            self._emit(event)
