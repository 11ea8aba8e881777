"""The simulation in this process: no bus, no other process. Loads the solvers when a session opens, not before."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softseam import checks
from softseam.errors import BadInput, BadSnapshot, SceneRefused, SimulationFailed, missing_extra
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind, FailureKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Recorded, SurfaceMesh
from softseam_protocol.messages.session import ErrorEstimate, Event, Frame, Observation, StepReport
from softseam_protocol.models import ModelKind, that
from softseam_protocol.scene.command import Command
from softseam_protocol.scene.consistency import candidates
from softseam_protocol.scene.file import SceneError, scene_from_bundle
from softseam_protocol.scene.scene import Scene

if TYPE_CHECKING:
    from softseam.gradient import Asked, Floats, Gradient
    from softseam_services.calibration.measure import Shown, Wanted
    from softseam_services.described import Described
    from softseam_services.orchestrator.faults import FaultyTransport
    from softseam_services.orchestrator.gradient import Pulled
    from softseam_services.orchestrator.preview import Preview
    from softseam_services.orchestrator.rollout import Rollout
    from softseam_services.orchestrator.simulation import Simulation
    from softseam_services.orchestrator.transport import Transport
    from softseam_services.recorder.recorder import McapRecorder

    Calibration = tuple[Wanted, list[Shown], Shown | None]

Message = StepReport | Frame | Event
SIMULATING = "simulating in this process"


class EmbeddedBackend:
    """Runs FEM, PBD and the orchestrator by direct calls, and records from here if asked."""

    def __init__(self, bundle: Bundle, *, record: Path | None = None) -> None:
        with translated(purpose=SIMULATING):
            from softseam_services.orchestrator import client_view
            from softseam_services.tables import check_tables
        self._view = client_view  # of steps: to import it in each would take as long as a message
        self._events: list[Event] = []
        self._bundle = bundle
        self._record = record
        self._recorder: McapRecorder | None = None
        self._last: StepReport | None = None
        self.recorded: Recorded | None = None
        self.unrecorded = ""
        with translated(opening=True):
            check_tables()
            self.simulation = compiled(scene_from_bundle(bundle), lambda: simulate(bundle, self._emit))

    def doubts(self, scene: Scene) -> list[str]:
        from softseam_services.checks import doubts, size_of

        setups = {name: one.setup for name, one in self.simulation.bodies.items()}
        with translated():
            return checks.doubts(scene, {name: (size_of(setup), doubts(setup)) for name, setup in setups.items()})

    def reset(self, seed: int, bundle: Bundle | None = None) -> Observation:
        self._stop_recording()
        self._last = None
        with translated(opening=bundle is not None):
            if bundle is None:
                self.simulation.reset(seed)
            else:
                self.simulation = compiled(scene_from_bundle(bundle), lambda: self.simulation.with_scene(bundle, seed))
                self._bundle = bundle
        self._events.clear()
        if self._record is not None:
            self._start_recording(self._record, seed)
        seen = self._observation(fields=True)
        for frame in seen.frames.values():
            self._emit(frame)
        return seen

    def step(self, count: int, velocities: Mapping[str, Vector3] | None, fields: bool) -> Observation:
        recording = self._recorder is not None
        with translated():
            for remaining in range(count, 0, -1):
                try:
                    self._last = self.simulation.step(velocities, fields=recording or (fields and remaining == 1))
                except self._view.FAILURES as error:
                    raise self._view.counted(error, count - remaining, count) from error.__cause__
        return self._observation(fields, taken=True)

    def follow(self, most: int | None) -> list[Observation]:
        return [self.step(1, None, fields=False)]

    def save(self) -> bytes:
        with translated():
            return self._view.snapshot(self.simulation, self._last)

    def load(self, state: bytes) -> Observation:
        with translated():
            self._last = self._view.restore(self.simulation, state)
        return self._observation(fields=True)

    def estimate(self) -> ErrorEstimate | None:
        with translated():
            return self.simulation.estimate()

    def surface_meshes(self) -> Mapping[str, SurfaceMesh]:
        return surfaces(self._bundle, self.simulation)

    def differentiate(self, asked: Asked) -> tuple[Gradient, Observation]:
        from softseam.differentiating import differentiate

        if self._record is not None:
            raise BadInput("a gradient begins the run anew, which a recording does not show: open without record")
        compile_models(that(lambda facts: facts.gives_derivatives))
        tell_of_derivatives()
        with translated():
            gradient = differentiate(self.simulation, asked)
        self._last = self.simulation.report
        return gradient, self._observation(fields=True, taken=True)

    def close(self) -> None:
        try:
            self.simulation.close()
        finally:
            self._stop_recording()
        if self._record is not None and self.recorded is None:
            self.unrecorded = "the session ended before it was reset"

    def _observation(self, fields: bool, taken: bool = False) -> Observation:
        with translated():
            return self._view.observation(self.simulation, self._last, fields=fields, taken=taken, events=self._events)

    def _emit(self, message: Message) -> None:
        if isinstance(message, Event):
            self._events.append(message)
        if self._recorder is not None:
            self._recorder.write(message)

    def _start_recording(self, path: Path, seed: int) -> None:
        from softseam_services.recorder.begin import begin
        from softseam_services.recorder.recorder import McapRecorder

        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadInput(f"cannot make the folder of {path}: {error.strerror}") from error
        with translated():
            bodies = {name: one.body for name, one in self.simulation.bodies.items()}
            start = begin(self._bundle, bodies, self.simulation.tools, seed=seed)
            self._recorder = McapRecorder(path, start, existing="replace", on_loss=self._tell_loss)

    def _stop_recording(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            self.recorded = recorder.close()

    def _tell_loss(self, reason: str) -> None:
        """A recording that loses messages is an event of the next observation; the run goes on."""
        header = Header(SCHEMA_VERSION, "local", "", 0, 0, 0, self.simulation.time)
        self._events.append(Event(header, EventKind.RECORDING, reason))


def simulate(bundle: Bundle, emit: Callable[[Message], None], transport: Transport | None = None) -> Simulation:
    """A simulation at the start of a scene, whose participants are in this process unless `transport` has others.

    Raises what the services raise.
    """
    from softseam_services.orchestrator.embedded import EmbeddedTransport
    from softseam_services.orchestrator.simulation import Simulation

    return Simulation(bundle, transport or EmbeddedTransport(), emit=emit)


def faulty(fault: str, every: int) -> FaultyTransport:
    """A transport for `simulate` that does harm to each so-many-th request for a step; what: see there."""
    from softseam_services.orchestrator.faults import FaultyTransport

    return FaultyTransport(fault, every)


def surfaces(bundle: Bundle, simulation: Simulation) -> Mapping[str, SurfaceMesh]:
    """Surfaces of a scene's bodies, as a recording of it begins with."""
    from softseam_services.recorder.begin import begin

    bodies = {name: one.body for name, one in simulation.bodies.items()}
    return begin(bundle, bodies, simulation.tools).surfaces


