"""A recorded scene simulated again from its start, in this process."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from softseam.embedded import Message, simulate, surfaces, translated
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.messages.session import Frame, StepReport
from softseam_protocol.scene.command import Command


class Resimulation:
    """Steps to compare with those of the recording, and frames as they are emitted."""

    def __init__(self, bundle: Bundle, seed: int) -> None:
        self.frames: dict[str, Frame] = {}
        """of the last step by body; a switch at the end of that step is not in them, as in a recording"""
        self._simulation = simulate(bundle, self._take)
        self._simulation.reset(seed)

    def step(self, velocities: Command, fields: bool) -> StepReport:
        return self._simulation.step(velocities, fields=fields)

    def surfaces(self, bundle: Bundle) -> Mapping[str, SurfaceMesh]:
        """Of the bodies of this scene, as a recording of it begins with."""
        return surfaces(bundle, self._simulation)

    def close(self) -> None:
        self._simulation.close()

    def _take(self, message: Message) -> None:
        if isinstance(message, Frame):
            self.frames[message.body] = message


@contextmanager
def resimulate(bundle: Bundle, seed: int) -> Iterator[Resimulation]:
    """Open a recorded scene again at its start. Raises SoftseamError."""
    with translated():
        simulation = Resimulation(bundle, seed)
        try:
            yield simulation
        finally:
            simulation.close()
