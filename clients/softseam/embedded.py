"""The simulation in this process: no bus, no other process. Loads the solvers when a session opens, not before."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING

import softseam_protocol
from softseam.errors import BadInput, BadSnapshot, SceneRefused, SimulationFailed, missing_extra
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind, FailureKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Recorded, SurfaceMesh
from softseam_protocol.messages.session import ErrorEstimate, Event, Frame, Observation, StepReport
from softseam_protocol.models import ModelKind, that
from softseam_protocol.scene.consistency import candidates
from softseam_protocol.scene.file import SceneError, scene_from_bundle
from softseam_protocol.scene.scene import Scene

if TYPE_CHECKING:
    from softseam.gradient import Gradient
    from softseam.losses import Loss
    from softseam_services.orchestrator.simulation import Simulation
    from softseam_services.recorder.recorder import McapRecorder

Message = StepReport | Frame | Event


class EmbeddedBackend:
    """Runs FEM, PBD and the orchestrator by direct calls, and records from here if asked."""

    def __init__(self, bundle: Bundle, *, record: Path | None = None) -> None:
        try:
            from softseam_services.orchestrator import client_view
            from softseam_services.orchestrator.embedded import EmbeddedTransport
            from softseam_services.orchestrator.simulation import Simulation
            from softseam_services.tables import check_tables
        except ImportError as error:
            raise missing_extra(error, "simulating in this process") from error
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
            compile_first(scene_from_bundle(bundle))
            self.simulation: Simulation = Simulation(bundle, EmbeddedTransport(), emit=self._emit)
            load_first(self.simulation)

    def doubts(self, scene: Scene) -> list[str]:
        from softseam.doubts import doubts
        from softseam_services.server import Setup

        bodies, tools = self.simulation.bodies, self.simulation.tools
        return doubts(scene, {name: Setup(one.scene, one.body, tools) for name, one in bodies.items()})

    def reset(self, seed: int, bundle: Bundle | None = None) -> Observation:
        self._stop_recording()
        self._last = None
        with translated(opening=bundle is not None):
            if bundle is None:
                self.simulation.reset(seed)
            else:
                compile_first(scene_from_bundle(bundle))
                self.simulation, self._bundle = self.simulation.with_scene(bundle, seed), bundle
                load_first(self.simulation)
        self._events.clear()
        if self._record is not None:
            self._start_recording(self._record, seed)
        seen = self._observation(fields=True)
        for frame in seen.frames.values():
            self._emit(frame)
        return seen

    def step(self, count: int, velocities: Mapping[str, Vector3] | None, fields: bool) -> Observation:
        recording = self._recorder is not None
        command = None if velocities is None else {name: velocity.tolist() for name, velocity in velocities.items()}
        with translated():
            for remaining in range(count, 0, -1):
                try:
                    self._last = self.simulation.step(command, fields=recording or (fields and remaining == 1))
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
        return _surfaces(self._bundle, self.simulation)

    def differentiate(
        self,
        loss: Loss,
        names: Sequence[str],
        commands: Sequence[Mapping[str, Sequence[float]]] | None,
        steps: int | None,
        near: float,
    ) -> tuple[Gradient, Observation]:
        from softseam.differentiating import differentiate

        if self._record is not None:
            raise BadInput("a gradient begins the run anew, which a recording does not show: open without record")
        compile_first(self.simulation.scene)
        tell_of_derivatives()
        with translated():
            gradient = differentiate(self.simulation, loss, names, commands, steps, near)
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


def _surfaces(bundle: Bundle, simulation: Simulation) -> Mapping[str, SurfaceMesh]:
    from softseam_services.recorder.begin import begin

    bodies = {name: one.body for name, one in simulation.bodies.items()}
    return begin(bundle, bodies, simulation.tools).surfaces


class Resimulation:
    """A simulation of a recorded scene from its start, to compare with the recording: frames as they are emitted."""

    def __init__(self, bundle: Bundle, seed: int) -> None:
        from softseam_services.orchestrator.embedded import EmbeddedTransport
        from softseam_services.orchestrator.simulation import Simulation

        self._frames: dict[str, Frame] = {}
        self._simulation = Simulation(bundle, EmbeddedTransport(), emit=self._take)
        self._simulation.reset(seed)

    def step(self, velocities: Mapping[str, Sequence[float]], fields: bool) -> StepReport:
        return self._simulation.step(velocities, fields=fields)

    def surfaces(self, bundle: Bundle) -> Mapping[str, SurfaceMesh]:
        """Of the bodies of this scene."""
        return _surfaces(bundle, self._simulation)

    def frame(self, body: str) -> Frame:
        """A body's frame of the last step. A switch at the end of that step is not in it, as in a recording."""
        return self._frames[body]

    def close(self) -> None:
        self._simulation.close()

    def _take(self, message: Message) -> None:
        if isinstance(message, Frame):
            self._frames[message.body] = message


