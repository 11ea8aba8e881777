"""Sessions outlive their orchestrator: whenever it is killed, clients end with the same bits and open nothing anew."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from full_disk import files_up_to
from real_services import LIMITS, READY, Lines, Services, free_port, squeezed_bar
from test_left_sessions import SHEET, serving
from trajectory import bits, first_difference, same_frame

from softseam.connected import ConnectedBackend
from softseam.errors import SoftseamError
from softseam.recording import Recording
from softseam.variants import with_settings
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.errors import NoReply
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Close, Closed, Frame, Observation, Open, Step, StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor
from softseam_services.orchestrator import client_session
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.kept_session import KeptSession
from softseam_services.orchestrator.service import serve_orchestrator
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.participant_service import serve_participant

pytestmark = pytest.mark.slow

STEPS = 160


@pytest.fixture(scope="module")
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    """Whose supervisor does not give up on an orchestrator that dies again and again."""
    recordings = tmp_path_factory.mktemp("recordings")
    options = BusOptions(connect=f"tcp/127.0.0.1:{free_port()}")
    lines = Lines()
    limits = replace(LIMITS, attempts=1000, longest_pause=0.1)
    with supervisor(UpOptions(options, recordings, limits=limits), lines) as children:
        running = Services(options, children, lines, recordings)
        running.wait_well()
        yield running


@pytest.fixture(scope="module")
def bar() -> Bundle:
    return bundle_scene(with_settings(squeezed_bar(), [f"duration={0.01 * STEPS}"]))


@pytest.fixture(scope="module")
def reference(bar: Bundle) -> tuple[list[StepReport], Frame]:
    simulation = Simulation(bar, EmbeddedTransport())
    reports = [simulation.step(fields=n == STEPS - 1) for n in range(STEPS)]
    frame = simulation.frame()
    simulation.close()
    return reports, frame


@pytest.fixture(scope="module")
def participants() -> Iterator[str]:
    """Endpoint of a router with a participant behind it, in this process."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with Router(endpoint), serving(lambda life: serve_participant("pbd", BusOptions(endpoint), life)):
        yield endpoint


@pytest.fixture
def endpoint(participants: str) -> Iterator[str]:
    """The same with an orchestrator."""
    with serving(lambda life: serve_orchestrator(BusOptions(participants), life)):
        yield participants


def kill(services: Services, name: str = "orchestrator") -> None:
    said = len(services.lines.lines)
    os.kill(services.children.pid(name), signal.SIGKILL)
    services.lines.wait_for(name, "restarting", after=said)


@contextmanager
def client(services: Services, bundle: Bundle, record: bool = False) -> Iterator[ConnectedBackend]:
    backend = ConnectedBackend(bundle, services.endpoint, record=record, timeout=READY)
    try:
        yield backend
    finally:
        backend.close()


