"""Strangers at every door of real services: who is let in, and what of all that they try is obeyed."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
import strangers
from real_services import Services
from strangers import Attack
from trajectory import first_difference

from softseam.connected import ConnectedBackend
from softseam_protocol.bus.keys import CLIENT, VIEWER, read_key
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Recorded
from softseam_protocol.messages.session import StepReport
from softseam_services.health import expected

STEPS = 12
FRAMES = 2000
RIGHTS = {
    "nobody": (),
    VIEWER: ("joins", "watches"),
    CLIENT: ("joins", "opens a session", "watches"),
}
"""what is obeyed at the router, and may be"""


def credentials(who: str) -> tuple[str, str] | None:
    return (who, read_key(who).password) if who in (CLIENT, VIEWER) else None


def reports(backend: ConnectedBackend, steps: int) -> list[StepReport]:
    return [backend.step(1, None, False).report for _ in range(steps)]


@pytest.fixture(scope="module")
def undisturbed(services: Services, bar: Bundle) -> list[StepReport]:
    """The victim's run with nobody else there."""
    services.wait_well()
    backend = ConnectedBackend(bar, services.endpoint, record=True, timeout=60.0)
    backend.reset(0)
    try:
        return reports(backend, STEPS)
    finally:
        backend.close()


@pytest.fixture
def victim(services: Services, bar: Bundle) -> Iterator[ConnectedBackend]:
    services.wait_well()
    backend = ConnectedBackend(bar, services.endpoint, record=True, timeout=60.0)
    yield backend
    backend.close()


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
@pytest.mark.parametrize("who", RIGHTS)
def test_whoever_is_obeyed_at_the_router_has_a_right_to_it(
    services: Services, bar: Bundle, victim: ConnectedBackend, undisturbed: list[StepReport], who: str, mode: str
) -> None:
    """And the victim's run has the bits that it has alone, all of them recorded.

    mode  what the stranger says to zenoh that it is; those who have a right, and do not ask as clients do, may get less
    """
    obeyed = tried(who, mode, services, bar, victim)
    assert sorted(obeyed - {*RIGHTS[who]}) == []
    assert mode != "client" or obeyed == {*RIGHTS[who]}
    victim.reset(0)
    assert first_difference(undisturbed, reports(victim, STEPS)) == ""
    victim.close()
    assert isinstance(victim.recorded, Recorded) and victim.recorded.lost == 0, victim.unrecorded


@pytest.mark.parametrize("who", RIGHTS)
@pytest.mark.parametrize("service", expected())
def test_nobody_is_let_in_at_a_service_s_own_listener(services: Services, service: str, who: str) -> None:
    ports = strangers.listeners(services.children.pid(service))
    assert ports
    for port in ports:
        assert strangers.join(f"tcp/127.0.0.1:{port}", credentials(who)) is None


def test_what_a_client_mumbles_disturbs_nobody(
    services: Services, bar: Bundle, victim: ConnectedBackend, undisturbed: list[StepReport]
) -> None:
    """Requests with bytes changed, cut off or both, while another client's run has the bits that it has alone."""
    victim.reset(0)
    stranger = strangers.join(services.endpoint, credentials(CLIENT))
    with services.options.open() as friend, ThreadPoolExecutor(1) as pool:
        mumbled = pool.submit(strangers.mumbles, Attack(stranger, victim, friend, bar), FRAMES, 1)
        while not mumbled.done():
            victim.reset(0)
            assert first_difference(undisturbed, reports(victim, STEPS)) == ""
        assert mumbled.result() == 0
    stranger.close()


def tried(who: str, mode: str, services: Services, bar: Bundle, victim: ConnectedBackend) -> set[str]:
    """What was obeyed of all that a stranger tries at the router."""
    victim.reset(0)
    stranger = strangers.join(services.endpoint, credentials(who), mode=mode)
    if stranger is None:
        return set()
    with services.options.open() as friend:
        found = strangers.obeyed(Attack(stranger, victim, friend, bar))
    stranger.close()
    return {"joins", *found}
