"""A participant on the bus: bytes in, bytes out."""

import logging
from collections import Counter

from softseam_protocol.errors import DecodeError, Refused, SchemaMismatch
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Configure, Failure, Reply, Request
from softseam_protocol.participant.requests import Participant
from softseam_protocol.wire.codec import decode, encode

_log = logging.getLogger(__name__)


class ParticipantHandler:
    """Decodes requests, lets a participant answer them, and counts what it had to refuse."""

    def __init__(self, participant: Participant, models: tuple[str, ...]) -> None:
        """`models` are those that it may be asked for."""
        self.participant = participant
        self.refused: Counter[str] = Counter()
        """refused requests by kind of failure"""
        self._models = models
        self._last = ("", 0)

    def __call__(self, payload: bytes) -> bytes:
        """The reply. Raises Refused, DecodeError or SchemaMismatch, which the bus answers with a Failure."""
        try:
            request: Request = decode(payload, Request)
        except (DecodeError, SchemaMismatch) as error:
            self._count("schema" if isinstance(error, SchemaMismatch) else "invalid", str(error))
            raise
        reply: Reply
        if isinstance(request, Configure) and request.model not in self._models:
            there = " or ".join(repr(name) for name in self._models)
            reply = Failure(FailureKind.INVALID, f"this service runs {there}, not {request.model!r}")
        else:
            reply = self.participant.handle(request)
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