def every_request(services: Services, bundle: Bundle, killed: bool) -> list[Observation]:
    """What a client that makes all requests is answered, its orchestrator being killed after each kind of them."""

    def die() -> None:
        if killed:
            kill(services)

    seen = []
    with client(services, bundle) as backend:
        die()
        seen.append(backend.reset(0))
        die()
        seen += [backend.step(1, None, False) for _ in range(3)]
        die()
        while len(seen) < 21:
            seen += backend.follow(21 - len(seen))
        die()
        estimate = backend.estimate()
        die()
        assert backend.estimate() == estimate is not None
        state = backend.save()
        die()
        away = backend.step(5, {"front": np.array([0.0, 0.01, 0.0])}, False).report
        backend.load(state)
        die()
        assert first_difference([away], [backend.step(5, {"front": np.array([0.0, 0.01, 0.0])}, False).report]) == ""
        seen.append(backend.load(state))
        seen += [backend.step(2, None, False) for _ in range(STEPS // 2 - 11)]
        die()
        seen.append(backend.step(1, None, True))
        assert killed == ("restored" in [event.kind for event in seen[-1].events])
    return seen


def test_a_client_goes_on_after_each_kind_of_request(services: Services, bus: Bus, bar: Bundle) -> None:
    """Open, Reset, Step, with all observations, Estimate, Save, Load: answers are those of a run without a kill."""
    calm, killed = (every_request(services, bar, killed) for killed in (False, True))
    assert first_difference([seen.report for seen in calm], [seen.report for seen in killed]) == ""
    assert all(bits(one.frames) == bits(other.frames) for one, other in zip(calm, killed, strict=True))


def test_it_is_killed_in_the_middle_of_long_requests(
    services: Services, bus: Bus, bar: Bundle, reference: tuple[list[StepReport], Frame]
) -> None:
    """Again and again while a single request is at work, whose answer comes all the same."""
    with client(services, bar) as backend:
        backend.reset(0)
        kills, over = [0], threading.Event()

        def go_on_killing() -> None:
            while not over.wait(0.4) and kills[0] < 4:
                kill(services)
                services.wait_well()
                kills[0] += 1

        killer = threading.Thread(target=go_on_killing)
        killer.start()
        observation = backend.step(STEPS, None, True)
        over.set()
        killer.join()
    assert kills[0] >= 1, "the run was over before anything happened to it"
    assert first_difference([observation.report], reference[0][-1:]) == ""
    assert same_frame(reference[1], observation.frames["body"])


def test_a_recording_goes_on_in_a_linked_file(services: Services, bus: Bus, bar: Bundle) -> None:
    """Three files, which are read as one run: every step once, and the commands to verify it by."""
    with client(services, bar, record=True) as backend:
        backend.reset(0)
        for _ in range(3):
            for _ in range(50):
                backend.step(1, None, False)
            time.sleep(2.1)  # a state is kept so often at most
            kill(services)
        while backend.step(1, None, False).report.done is False:
            pass
    assert backend.recorded is not None and backend.recorded.state == "closed", backend.unrecorded
    files = sorted(services.recordings.glob(f"{backend.session}*.mcap"))
    recording = Recording(Path(backend.recorded.path))
    assert len(files) >= 3
    simulation = Simulation(bar, EmbeddedTransport())
    reports = [simulation.step(fields=n % 4 == 3) for n in range(STEPS)]
    simulation.close()
    assert first_difference(reports, list(recording.reports())) == ""
    assert recording.note is None
    assert recording.counts["StepReport"] == STEPS == len(list(recording.reports()))
    assert sum(recording.counts.values()) - recording.counts["SurfaceMesh"] == len(list(recording))
    times = [frame.header.time for frame in recording.frames()]
    assert times == sorted(set(times))


def test_a_session_that_was_closed_is_not_kept(services: Services, bus: Bus, bar: Bundle) -> None:
    """Nor one whose file is damaged taken up; files are closed to others."""
    folder = Path(os.environ["XDG_STATE_HOME"]) / "softseam/sessions/local"
    with client(services, bar) as backend:
        backend.reset(0)
        path = folder / backend.session
        assert path.stat().st_mode & 0o777 == 0o600 and folder.stat().st_mode & 0o777 == 0o700
    assert not path.exists()
    backend = ConnectedBackend(bar, services.endpoint, record=False, timeout=60.0)
    backend.reset(0)
    kill(services)
    path = folder / backend.session
    content = bytearray(path.read_bytes())
    content[100] ^= 1
    path.write_bytes(content)
    with pytest.raises(SoftseamError, match=r"lost with its orchestrator, .* damaged"):
        backend.step(1, None, False)
    assert not path.exists()
    backend.close()


def test_a_request_that_is_repeated_gets_the_same_answer(services: Services, bus: Bus, bar: Bundle) -> None:
    """Where the first answer was lost with the orchestrator: what was asked is not done twice."""

    def ask(session: str, number: int, kind: Callable[[Header], Open | Step | Close], reply: type) -> Any:
        request = kind(Header(SCHEMA_VERSION, session, "", 0, 0, number, 0.0))
        end = time.monotonic() + READY
        while True:
            try:
                return bus.call(Keys().orchestrator, request, reply, READY)
            except NoReply:
                assert time.monotonic() < end
                services.wait_well()

    seen: dict[bool, list[Observation]] = {}
    for killed in (False, True):
        name, answers = f"session{killed}", seen.setdefault(killed, [])
        ask(name, 1, lambda header: Open(header, bar), Observation)
        for number in range(2, 8):
            for repeated in range(2 if killed else 1):
                answers[number - 2 :] = [ask(name, number, lambda header: Step(header, 4, True, {}), Observation)]
                if killed and not repeated:
                    kill(services)
        ask(name, 8, Close, Closed)
    for one, other in zip(seen[False], seen[True], strict=True):
        assert one.header.step == other.header.step
        assert bits(one.report) == bits(other.report) and bits(one.frames) == bits(other.frames)


def test_on_a_full_disk_the_run_goes_on(endpoint: str, monkeypatch: pytest.MonkeyPatch, state_home: Path) -> None:
    """With an event, the same bits, and nothing old left on the disk; it is kept again once there is room."""
    monkeypatch.setattr(client_session, "SPELL", 0.0)
    bundle = bundle_scene(SHEET.model_copy(update={"duration": 1.0}))
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step() for _ in range(60)]
    simulation.close()
    backend = ConnectedBackend(bundle, endpoint, record=False, timeout=READY)
    try:
        backend.reset(0)
        path = state_home / "softseam/sessions/local" / backend.session
        seen = [backend.step(1, None, False) for _ in range(10)]
        with files_up_to(path.stat().st_size + 50):
            seen += [backend.step(1, None, False) for _ in range(10)]
        assert not path.exists()
        said = [event.message for each in seen for event in each.events if event.kind == "kept"]
        assert len(said) == 1 and "would end with its orchestrator" in said[0]
        seen += [backend.step(1, None, False) for _ in range(40)]
        assert KeptSession(path.parent, backend.session).read()[0].steps == 50
    finally:
        backend.close()
    assert first_difference(wanted, [each.report for each in seen]) == ""
    assert not path.exists()


def test_a_stopped_orchestrator_leaves_its_sessions_to_the_next(
    participants: str, state_home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is asked to stop, as by `softseam up` being started anew."""
    with serving(lambda life: serve_orchestrator(BusOptions(participants), life)):
        backend = ConnectedBackend(bundle_scene(SHEET), participants, record=False, timeout=READY)
        backend.reset(0)
        first = backend.step(3, None, False)
    with serving(lambda life: serve_orchestrator(BusOptions(participants), life)):
        second = backend.step(3, None, False)
        assert second.header.step == 6 == first.header.step + 3
        assert "restored" in [event.kind for event in second.events]
        backend.close()
        assert not (state_home / "softseam/sessions/local" / backend.session).exists()
