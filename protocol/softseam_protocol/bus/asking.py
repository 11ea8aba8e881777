"""The asking side of requests: one that is under way, and a key that is asked often."""

from collections.abc import Callable
from typing import Any

from softseam_protocol.bus.declared import Declared
from softseam_protocol.errors import BusTimeout, DecodeError, NoReply, ProtocolError, Refused
from softseam_protocol.messages.participant import Failure
from softseam_protocol.wire.codec import decode, encode

_TIMEOUT_REPLY = b"Timeout"


class Pending:
    """A request under way."""

    def __init__(self, key: str, timeout: float, replies: Any, querier: Any = None) -> None:
        self._key, self._timeout, self._replies = key, timeout, replies
        self._querier = querier  # one that is dropped takes its replies along

    def collect(self) -> bytes:
        """Wait for the reply. Raises NoReply, BusTimeout, or Refused with the Failure of the other side."""
        for reply in self._replies:
            return unwrapped(self._key, self._timeout, reply)
        raise no_reply(self._key)


class Asker:
    """Asks one key again and again: it is announced beforehand, which spares a third of a round trip."""

    def __init__(self, key: str, querier: Declared, ask: Callable[[bytes, Any], Pending]) -> None:
        self._key, self._querier, self._ask = key, querier, ask

    def start(self, payload: bytes, handler: Any = None) -> Pending:
        """Send a request without waiting; `collect` gets the reply, unless zenoh gives it to a `handler`."""
        return self._ask(payload, handler)

    def call(self, message: Any, allowed: Any) -> Any:
        """Send a message and decode its reply; errors as `Bus.call`."""
        return understood(self._key, self.start(encode(message)).collect(), allowed)

    def close(self) -> None:
        """Announce the key no longer; a second call does nothing."""
        self._querier.undeclare()


def unwrapped(key: str, timeout: float, reply: Any) -> bytes:
    """The payload of zenoh's reply. Raises BusTimeout, or Refused with the Failure of the other side."""
    if reply.ok is not None:
        return bytes(reply.ok.payload.to_bytes())
    raw = reply.err.payload.to_bytes()
    if raw == _TIMEOUT_REPLY:
        raise timed_out(key, timeout)
    raise _refusal(key, raw)


def timed_out(key: str, timeout: float) -> BusTimeout:
    return BusTimeout(f"{key}: no answer within {timeout:g} s: the server hangs or is overloaded")


def no_reply(key: str) -> NoReply:
    return NoReply(f"{key}: nobody serves it, or its server died: start the service and repeat the request")


def _refusal(key: str, raw: bytes) -> ProtocolError:
    try:
        return Refused(decode(raw, Failure))
    except ProtocolError:
        return DecodeError(f"{key}: an error reply of {len(raw)} bytes that is not a Failure")


def understood(key: str, reply: bytes, allowed: Any) -> Any:
    """A decoded reply, which must be of the class(es) `allowed`; a Failure is raised as Refused unless they name it."""
    try:
        return decode(reply, allowed)
    except DecodeError:
        raise _refusal_or_foreign(key, reply) from None


def _refusal_or_foreign(key: str, reply: bytes) -> ProtocolError:
    try:
        decoded = decode(reply)
    except ProtocolError as error:
        return DecodeError(f"{key}: {error}")
    if isinstance(decoded, Failure):
        return Refused(decoded)
    return DecodeError(f"{key}: answered with a {type(decoded).__name__}")
