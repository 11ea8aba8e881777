"""Where the bus is, and how a service joins it."""

from __future__ import annotations

import os
import secrets
from dataclasses import dataclass
from typing import Any

from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.topics import DEFAULT_DEPLOYMENT, DEFAULT_ENDPOINT, Keys

DIRECT = "tcp/127.0.0.1:0"
"""default listening endpoint of services that talk directly: any free port of the loopback"""


@dataclass(frozen=True)
class BusOptions:
    """How a service joins the bus.

    connect      endpoint of the router
    listen       endpoint at which other services reach this one directly, once the router has introduced them; empty:
                 everything goes through the router
    deployment   services of other deployments on the same bus are not seen
    wait         longest wait for the router [s]
    """

    connect: str = DEFAULT_ENDPOINT
    listen: str = DIRECT
    deployment: str = DEFAULT_DEPLOYMENT
    wait: float = 20.0

    @staticmethod
    def from_environment() -> BusOptions:
        """Options from SOFTSEAM_CONNECT, SOFTSEAM_LISTEN and SOFTSEAM_DEPLOYMENT."""
        return BusOptions(
            connect=os.environ.get("SOFTSEAM_CONNECT", DEFAULT_ENDPOINT),
            listen=os.environ.get("SOFTSEAM_LISTEN", DIRECT),
            deployment=os.environ.get("SOFTSEAM_DEPLOYMENT", DEFAULT_DEPLOYMENT),
        )

    @property
    def keys(self) -> Keys:
        return Keys(self.deployment)

    def open(self, role: str = SERVICE) -> Bus:
        """Join the bus. Raises BusError."""
        extra: dict[str, Any] = {}
        if self.listen:
            # a direct link saves the detour through the router: about half of a round trip
            extra = {"mode": "peer", "listen/endpoints": [self.listen], "connect/exit_on_failure": True}
        return Bus(self.connect, self.wait, extra, role)


def new_instance() -> str:
    """Names a process: differs after a restart."""
    return secrets.token_hex(6)
