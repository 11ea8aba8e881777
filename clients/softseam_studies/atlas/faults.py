"""Messages between orchestrator and participants that are repeated, lost, late, or sent to someone who has died."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Advance, Configure, Reply, Request
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_studies.atlas.verdicts import Verdict

Fault = Literal["repeated", "request lost", "reply lost", "an old one comes late", "killed", "killed in recovery"]


@dataclass(frozen=True)
class Told:
    """What a run reported: digest of all its reports and of the body's end, and its events by kind."""

    digest: str
    events: tuple[str, ...]
    failed: str = ""


def disturbed(scene: Scene, fault: Fault | None, every: int, after: int = 10) -> Told:
    """Run a scene while of every so many requests for a step one fares badly, at most once; `None` is undisturbed."""
    from softseam_services.orchestrator.embedded import EmbeddedTransport
    from softseam_services.orchestrator.simulation import Simulation
    from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost

    class Faulty(EmbeddedTransport):
        """Counts the advances to every participant, and does harm to each `every`-th."""

        def __init__(self) -> None:
            super().__init__()
            self.count = 0
            self.harmed = 0
            self.dying = False
            self.last: dict[str, Request] = {}
            self.seen: set[tuple[int, int, int, str]] = set()

        def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
            names = list(requests)
            name = names[self.harmed % len(names)]
            request = requests[name]
            if self.dying and isinstance(request, Configure):
                self.dying = False
                self._servers.pop(name, None)
                raise ParticipantLost(name, "it died while it was brought back")
            header = request.header
            asked = (header.epoch, header.step, header.exchange, name)
            if fault is None or not isinstance(request, Advance) or asked in self.seen:
                return super().exchange(requests)
            self.seen.update((header.epoch, header.step, header.exchange, one) for one in names)
            self.count += 1
            old = self.last.get(name)
            self.last.update(requests)
            if self.count < after or self.count % every:
                return super().exchange(requests)
            self.harmed += 1
            return self.harm(name, requests, old)

        def harm(self, name: str, requests: Mapping[str, Request], old: Request | None) -> dict[str, Reply]:
            if fault == "repeated":
                super().exchange(requests)
                return super().exchange(requests)
            if fault == "an old one comes late":
                replies = super().exchange(requests)
                if old is not None:
                    self._server(name).handle(old)
                return replies
            if fault == "request lost":
                raise ParticipantLost(name, "no answer in time")
            if fault == "reply lost":
                super().exchange(requests)
                raise ParticipantLost(name, "no answer in time")
            self.dying = fault == "killed in recovery"
            self._servers.pop(name, None)
            return super().exchange(requests)

    transport = Faulty()
    digest = hashlib.sha256()
    failed = ""
    simulation = Simulation(bundle_scene(scene, {}), transport)
    try:
        while not simulation.done:
            report = simulation.step()
            digest.update(report.wrench.tobytes() + report.momentum.tobytes() + report.tool_position.tobytes())
        frame = simulation.frame()
        digest.update(frame.x.tobytes() + frame.cauchy.tobytes())
    except (ParticipantLost, ParticipantFailed) as error:
        failed = str(error)
    kinds = tuple(event.kind for event in simulation.events)
    simulation.close()
    if fault is not None and not transport.harmed:
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
