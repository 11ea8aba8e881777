"""Simulates a recording again and compares bit for bit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from softseam.recording import Recording
from softseam.resimulating import resimulate
from softseam_protocol.messages.session import Frame, StepReport

_EXACT = ("tool_position", "tool_orientation", "wrench", "momentum", "angular_momentum")
_FIELDS = ("x", "multiplier", "coupling_nodes", "contact_force", "cauchy", "cell_energy")


@dataclass(frozen=True)
class Verification:
    """steps compared, the first that differs (or None), and what to say to the user."""

    steps: int
    frames: int
    differs_at: int | None
    text: str

    @property
    def same(self) -> bool:
        return self.differs_at is None


def verify(recording: Recording) -> Verification:
    """Repeat the recorded commands from the attached scene and compare positions, multipliers, wrenches bit for bit."""
    names = tuple(recording.scene.tools)
    steps = frames = 0
    with resimulate(recording.bundle, recording.seed) as simulation:
        for report, seen in _pairs(recording):
            if report.header.step != steps:
                return _unable(recording, steps, frames, report.header.step)
            turning = report.turning if len(report.turning) else np.zeros_like(report.command)
            grips = report.gripping if len(report.gripping) else np.zeros(len(report.command))
            rates = np.concatenate([report.command, turning, grips[:, None]], axis=1).tolist()
            command = {name: tuple(velocity) for name, velocity in zip(names, rates, strict=True)}
            again = simulation.step(command, fields=bool(seen))
            difference = _differing(report, again, _EXACT)
            for frame in seen:
                difference = difference or _differing(frame, simulation.frames[frame.body], _FIELDS)
                frames += 1
            if difference is not None:
                text = f"step {steps} is the first that differs: {difference}"
                return Verification(steps, frames, steps, text)
            steps += 1
    note = f" ({recording.note})" if recording.note else ""
    return Verification(steps, frames, None, f"all {steps} steps and {frames} frames are the same, bit for bit{note}")


def _pairs(recording: Recording) -> Iterator[tuple[StepReport, list[Frame]]]:
    """Each step with its frames, if it has any; they follow their step."""
    pending: StepReport | None = None
    frames: list[Frame] = []
    for message in recording:
        if isinstance(message, StepReport):
            if pending is not None:
                yield pending, frames
            pending, frames = message, []
        elif isinstance(message, Frame) and pending is not None and message.header.step == pending.header.step:
            frames.append(message)
    if pending is not None:
        yield pending, frames


def _differing(recorded: object, again: object, names: Sequence[str]) -> str | None:
    """The first array that is not the same bytes, in words."""
    for name in names:
        old, new = np.ascontiguousarray(getattr(recorded, name)), np.ascontiguousarray(getattr(again, name))
        if old.shape != new.shape:
            return f"{name} has shape {new.shape}, recorded {old.shape}"
        if old.tobytes() != new.tobytes():
            return f"{name} by up to {float(np.abs(new - old).max()):.3g}"
    return None


def _unable(recording: Recording, steps: int, frames: int, found: int) -> Verification:
    """The first steps are the same; found: the step that comes in place of the next one."""
    reason = f"step {found} follows step {steps - 1}: a reset or a restore"
    if found > steps:
        reason = f"the commands of the {found - steps} steps before step {found} are missing"
    note = f" ({recording.note})" if recording.note else ""
    same = f"the {steps} steps before it and their {frames} frames are the same, bit for bit"
    return Verification(steps, frames, steps, f"cannot be simulated again beyond step {steps}, {same}: {reason}{note}")
