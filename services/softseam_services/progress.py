"""A service's heartbeat on the bus."""

from collections.abc import Callable

from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.server import Server
from softseam_protocol.errors import ProtocolError
from softseam_protocol.messages.session import Progress
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import encode
from softseam_services.lifeline import Lifeline


def tell_progress(
    life: Lifeline,
    bus: Bus,
    keys: Keys,
    server: Server,
    role: str,
    service: str,
    instance: str,
    at: Callable[[], tuple[str, int]] = lambda: ("", 0),
    *,
    supervise: bool = True,
) -> None:
    """With every beat of the lifeline publish a Progress.

    at         session and step of the last request
    supervise  the supervisor may kill the process where one request takes too long
    """
    key = keys.progress(role, service)

    def beat() -> None:
        session, step = at()
        try:
            bus.publish(key, encode(Progress(service, instance, session, step, server.answered, server.busy)), True)
        except ProtocolError:
            return  # the bus is being closed; the supervisor's pipe says the rest

    if supervise:
        life.busy_of = lambda: server.busy
    life.on_beat.append(beat)