def compiled(scene: Scene, build: Callable[[], Simulation]) -> Simulation:
    """A simulation with all compiled that its steps will need. Beside the building what no process has compiled yet on
    this machine is: of each body the first model that it may have, and once it is known which it has, these alone."""
    from softseam_services.warm_up import Beside, load_kernels

    with Beside() as beside:
        first = {_first_model(scene.of(name)) for name, body in scene.bodies.items() if body.has_cells}
        if beside.begin(first, "--whole") and sys.stderr.isatty():
            print("compiling the solvers for this machine, once: half a minute or so", file=sys.stderr)
        simulation = build()
        needed: dict[str, Scene] = {}
        for body in (each for each in simulation.bodies.values() if each.body.has_cells):
            derives = () if body.scene.regions.goal is None else that(lambda facts: facts.gives_derivatives)
            needed |= dict.fromkeys([*body.participants.parts.models.values(), *derives], body.scene)
        beside.begin(needed)
        beside.wait(needed)
        for model, one in needed.items():
            load_kernels(model, one)
    return simulation


def _first_model(scene: Scene) -> ModelKind:
    """The model of near cells where there are such, else that of all."""
    near = candidates(scene)[0].regions.models[1]
    assert near is not None  # candidates name one
    return near


def compile_models(models: Iterable[ModelKind]) -> None:
    """Compile of these models what no process has compiled yet on this machine. Raises MissingExtra."""
    with translated(purpose=SIMULATING):
        from softseam_services.warm_up import Beside
    with Beside() as beside:
        if beside.begin(models) and sys.stderr.isatty():
            print("compiling the solvers for this machine, once: a minute or so", file=sys.stderr)
        beside.wait(models)


def tell_of_derivatives() -> None:
    """Say that those of steps are compiled first, where no process has done it yet on this machine."""
    from softseam_services.warm_up import never_compiled

    able = that(lambda facts: facts.gives_derivatives)
    if any(never_compiled(model, "step_derivative") for model in able) and sys.stderr.isatty():
        print("compiling the derivatives of steps for this machine, once: half a minute", file=sys.stderr)


@contextmanager
def compile_clock() -> Iterator[Callable[[], tuple[float, float]]]:
    """How much wall and processor time [s] numba has spent on kernels since the context began, when asked."""
    with translated(purpose=SIMULATING):
        from softseam_services.jit.compile_clock import CompileClock
    with CompileClock() as clock:
        yield lambda: (clock.wall_so_far, clock.cpu)


def solver_digest() -> str:
    """Digest of every source that a simulation's numbers may depend on: with another digest, perhaps other numbers."""
    with translated(purpose=SIMULATING):
        from softseam_services.source_digest import source_digest

        return source_digest()


