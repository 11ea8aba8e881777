"""Strangers at every door of real services: who is let in, and what of all that they try is obeyed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import pytest
import strangers
from real_services import Services
from strangers import Attack
from trajectory import first_difference

from softseam.connected import ConnectedBackend
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import StepReport
from softseam_services.health import expected

STEPS = 12

pytestmark = pytest.mark.xfail(strict=True, reason="the bus is open to whoever reaches it")


def reports(backend: ConnectedBackend, steps: int) -> list[StepReport]:
    return [backend.step(1, None, False).report for _ in range(steps)]


@pytest.fixture(scope="module")
def undisturbed(services: Services, bar: Bundle) -> list[StepReport]:
    """The victim's run with nobody else there."""
    services.wait_well()
    backend = ConnectedBackend(bar, services.endpoint, record=False, timeout=60.0)
    backend.reset(0)
    try:
        return reports(backend, STEPS)
    finally:
        backend.close()


@pytest.fixture
def victim(services: Services, bar: Bundle) -> Iterator[ConnectedBackend]:
    services.wait_well()
    backend = ConnectedBackend(bar, services.endpoint, record=True, timeout=60.0)
    backend.reset(0)
    yield backend
    with contextlib.suppress(Exception):
        backend.close()


def test_what_nobody_tries_at_the_router_is_not_obeyed(
    services: Services, bar: Bundle, victim: ConnectedBackend, undisturbed: list[StepReport]
) -> None:
    """And the victim's run has the bits that it has alone."""
    assert tried(services.endpoint, services, bar, victim) == set()
    assert first_difference(undisturbed, reports(victim, STEPS)) == ""


@pytest.mark.parametrize("service", expected())
def test_what_nobody_tries_at_a_service_s_own_listener_is_not_obeyed(
    services: Services, bar: Bundle, victim: ConnectedBackend, service: str
) -> None:
    ports = strangers.listeners(services.children.pid(service))
    assert ports
    for port in ports:
        assert tried(f"tcp/127.0.0.1:{port}", services, bar, victim) == set()


def tried(endpoint: str, services: Services, bar: Bundle, victim: ConnectedBackend) -> set[str]:
    """What was obeyed of all that a stranger tries through one door."""
    stranger = strangers.join(endpoint, None)
    if stranger is None:
        return set()
    with services.options.open() as friend:
        found = strangers.obeyed(Attack(stranger, victim, friend, bar))
    stranger.close()
    return {"joins", *found}
