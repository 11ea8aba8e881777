"""What bodies do to one another, to be drawn: the whole force of each contact, where the boxes around two meet."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam.recording import Recording
from softseam_protocol.messages.session import Frame, StepReport
from softseam_protocol.scene.interfaces import InterfaceSpec

Floats = NDArray[np.float64]

_LEAST = 1 / 50
"""of the largest force of a run: smaller ones are not drawn"""


def largest_totals(recording: Recording, steps: Collection[int] | None = None) -> Floats:
    """The largest force between two bodies, of all points of a contact, in each step of a run that has some, or in
    these of its steps (k,) [N]."""
    pairs, found = recording.scene.interfaces, []
    if pairs:
        for report in recording.reports():
            totals = [each.total for name, each in report.interfaces.items() if name in pairs]
            if totals and (steps is None or report.header.step in steps):
                found.append(float(np.linalg.norm(totals, axis=1).max()))
    return np.array(found)


def pair_forces(
    pairs: Mapping[str, InterfaceSpec], report: StepReport, frames: Mapping[str, Frame], most: float
) -> tuple[Floats, Floats]:
    """Where two bodies press, in the middle of what the boxes around them share (k, 3) [m], and with what force each
    first one is pushed (k, 3) [N], of those that are worth drawing beside the largest of a run [N]."""
    at, force = [], []
    for name, each in report.interfaces.items():
        if name not in pairs or np.linalg.norm(each.total) <= _LEAST * most:
            continue
        first, second = (frames[body].point_x for body in pairs[name].between)
        low = np.maximum(first.min(axis=0), second.min(axis=0))
        at.append(0.5 * (low + np.minimum(first.max(axis=0), second.max(axis=0))))
        force.append(each.total)
    return np.array(at).reshape(-1, 3), np.array(force).reshape(-1, 3)