def describe(bundle: Bundle) -> dict[str, Described]:
    """What the bodies of a scene are before anything is simulated. Raises SceneRefused."""
    with translated(purpose="checking a mesh"):
        from softseam_services import described

        return described.describe(bundle)


def conditions(bundle: Bundle, start: Mapping[str, Frame], end: Mapping[str, Frame]) -> dict[str, Any]:
    """Condition numbers of the bodies that XPBD moves, from their fields at the start and at the end of a run."""
    with translated(purpose="condition numbers"):
        from softseam_services.pbd import condition

        return condition.conditions(bundle, start, end)


def calibration(scene: Scene, bundle: Bundle, tolerance: float, kept: Mapping[str, Any] | None) -> Calibration:
    """What XPBD should show of a scene's body, what settings show, measured or as it was `kept` (`asdict` of both), and
    the cheapest setting within the tolerance. Raises SceneRefused and BadInput."""
    with translated(purpose="calibrating, which simulates in this process,"):
        from softseam_services.calibration.measure import Shown, Wanted, calibrate, cheapest
        from softseam_services.server import build_setup

        if kept is not None:
            wanted, shown = Wanted(**kept["wanted"]), [Shown(**each) for each in kept["shown"]]
            return wanted, shown, cheapest(shown, tolerance)
        body = build_setup(bundle).body
        if not body.has_cells:
            raise BadInput(
                f"the scene {scene.name!r} is a sheet or a rope: its springs have no Young's modulus to calibrate"
            )
        try:
            wanted, shown = calibrate(scene, body, tolerance)
        except ValueError as error:
            raise BadInput(str(error)) from None
        return wanted, shown, cheapest(shown, tolerance)


def preview(bundle: Bundle) -> tuple[Scene, Preview]:
    """A scene, and where its motion takes its tools. Raises SceneRefused."""
    with translated(purpose="drawing a scene"):
        from softseam_services.orchestrator.preview import preview
        from softseam_services.server import build_setup

        scene = scene_from_bundle(bundle)
        setups = {name: build_setup(bundle, name) for name in scene.bodies}
        tools = next(iter(setups.values())).tools
        return scene, preview(scene, {name: setup.body for name, setup in setups.items()}, tools)


def roll_out(simulation: Simulation, commands: Sequence[Command] | None, steps: int | None) -> Rollout:
    """A run from the start of the scene, of which every step is kept. Raises what the services raise."""
    from softseam_services.orchestrator import rollout

    return rollout.roll_out(simulation, commands, steps)


def pull(simulation: Simulation, run: Rollout, force: Floats, positions: Floats, near: float) -> Pulled:
    """Derivatives of a loss, from those by forces on tools and by positions."""
    from softseam_services.orchestrator import gradient

    return gradient.pull(simulation, run, force, positions, near)


def push(simulation: Simulation, run: Rollout, directions: Sequence[tuple[float, Mapping[str, float]]]) -> Floats:
    """How forces on tools change along directions; see `differentiating`."""
    from softseam_services.orchestrator import gradient

    return gradient.push(simulation, run, [gradient.Direction(*each) for each in directions])


def halt(on: bool) -> None:
    """Whether solvers that the main thread made, where there are any, are to return at their next iteration."""
    try:
        from softseam_services.halt import HALT
    except ImportError:
        return
    HALT[0] = on


class translated:  # reads as the function that it is used as
    """A context that turns what the services raise into the client's errors.

    opening  what a participant finds wrong is the scene's
    purpose  what the services are imported for in it, which MissingExtra names where this installation lacks them
    """

    def __init__(self, opening: bool = False, purpose: str = "") -> None:
        self._opening, self._purpose = opening, purpose

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, ImportError) and self._purpose:
            raise missing_extra(error, self._purpose) from error
        if error is not None:
            _translate(error, self._opening)


def _translate(error: BaseException, opening: bool) -> None:
    """Raise the client's error for one of the services; return for any other."""
    from softseam_protocol.table import MissingRow
    from softseam_services.body.errors import MeshError, RowError, SettingError, ToolError
    from softseam_services.orchestrator.archive import ArchiveError
    from softseam_services.orchestrator.coupling import Unsuited
    from softseam_services.orchestrator.part_client import StepFailed
    from softseam_services.orchestrator.rollout import NotDifferentiable
    from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost
    from softseam_services.recorder.whole_file import RecordError

    refused = opening and isinstance(error, ParticipantFailed) and error.failure.kind == FailureKind.INVALID
    if refused or isinstance(error, SceneError | MeshError | ToolError | SettingError):
        raise SceneRefused(str(error)) from error
    if isinstance(error, MissingRow | RowError | NotDifferentiable | Unsuited):
        raise BadInput(str(error)) from error
    if isinstance(error, ArchiveError):
        raise BadSnapshot(str(error)) from error
    if isinstance(error, RecordError):
        raise BadInput(str(error)) from error
    if isinstance(error, StepFailed | ParticipantLost | ParticipantFailed):
        raise SimulationFailed(str(error)) from error
