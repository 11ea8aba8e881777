"""What a client sees of a simulation, the same embedded and over the bus: observations and snapshots."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.session import Event, Frame, Observation, StepReport
from softseam_protocol.wire import codec
from softseam_services.orchestrator.archive import ArchiveError, pack, unpack
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost

FAILURES = (StepFailed, ParticipantFailed, ParticipantLost)
"""what a step may raise"""


def observation(
    simulation: Simulation,
    last: StepReport | None,
    *,
    fields: bool,
    taken: bool,
    events: list[Event],
    session: str = "local",
) -> Observation:
    """The answer to Open, Reset, Step and Load; its header has the number of steps taken and the time reached.

    last    report of the last step taken, None at the start of the scene
    events  what happened since the observation before; emptied
    Of a step that was taken there is always an answer, without fields where a participant was lost meanwhile. The start
    and a state that was loaded can be asked for again: there ParticipantLost and ParticipantFailed are raised.
    """
    frames: dict[str, Frame] = {}
    if fields:
        frames = (simulation.seen() or {}) if taken else simulation.frames()
    told, events[:] = list(events), []
    steps = round(simulation.time / simulation.scene.step)
    header = Header(SCHEMA_VERSION, session, "", 0, steps, 0, simulation.time)
    report = resting_report(simulation, header, frames) if last is None else last
    return Observation(header, report, frames, told)


def counted(error: Exception, taken: int, asked: int) -> Exception:
    """The error of a step, which says also how many of those asked for were taken before it."""
    return StepFailed(f"{error} ({taken} of the {asked} steps asked for were taken)") if taken else error


def resting_report(simulation: Simulation, header: Header, frames: Mapping[str, Frame]) -> StepReport:
    """The report before any step: nothing touches, nothing moves."""
    tools = simulation.tools
    n_tools = len(tools.names)
    return StepReport(
        header=header,
        phase=-1,
        tool_position=tools.position.copy(),
        tool_orientation=tools.orientation.copy(),
        wrench=np.zeros((n_tools, 6)),
        quantities=simulation.at_rest(frames),
        interfaces={},
        parts={},
        energy={},
        momentum=np.zeros(3),
        angular_momentum=np.zeros(3),
        penetration=0.0,
        seconds={},
        done=simulation.done,
        command=np.zeros((n_tools, 3)),
    )


def snapshot(simulation: Simulation, last: StepReport | None) -> bytes:
    """State of the simulation together with the report of its last step, sealed by a digest."""
    content = pack({"state": simulation.save(), "report": b"" if last is None else codec.encode(last)})
    return hashlib.sha256(content).digest() + content


def restore(simulation: Simulation, data: bytes) -> StepReport | None:
    """Continue from a snapshot; returns the report that it holds.

    Raises ArchiveError, and then has changed nothing, where the bytes are not a whole snapshot of this scene.
    """
    seal, content = data[:32], data[32:]
    if hashlib.sha256(content).digest() != seal:
        raise ArchiveError("these bytes are no snapshot, or a damaged one: pass what `snapshot` returned")
    entries = unpack(content)
    encoded = entries["report"].tobytes()
    last = codec.decode(encoded, StepReport) if encoded else None
    simulation.load(entries["state"].tobytes())
    return last
