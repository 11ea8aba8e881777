"""What runs a session's simulation: this process, or an orchestrator on the bus."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from softseam.errors import BadInput
from softseam.gradient import Asked, Gradient
from softseam_protocol.messages import session as messages
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Recorded, SurfaceMesh
from softseam_protocol.scene.scene import Scene


class Backend(Protocol):
    """What runs the simulation: this process, or an orchestrator on the bus. Every call may raise SoftseamError."""

    recorded: Recorded | None
    unrecorded: str
    """what became of the last recording that was ended"""

    def doubts(self, scene: Scene) -> list[str]:
        """What is doubtful about the scene that it runs, as far as that is known here."""
        ...

    def reset(self, seed: int, bundle: Bundle | None = None) -> messages.Observation:
        """Begin the scene anew, or another one; where that is refused, stand at the start of the one at hand."""
        ...

    def step(self, count: int, velocities: Mapping[str, Vector3] | None, fields: bool) -> messages.Observation:
        """Take steps with these tool velocities, or with the scene's own motion where they are None."""
        ...

    def follow(self, most: int | None) -> Sequence[messages.Observation]:
        """Take some steps with the scene's own motion, at least one and at most `most`; what was seen after each."""
        ...

    def save(self) -> bytes: ...

    def load(self, state: bytes) -> messages.Observation: ...

    def estimate(self) -> messages.ErrorEstimate | None: ...

    def surface_meshes(self) -> Mapping[str, SurfaceMesh]: ...

    def differentiate(self, asked: Asked) -> tuple[Gradient, messages.Observation]:
        """See `Session.gradient`; and what is seen at the end of the run."""
        ...

    def close(self) -> None: ...


def backend_of(bundle: Bundle, connect: str | None, record: str | Path | bool | None, timeout: float) -> Backend:
    """In this process, or on the bus that `connect` names. Raises BadInput for a recording that it cannot make."""
    if connect is None:
        if isinstance(record, bool):
            raise BadInput("record=True is for connected sessions: give the recording a file name")
        from softseam.embedded import EmbeddedBackend

        return EmbeddedBackend(bundle, record=None if record is None else Path(record))
    if isinstance(record, str | Path):
        raise BadInput("a connected session is recorded where the recorder runs: use record=True")
    from softseam.connected import ConnectedBackend

    return ConnectedBackend(bundle, connect, record=bool(record), timeout=timeout)
