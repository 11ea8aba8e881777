"""An endpoint that is free, and waits for what a bus finds out by itself."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import BusTimeout, NoReply, Refused


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def until(condition: Callable[[], bool], seconds: float = 5.0) -> bool:
    """Wait for `condition()`; discovery on the bus is asynchronous."""
    end = time.monotonic() + seconds
    pause = threading.Event()
    while time.monotonic() < end:
        if condition():
            return True
        pause.wait(0.005)
    return False


def served(bus: Bus, key: str, payload: bytes = b"") -> bool:
    """Whether anybody answers requests to the key."""
    try:
        bus.request(key, payload, 1.0)
    except NoReply:
        return False
    except (Refused, BusTimeout):
        return True
    return True
