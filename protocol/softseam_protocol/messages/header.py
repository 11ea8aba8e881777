"""What every message begins with."""

from softseam_protocol.messages.arrays import Count, IdText, NameText
from softseam_protocol.messages.message import message

SCHEMA_VERSION = 3


@message
class Header:
    """Names a message: a request with the same header and kind is the same request."""

    schema: Count
    session: NameText
    part: IdText
    """that is meant, BODY.PART; empty where none is"""
    epoch: Count
    step: Count
    exchange: Count
    time: float
    """simulation time at the start of the step [s]"""
