"""Which services are up: what their liveliness tokens and heartbeats say."""

import time
from dataclasses import dataclass

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import ProtocolError
from softseam_protocol.messages.session import Progress
from softseam_protocol.models import MODELS, service_of
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode

_BEATS = 1.0
"""a service that is well beats several times in this span [s]"""


@dataclass(frozen=True)
class ServiceHealth:
    """One service of a deployment.

    state    'well', 'silent' (there, but its heartbeat is not heard), 'absent', or 'doubled' (there are several of what
             must be alone)
    """

    service: str
    state: str
    progress: Progress | None

    def __str__(self) -> str:
        if self.state == "well" and self.progress is not None:
            what = f"busy for {self.progress.busy:.1f} s" if self.progress.busy > 0.0 else "idle"
            return f"{self.service}: well, {self.progress.requests} requests answered, {what}"
        meaning = {
            "well": "there",
            "silent": "there, but it gives no sign of life: frozen or overloaded",
            "doubled": "several of them run and upset each other: stop all but one",
            "absent": "not running, or not ready yet",
        }
        return f"{self.service}: {meaning[self.state]}"


def expected() -> tuple[str, ...]:
    """The services of a deployment: those of all models, the orchestrator and the recorder."""
    return (*(service_of(model) for model in MODELS), "orchestrator", "recorder")


def probe(bus: Bus, keys: Keys, services: tuple[str, ...] | None = None, *, beats: bool = True) -> list[ServiceHealth]:
    """The health of the services named, by default of all that are expected; without `beats` only whether they are
    there (quicker)."""
    services = expected() if services is None else services
    heard: dict[str, Progress] = {}
    inbox = bus.subscribe(keys.every_progress) if beats else None
    tokens = (keys.read_live(key) for key in bus.live(keys.every_live()))
    instances = [(live.role, live.service) for live in tokens if live is not None]
    there = {service for _, service in instances}
    doubled = {
        service for role, service in instances if role == "orchestrator" and instances.count((role, service)) > 1
    }
    if inbox is not None:
        end = time.monotonic() + _BEATS
        while not there & set(services) <= heard.keys() and (left := end - time.monotonic()) > 0.0:
            received = inbox.get(left)
            if received is None:
                continue
            try:
                progress = decode(received.payload, Progress)
            except ProtocolError:
                continue
            heard[progress.service] = progress
        inbox.close()

    def state(service: str) -> str:
        if service not in there:
            return "absent"
        if service in doubled:
            return "doubled"
        return "well" if service in heard or not beats else "silent"

    return [ServiceHealth(service, state(service), heard.get(service)) for service in services]
