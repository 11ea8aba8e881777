"""Real services over a real router, started once for all tests of a worker that use them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from real_services import LIMITS, Lines, Services, free_port, squeezed_bar

from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.errors import NoReply, Refused
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor


@pytest.fixture(scope="session", autouse=True)
def state_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Sessions are kept in a folder of the tests' own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(home := tmp_path_factory.mktemp("state")))
        yield home


@pytest.fixture(scope="session")
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    """Router, fem, pbd, recorder and orchestrator under a supervisor."""
    recordings = tmp_path_factory.mktemp("recordings")
    options = BusOptions(connect=f"tcp/127.0.0.1:{free_port()}")
    lines = Lines()
    with supervisor(UpOptions(options, recordings, limits=LIMITS), lines) as children:
        running = Services(options, children, lines, recordings)
        running.wait_well()
        yield running


@pytest.fixture
def bus(services: Services) -> Iterator[Bus]:
    """A client's session on the services' bus; all services are well, and heard there, when the test begins."""
    services.wait_well()
    with Bus(services.endpoint, role=SERVICE) as opened:
        keys = Keys()
        for key in (keys.orchestrator, keys.participant("fem"), keys.participant("pbd")):
            end = time.monotonic() + 10.0
            while not _is_heard(opened, key):
                assert time.monotonic() < end, key
                time.sleep(0.01)  # the pace of asking
        yield opened


def _is_heard(bus: Bus, key: str) -> bool:
    """Whether somebody answers there, if only that he cannot read it."""
    try:
        bus.request(key, b"", 10.0)
    except Refused:
        return True
    except NoReply:
        return False
    return True


@pytest.fixture(scope="session")
def bar() -> Bundle:
    return bundle_scene(squeezed_bar())
