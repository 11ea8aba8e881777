"""Every error that crosses the protocol: what the bytes, the bus and the other side can do wrong."""

from softseam_protocol.messages.participant import Failure


class ProtocolError(Exception):
    """Base of everything below; its text is one sentence for a user."""


class EncodeError(ProtocolError):
    """A message of ours holds a value that its declaration forbids; the text names message, field and reason."""


class DecodeError(ProtocolError):
    """Bytes that are not the message they should be; the text names message, field and reason."""


class SchemaMismatch(ProtocolError):
    """The other side speaks another version of the schema."""


class BusError(ProtocolError):
    """The bus could not do what was asked."""


class NoRouter(BusError):
    """No router answers at the endpoint."""


class NoKey(BusError):
    """There is no key to join the bus by."""


class BadKey(BusError):
    """A key that cannot be read, is not this user's own, can be read by others, or is another role's."""


class KeyRefused(BusError):
    """Somebody listens at the endpoint and does not let this process in."""


class PortBusy(BusError):
    """A router cannot listen at its endpoint."""


class NoReply(BusError):
    """Nobody serves the key, or the server died: whether the request ran is unknown."""


class BusTimeout(BusError):
    """A server took the request and did not answer in time: whether the request ran is unknown."""


class ForkedBus(BusError):
    """A bus was inherited through fork, where everything it sends would be lost."""


class Refused(ProtocolError):
    """A request answered with a Failure; a handler raises it to refuse a request."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(f"{failure.kind}: {failure.message}")
        self.failure = failure
