"""A participant's process: answers requests for one model on the bus, for several sessions.

One thread owns the solvers; zenoh's threads only enqueue. The kernels are warm before the service shows itself.
"""

from __future__ import annotations

import logging
from collections import Counter

from softseam_protocol.errors import DecodeError, Refused, SchemaMismatch
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Configure, Failure
from softseam_protocol.topics import ParticipantRequest
from softseam_protocol.wire.codec import decode, encode
from softseam_services.bus_options import BusOptions, new_instance
from softseam_services.lifeline import Lifeline
from softseam_services.progress import tell_progress
from softseam_services.server import ParticipantServer
from softseam_services.warm_up import settle, warm_participant

ROLE = "participant"
_log = logging.getLogger(__name__)


class ParticipantHandler:
    """Bytes in, bytes out: decodes, lets `ParticipantServer` answer, counts what it had to refuse."""

    def __init__(self, model: str) -> None:
        self._model = model
        self._server = ParticipantServer()
        self.refused: Counter[str] = Counter()
        """refused requests by kind of failure"""
        self._last = ("", 0)

    def __call__(self, payload: bytes) -> bytes:
        """The reply. Raises Refused, DecodeError or SchemaMismatch, which the bus answers with a Failure."""
        try:
            request = decode(payload, ParticipantRequest)
        except (DecodeError, SchemaMismatch) as error:
            self._count("schema" if isinstance(error, SchemaMismatch) else "invalid", str(error))
            raise
        if isinstance(request, Configure) and request.model != self._model:
            reply: object = Failure(FailureKind.INVALID, f"this service runs {self._model!r}, not {request.model!r}")
        else:
            reply = self._server.handle(request)
        if isinstance(reply, Failure):
            self._count(reply.kind, reply.message)
            raise Refused(reply)
        self._last = (request.header.session, request.header.step)
        return encode(reply)

    def last(self) -> tuple[str, int]:
        """Session and step of the last request that was answered."""
        return self._last

    def _count(self, kind: str, message: str) -> None:
        self.refused[kind] += 1
        n = self.refused[kind]
        if n & (n - 1) == 0:  # 1, 2, 4, 8, ...: a flood must not fill the log
            _log.warning("refused (%s, %d so far): %s", kind, n, message)


def serve_participant(model: str, options: BusOptions, life: Lifeline, name: str | None = None) -> None:
    """Serve requests until the process is asked to stop. `name` of the service is the model's by default."""
    service = name or model
    life.state = "compiling"
    warm_participant(model)
    settle()
    handler = ParticipantHandler(model)
    keys, instance = options.keys, new_instance()
    with options.open() as bus:
        server = bus.serve({keys.participant(service): handler, keys.echo(service): bytes}, name=f"softseam {service}")
        tell_progress(life, bus, keys, server, ROLE, service, instance, handler.last)
        life.when_stopping(server.close)
        bus.declare_live(keys.live(ROLE, service, instance))
        life.state = "ready"
        server.run()
