"""What services report of themselves."""

from softseam_protocol.messages.arrays import Count, NameText
from softseam_protocol.messages.message import message


@message
class Progress:
    """A service's heartbeat; `requests` stands still while `busy` grows when its solver hangs."""

    service: NameText
    instance: NameText
    """names the process: differs after a restart"""
    session: NameText
    """session of the last request, or empty"""
    step: Count
    requests: Count
    """requests answered since the service started"""
    busy: float
    """wall time spent in the request at hand, 0 when idle [s]"""
