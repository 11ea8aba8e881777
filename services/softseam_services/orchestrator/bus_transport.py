"""Participants as processes on the bus."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from statistics import median
from time import perf_counter

from softseam_protocol.bus.asking import Asker, Pending
from softseam_protocol.bus.client import FIRST, TIMEOUT, Bus
from softseam_protocol.errors import BusTimeout, NoReply, ProtocolError, Refused
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Advanced, Configure, Failure, Reply, Request
from softseam_protocol.models import MODELS, service_of
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost, worked

_KEPT = 4096


class BusTimes:
    """What the bus has cost in the latest exchanges in which every participant advanced."""

    def __init__(self) -> None:
        self._overhead: deque[float] = deque(maxlen=_KEPT)
        self._size: deque[float] = deque(maxlen=_KEPT)

    def add(self, overhead: float, size: float) -> None:
        """overhead [s] beyond the slowest participant's own work; size: bytes sent and received, a participant."""
        self._overhead.append(overhead)
        self._size.append(size)

    @property
    def exchanges(self) -> int:
        return len(self._overhead)

    @property
    def overhead(self) -> float:
        """Median [s] an exchange; 0 without any."""
        return median(self._overhead) if self._overhead else 0.0

    @property
    def size(self) -> int:
        """Median of the bytes sent and received an exchange, a participant."""
        return round(median(self._size)) if self._size else 0


class BusTransport:
    """Sends requests to the services that run the models; all of an exchange are under way at once.

    bus        a session on the bus, not closed by the transport
    services   name of the process that serves a model, or that serves a participant (which goes first)
    timeout    longest wait for a reply [s]
    """

    def __init__(
        self, bus: Bus, keys: Keys, *, services: Mapping[str, str] | None = None, timeout: float = TIMEOUT
    ) -> None:
        self._bus, self._keys, self._timeout = bus, keys, timeout
        self._services = {model: service_of(model) for model in MODELS} | dict(services or {})
        self._service_of: dict[str, str] = {}
        self._askers: dict[str, Asker] = {}
        self.times = BusTimes()

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        """Send all requests at once and wait for all replies; see `Transport`."""
        began = perf_counter()
        size = 0
        pending = []
        for name, request in requests.items():
            if isinstance(request, Configure):
                self._route(name, request.model)
            elif name not in self._service_of:
                raise ParticipantFailed(
                    name, Failure(FailureKind.NOT_CONFIGURED, f"no participant {name!r} was configured")
                )
            payload = encode(request)
            size += len(payload)
            pending.append(self._asker(self._keys.participant(self._service_of[name])).start(payload))
        replies: dict[str, Reply] = {}
        slowest = 0.0
        advanced = True
        for (name, request), one in zip(requests.items(), pending, strict=True):
            raw = self._collect(name, one)
            size += len(raw)
            reply = replies[name] = self._decoded(name, request, raw)
            if isinstance(reply, Advanced):
                slowest = max(slowest, worked(reply))
            else:
                advanced = False
        if advanced and requests:
            self.times.add(max(0.0, perf_counter() - began - slowest), size / len(requests))
        return replies

    def wait_alive(self, participant: str, timeout: float) -> bool:
        """Whether the process that serves the participant answers within `timeout` [s]: its solver's thread does."""
        service = self._service_of.get(participant)
        if service is None:
            return False
        tokens, echo = self._keys.every_live("participant", service), self._keys.echo(service)
        return self._bus.wait_answers(tokens, echo, timeout)

    def echo(self, size: int, count: int = 200) -> float:
        """Median time of an exchange that only echoes: `size` bytes a participant, half of them each way [s]."""
        if not self._service_of:
            return 0.0
        payload = bytes(max(1, size // 2))
        askers = [self._asker(self._keys.echo(service)) for service in self._service_of.values()]
        trips = []
        for _ in range(count):
            began = perf_counter()
            for one in [asker.start(payload) for asker in askers]:
                one.collect()
            trips.append(perf_counter() - began)
        return median(trips)

    def close(self) -> None:
        """Ask no more; the bus belongs to the service."""
        for asker in self._askers.values():
            asker.close()
        self._askers.clear()

    def _route(self, participant: str, model: str) -> None:
        service = self._services.get(participant) or self._services.get(model)
        if service is None:
            raise ParticipantFailed(participant, Failure(FailureKind.INVALID, f"no service runs the model {model!r}"))
        if self._service_of.get(participant) == service:
            return
        self._service_of[participant] = service
        # the first request may be sent before the router has introduced the two
        self.wait_alive(participant, FIRST)

    def _asker(self, key: str) -> Asker:
        asker = self._askers.get(key)
        if asker is None:
            asker = self._askers[key] = self._bus.asker(key, self._timeout)
        return asker

    def _collect(self, name: str, pending: Pending) -> bytes:
        try:
            return pending.collect()
        except Refused as error:
            raise ParticipantFailed(name, error.failure) from None
        except (NoReply, BusTimeout) as error:
            raise ParticipantLost(name, str(error)) from None
        except ProtocolError as error:
            raise ParticipantFailed(name, Failure(FailureKind.INVALID, str(error))) from None

    def _decoded(self, name: str, request: Request, raw: bytes) -> Reply:
        try:
            reply: Reply = decode(raw, Reply)
        except ProtocolError as error:
            raise ParticipantFailed(name, Failure(FailureKind.INVALID, f"its reply cannot be read: {error}")) from None
        if isinstance(reply, Failure):
            raise ParticipantFailed(name, reply)
        if reply.header != request.header:
            raise ParticipantFailed(name, Failure(FailureKind.INVALID, f"it answered another request: {reply.header}"))
        return reply
