"""The simulation in this process: no bus, no other process. Loads the solvers when a session opens, not before."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from softseam.errors import BadSnapshot, missing_extra
from softseam_protocol.messages import Bundle, Event, Frame, Observation, StepReport, Vector3

if TYPE_CHECKING:
    from softseam_services.orchestrator.simulation import Simulation
    from softseam_services.recorder.recorder import McapRecorder

Message = StepReport | Frame | Event


class EmbeddedBackend:
    """Runs FEM, PBD and the orchestrator by direct calls, and records from here if asked."""

    def __init__(
        self, bundle: Bundle, *, record: Path | None = None, listen: Callable[[Message], None] | None = None
    ) -> None:
        try:
            from softseam_services.orchestrator.embedded import EmbeddedTransport
            from softseam_services.orchestrator.simulation import Simulation
        except ImportError as error:
            raise missing_extra(error, "simulating in this process") from error
        self._events: list[Event] = []
        self._listen = listen
        self._bundle = bundle
        self._record = record
        self._recorder: McapRecorder | None = None
        with _translated():
            self._simulation: Simulation = Simulation(bundle, EmbeddedTransport(), emit=self._emit)

    def reset(self, seed: int) -> Observation:
        self._start_recording(seed)
        with _translated():
            report = self._simulation.reset(seed)
        return self._observation(report, fields=True)

    def step(self, count: int, velocities: Mapping[str, Vector3] | None, fields: bool) -> Observation:
        with _translated():
            for remaining in range(count, 0, -1):
                report = self._simulation.step(velocities, fields=fields and remaining == 1)
        return self._observation(report, fields)

    def save(self) -> bytes:
        with _translated():
            return self._simulation.save()

    def load(self, state: bytes) -> Observation:
        from softseam_services.orchestrator.archive import ArchiveError

        try:
            with _translated():
                report = self._simulation.load(state)
        except ArchiveError as error:
            raise BadSnapshot(str(error)) from error
        return self._observation(report, fields=True)

    def close(self) -> None:
        try:
            self._simulation.close()
        finally:
            self._stop_recording()

    def _observation(self, report: StepReport, fields: bool) -> Observation:
        frame = None
        if fields:
            with _translated():
                frame = self._simulation.frame()
        events, self._events = self._events, []
        return Observation(header=report.header, report=report, frame=frame, events=events)

    def _emit(self, message: Message) -> None:
        if isinstance(message, Event):
            self._events.append(message)
        if self._recorder is not None:
            self._recorder.write(message)
        if self._listen is not None:
            self._listen(message)
