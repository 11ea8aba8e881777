"""Runs whose messages fare badly, and what becomes of them."""

import hashlib
from dataclasses import dataclass

from softseam.embedded import faulty, simulate, translated
from softseam.errors import SimulationFailed
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_studies.atlas.verdicts import Verdict


@dataclass(frozen=True)
class Told:
    """What a run reported: digest of all its reports and of the body's end, and its events by kind."""

    digest: str
    events: tuple[str, ...]
    failed: str = ""


def disturbed(scene: Scene, fault: str | None, every: int) -> Told:
    """Run a scene while of every so many requests for a step one fares badly, at most once; `None` is undisturbed."""
    transport = None if fault is None else faulty(fault, every)
    digest = hashlib.sha256()
    failed = ""
    simulation = simulate(bundle_scene(scene, {}), lambda message: None, transport)
    try:
        with translated():
            while not simulation.done:
                report = simulation.step()
                digest.update(report.wrench.tobytes() + report.momentum.tobytes() + report.tool_position.tobytes())
            frame = simulation.frame()
        digest.update(frame.x.tobytes() + frame.cauchy.tobytes())
    except SimulationFailed as error:
        failed = str(error)
    kinds = tuple(event.kind for event in simulation.events)
    simulation.close()
    if transport is not None and not transport.harmed:
        failed = failed or "nothing was harmed: the run is too short"
    return Told(digest.hexdigest(), kinds, failed)


def judged(faulty: Told, true: Told) -> Verdict:
    """The verdict on a disturbed run, beside the undisturbed one."""
    restored = faulty.events.count(EventKind.PARTICIPANT_RESTORED)
    guards = ("participant restored from its checkpoint",) if restored else ()
    if faulty.failed:
        return Verdict("unstable", faulty.failed, None, guards, ("the run failed by name",))
    if faulty.digest != true.digest:
        why = "not the same bits as undisturbed"
        return Verdict("inaccurate", why, None, guards, guards and ("participant_lost",))
    if restored:
        return Verdict(
            "recovered", f"restored {restored} times from the last checkpoint; bit for bit as undisturbed", 0.0, guards
        )
    return Verdict("accurate", "answered from what the participant had kept; bit for bit as undisturbed", 0.0)
