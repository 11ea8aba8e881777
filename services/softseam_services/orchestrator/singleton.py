"""One orchestrator a deployment: of two, each would answer some of a client's requests, and upset the other's."""

from __future__ import annotations

import threading
import time

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import BusError
from softseam_protocol.topics import Keys

PATIENCE = 5.0
"""time in which the token of a predecessor that was killed, or is being stopped, has gone [s]"""
_PERIOD = 0.25


class AlreadyServed(BusError):
    """Another orchestrator serves the deployment."""


def wait_to_be_only(bus: Bus, keys: Keys, stop: threading.Event) -> None:
    """Until no other orchestrator is there, or this one is to stop. Raises AlreadyServed."""
    every, end = keys.every_live("orchestrator"), time.monotonic() + PATIENCE
    while there := _there(bus, every):
        if time.monotonic() > end:
            found = ", ".join(sorted(live.instance for live in map(keys.read_live, there) if live is not None))
            raise AlreadyServed(
                f"an orchestrator serves the deployment {keys.deployment!r} at {', '.join(bus.endpoints)} already "
                f"(instance {found}): use that one, stop it, or give this one another --deployment"
            )
        if stop.wait(_PERIOD):
            return


def _there(bus: Bus, every: str) -> set[str]:
    """Tokens that the router knows, or that this process was told of where the router is away just now."""
    try:
        return bus.live_at_router(every)
    except BusError:
        return bus.live(every)
