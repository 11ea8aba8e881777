"""The router's process: every other process connects to it."""

from softseam_protocol.bus.client import Router
from softseam_services.lifeline import Lifeline


def serve_router(listen: str, life: Lifeline) -> None:
    """Route until the process is asked to stop. Raises PortBusy, BusError."""
    with Router(listen):
        life.state = "ready"
        life.stop.wait()
