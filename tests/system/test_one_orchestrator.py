"""An orchestrator serves a deployment alone: a second one is refused, its own successor is not."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest
from real_services import READY, free_port

from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.topics import Keys
from softseam_services.health import probe
from softseam_services.orchestrator import service
from softseam_services.orchestrator.service import AlreadyServed, wait_to_be_only

KEYS = Keys()
TOKEN = KEYS.live("orchestrator", "orchestrator", "first")


@pytest.fixture
def endpoint() -> Iterator[str]:
    where = f"tcp/127.0.0.1:{free_port()}"
    with Router(where):
        yield where


def test_a_second_orchestrator_is_refused_and_told_of_the_first(endpoint: str) -> None:
    with Bus(endpoint, role=SERVICE) as first:
        first.declare_live(TOKEN)
        command = [sys.executable, "-m", "softseam_services", "serve", "orchestrator", "--connect", endpoint]
        done = subprocess.run(command, capture_output=True, text=True, timeout=READY, check=False)
    assert done.returncode == 2, done.stderr
    assert f"an orchestrator serves the deployment 'local' at {endpoint} already (instance first)" in done.stderr
    assert "Traceback" not in done.stderr


def test_who_follows_an_orchestrator_waits_until_it_is_gone(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of another deployment is none of its business, and who is to stop waits for nobody."""
    stop = threading.Event()
    with Bus(endpoint, role=SERVICE) as bus, Bus(endpoint, role=SERVICE) as other, Bus(endpoint, role=SERVICE) as first:
        other.declare_live(Keys("other").live("orchestrator", "orchestrator", "i"))
        wait_to_be_only(bus, KEYS, stop)
        first.declare_live(TOKEN)
        goes = threading.Timer(1.0, first.close)
        goes.start()
        began = time.monotonic()
        wait_to_be_only(bus, KEYS, stop)
        assert time.monotonic() - began > 0.8
        goes.join()
        other.declare_live(TOKEN)
        monkeypatch.setattr(service, "PATIENCE", 0.3)
        with pytest.raises(AlreadyServed, match="instance first"):
            wait_to_be_only(bus, KEYS, stop)
        monkeypatch.setattr(service, "PATIENCE", 60.0)
        stop.set()
        wait_to_be_only(bus, KEYS, stop)


def test_health_tells_of_two(endpoint: str) -> None:
    """Of orchestrators, which upset each other; participants may be several."""
    with (
        Bus(endpoint, role=SERVICE) as bus,
        Bus(endpoint, role=SERVICE) as first,
        Bus(endpoint, role=SERVICE) as second,
    ):
        for one, name in ((first, "first"), (second, "second")):
            for role, service in (("orchestrator", "orchestrator"), ("participant", "fem")):
                one.declare_live(KEYS.live(role, service, name))
        end = time.monotonic() + 5.0
        while len(bus.live(KEYS.every_live())) < 4:
            assert time.monotonic() < end
        found = {one.service: one for one in probe(bus, KEYS, ("fem", "orchestrator"), beats=False)}
        assert found["fem"].state == "well" and found["orchestrator"].state == "doubled"
        assert str(found["orchestrator"]) == "orchestrator: several of them run and upset each other: stop all but one"