@contextmanager
def resimulate(bundle: Bundle, seed: int) -> Iterator[Resimulation]:
    """Open a recorded scene again at its start."""
    with translated():
        simulation = Resimulation(bundle, seed)
        try:
            yield simulation
        finally:
            simulation.close()


def surfaces_of(bundle: Bundle, seed: int) -> Mapping[str, SurfaceMesh]:
    """Surfaces of a scene's bodies, as a recording of it begins with. Raises SoftseamError."""
    with resimulate(bundle, seed) as simulation:
        return simulation.surfaces(bundle)


def compile_first(scene: Scene) -> None:
    """Compile what no process has compiled yet on this machine and a scene needs, so that no step waits for it."""
    models: set[ModelKind] = set()
    adjoint = {*that(lambda facts: facts.gives_derivatives)}
    for name, body in scene.bodies.items():
        if not body.has_cells:
            continue  # particles: few kernels, which compile in seconds
        for one in candidates(scene.of(name)):
            regions = one.regions
            models |= {model for model in regions.models if model is not None}
            models |= set() if regions.goal is None else adjoint
    compile_models(models)


def compile_models(models: Iterable[ModelKind]) -> None:
    """Compile of these models what no process has compiled yet on this machine. Raises SoftseamError where the
    solvers are not installed."""
    try:
        from softseam_services.warm_up import compile_side_by_side, never_compiled
    except ImportError as error:
        raise missing_extra(error, "simulating in this process") from error
    fresh = [model for model in sorted(models) if never_compiled(model)]
    if fresh:
        if sys.stderr.isatty():
            print("compiling the solvers for this machine, once: a minute or so", file=sys.stderr)
        compile_side_by_side(fresh)


def load_first(simulation: Simulation) -> None:
    """Load what a simulation's models have compiled, so that its first step does not wait for it."""
    from softseam_services.warm_up import load_kernels

    for body in simulation.bodies.values():
        if body.body.has_cells:
            for model in body.participants.parts.models.values():
                load_kernels(model)


def tell_of_derivatives() -> None:
    """Say that those of steps are compiled first, where no process has done it yet on this machine."""
    from softseam_services.warm_up import never_compiled

    able = that(lambda facts: facts.gives_derivatives)
    if any(never_compiled(model, "step_derivative") for model in able) and sys.stderr.isatty():
        print("compiling the derivatives of steps for this machine, once: half a minute", file=sys.stderr)


@contextmanager
def compile_clock() -> Iterator[Callable[[], tuple[float, float]]]:
    """How much wall and processor time [s] numba has spent on kernels since the context began, when asked."""
    try:
        from softseam_services.jit.compile_clock import CompileClock
    except ImportError as error:
        raise missing_extra(error, "simulating in this process") from error
    with CompileClock() as clock:
        yield lambda: (clock.wall_so_far, clock.cpu)


_APART = (
    "softseam_protocol/bus/*.py",
    "softseam_protocol/publish.py",
    *(f"softseam_protocol/participant/{name}.py" for name in ("handler", "serve", "state")),
    *(f"softseam_protocol/participant/{name}.py" for name in ("part", "part_mesh", "part_solver")),
    *(f"softseam_services/{name}.py" for name in ("__main__", "bus_options", "child", "health", "launch", "lifeline")),
    *(f"softseam_services/{name}.py" for name in ("participant_service", "progress", "router", "supervisor")),
    *(
        f"softseam_services/orchestrator/{name}.py"
        for name in ("bus_transport", "client_liveness", "client_session", "singleton")
    ),
    *(f"softseam_services/orchestrator/{name}.py" for name in ("recorder_feed", "service")),
    "softseam_services/recorder/*.py",
)
"""sources that a simulation in this process never loads: the bus, processes, others' solvers, recordings"""


def solver_digest() -> str:
    """Digest of every source that a simulation's numbers may depend on: with another digest, perhaps other numbers."""
    try:
        from softseam_services.kernel_cache import kernel_packages
    except ImportError as error:
        raise missing_extra(error, "simulating in this process") from error
    digest = hashlib.sha256()
    for package in (*kernel_packages(), Path(softseam_protocol.__file__).parent):
        for path in sorted(package.rglob("*.py")):
            name = f"{package.name}/{path.relative_to(package).as_posix()}"
            if not any(fnmatch(name, apart) for apart in _APART):
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


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
    """

    def __init__(self, opening: bool = False) -> None:
        self._opening = opening

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None:
            _translate(error, self._opening)


def _translate(error: BaseException, opening: bool) -> None:
    """Raise the client's error for one of the services; return for any other."""
    from softseam_protocol.table import MissingRow
    from softseam_services.body.errors import MeshError, RowError, SettingError
    from softseam_services.orchestrator.archive import ArchiveError
    from softseam_services.orchestrator.coupling import Unsuited
    from softseam_services.orchestrator.part_client import StepFailed
    from softseam_services.orchestrator.rollout import NotDifferentiable
    from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost
    from softseam_services.recorder.whole_file import RecordError
    from softseam_services.tools.errors import ToolError

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
