"""Sessions whose clients were killed make room; those of clients that live, idle or not, stay."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from real_services import free_port

from softseam.connected import ConnectedBackend
from softseam.errors import SimulationFailed
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import End
from softseam_protocol.scene.file import bundle_scene, scene_json
from softseam_protocol.scene.scene import Scene
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode
from softseam_services.bus_options import BusOptions
from softseam_services.lifeline import Lifeline
from softseam_services.orchestrator import service
from softseam_services.participant_service import serve_participant

KEYS = Keys()
SHEET = Scene.model_validate(
    {
        "softseam": 1,
        "name": "sheet",
        "duration": 0.1,
        "step": 0.01,
        "body": {
            "kind": "sheet",
            "size": [0.1, 0.1],
            "divisions": [4, 4],
            "position": [0.0, 0.0, 0.05],
            "density": 0.2,
            "stretch": 100.0,
        },
        "tools": {"ground": {"kind": "plane", "friction": 0.5}},
    }
)
VICTIM = """
import sys
from softseam.connected import ConnectedBackend
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.file import bundle_scene
bundle = bundle_scene(Scene.model_validate_json(sys.argv[2]))
sessions = [ConnectedBackend(bundle, sys.argv[1], record=False, timeout=20.0) for _ in range(int(sys.argv[3]))]
for one in sessions:
    one.reset(0)
print(*[one.session for one in sessions], flush=True)
sys.stdin.read()
"""


@contextmanager
def serving(serve: Callable[[Lifeline], None]) -> Iterator[Lifeline]:
    """A service in a thread of its own, ready."""
    with Lifeline(signals=False) as life:
        thread = threading.Thread(target=serve, args=(life,))
        thread.start()
        try:
            yield life
        finally:
            life.request_stop()
            thread.join(60.0)
            assert not thread.is_alive()


@pytest.fixture(scope="module")
def participants() -> Iterator[str]:
    """Endpoint of a router with a participant behind it."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with Router(endpoint), serving(lambda life: serve_participant("pbd", BusOptions(endpoint), life)):
        yield endpoint


@pytest.fixture
def endpoint(participants: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The same with an orchestrator that has room for three sessions."""
    monkeypatch.setattr(service, "MOST_SESSIONS", 3)
    monkeypatch.setattr(service, "LEFT_IN_NEED", 1.0)
    with serving(lambda life: service.serve_orchestrator(BusOptions(participants), life)):
        yield participants


@pytest.fixture(scope="module")
def sheet() -> Bundle:
    return bundle_scene(SHEET)


@contextmanager
def victim(endpoint: str, count: int) -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    """A process that has some sessions open; it is killed at the end, if not before."""
    command = [sys.executable, "-c", VICTIM, endpoint, scene_json(SHEET), str(count)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout.readline().split()
        finally:
            process.kill()


@contextmanager
def client(endpoint: str, bundle: Bundle) -> Iterator[ConnectedBackend]:
    backend = ConnectedBackend(bundle, endpoint, record=False, timeout=30.0)
    try:
        yield backend
    finally:
        backend.close()


def test_killed_clients_make_room_and_idle_ones_keep_theirs(endpoint: str, sheet: Bundle) -> None:
    with client(endpoint, sheet) as idle:
        idle.reset(0)
        with victim(endpoint, 2) as (process, sessions):
            assert len(sessions) == 2
            with pytest.raises(SimulationFailed, match="3 sessions are open: close one"):
                ConnectedBackend(sheet, endpoint, record=False, timeout=30.0)
            process.kill()
            with client(endpoint, sheet) as second, client(endpoint, sheet) as third:
                for one in (idle, second, third):
                    assert one.step(1, None, False).report.header.step == 0


def test_a_session_whose_client_is_gone_for_long_is_ended(
    endpoint: str, sheet: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though there is room, so that what it holds is freed; not one of a client that lives."""
    monkeypatch.setattr(service, "LEFT", 1.0)
    with (
        Bus(endpoint, role=SERVICE) as bus,
        client(endpoint, sheet) as idle,
        victim(endpoint, 1) as (process, (session,)),
    ):
        idle.reset(0)
        ends = bus.subscribe(KEYS.session_all(session))
        process.kill()
        received = ends.get(20.0)
        assert received is not None, "it was not ended"
        assert decode(received.payload, End).reason == "its client has gone"
        assert idle.step(1, None, False).report.header.step == 0


def test_sessions_without_a_token_give_way_at_once(
    endpoint: str, sheet: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever takes all places and shows no sign of life keeps nobody out; a client that lives keeps its place."""
    with client(endpoint, sheet) as idle:
        idle.reset(0)
        with monkeypatch.context() as patched:
            patched.setattr(Bus, "declare_live", lambda bus, key: None)
            silent = [ConnectedBackend(sheet, endpoint, record=False, timeout=30.0) for _ in range(4)]
        for one in silent:
            one._bus.close()
        began = time.monotonic()
        with client(endpoint, sheet) as second, client(endpoint, sheet) as third:
            assert time.monotonic() - began < 5.0, "at once, though they were used just now"
            for one in (idle, second, third):
                assert one.step(1, None, False).report.header.step == 0
            with pytest.raises(SimulationFailed, match="3 sessions are open: close one"):
                ConnectedBackend(sheet, endpoint, record=False, timeout=30.0)


def test_a_restart_of_the_router_ends_no_session(sheet: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    """All tokens go with it, for longer than a client may be gone, and come back."""
    monkeypatch.setattr(service, "LEFT", 3.0)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    options = BusOptions(endpoint)
    router = Router(endpoint)
    with (
        serving(lambda life: serve_participant("pbd", options, life)),
        serving(lambda life: service.serve_orchestrator(options, life)),
        client(endpoint, sheet) as idle,
    ):
        idle.reset(0)
        router.close()
        threading.Event().wait(2.0 * service.LEFT)
        with Router(endpoint), Bus(endpoint, role=SERVICE) as bus:
            end = time.monotonic() + 20.0
            while not (bus.live(KEYS.every_live("client")) and bus.live(KEYS.every_live("orchestrator"))):
                assert time.monotonic() < end, "the tokens did not come back"
            assert idle.step(1, None, False).report.header.step == 0
            idle.close()
