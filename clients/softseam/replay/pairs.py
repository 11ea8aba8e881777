"""What bodies do to one another, in a replay: two arrows from where they press, each into the body that it pushes."""

from collections.abc import Mapping

import numpy as np
import rerun as rr

from softseam.recording import Recording
from softseam.replay import paths
from softseam.view import colors
from softseam.view.pair_forces import pair_forces
from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.session import Frame, StepReport


class PairLog:
    """Logs the forces of each step for which all bodies have a frame.

    surfaces  of these
    most      force whose arrow is as long as a body [N]
    """

    def __init__(
        self, stream: rr.RecordingStream, recording: Recording, surfaces: Mapping[str, DisplaySurface], most: float
    ) -> None:
        self._stream, self._pairs, self._count = stream, recording.scene.interfaces, len(surfaces)
        self._most, self._extent = most, max((surface.extent for surface in surfaces.values()), default=0.0)
        self._frames: dict[str, Frame] = {}
        self._report: StepReport | None = None

    def step(self, report: StepReport) -> None:
        """Of the step whose frames follow."""
        self._report = report
        self._frames.clear()

    def log(self, frame: Frame) -> None:
        """Draw the arrows at the stream's current time, with the last frame of the step."""
        report = self._report
        if report is None or report.header.step != frame.header.step or self._most <= 0.0:
            return  # the start, or its report is missing
        self._frames[frame.body] = frame
        if len(self._frames) < self._count:
            return
        at, force = pair_forces(self._pairs, report, self._frames, self._most)
        ways = force * (self._extent / self._most)
        both = np.concatenate([at, at]), np.concatenate([ways, -ways])
        self._stream.log(
            paths.PAIRS,
            rr.Arrows3D(origins=both[0], vectors=both[1], colors=colors.BETWEEN, radii=0.012 * self._extent),
        )
