"""The same trajectory, bit for bit, embedded and over the bus, whatever happens to the processes meanwhile."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable

import pytest
from real_services import READY, Services, squeezed_bar
from several_bodies import several
from trajectory import first_difference, same_frame

from softseam.connected import ConnectedBackend
from softseam.variants import with_settings
from softseam_protocol.bus.client import Bus
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Event, Frame, Observation, StepReport
from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

pytestmark = pytest.mark.slow

STEPS = 150
"""many enough that a test which is late, on a busy machine, by a second still meddles while they are taken"""
FOLD = """
softseam: 1
name: fold
duration: 1.5
body: {kind: sheet, size: [0.2, 0.1], divisions: [20, 10], density: 0.3, stretch: 500, position: [0, 0, 0.004]}
tools:
  ground: {kind: plane, friction: 0.5}
  hand: {kind: box, size: [0.01, 0.08, 0.006], position: [0.11, 0, 0.005]}
motion:
  - {tools: [hand], grip: 0.05}
  - {tools: [hand], turn: [0, -2.8, 0], speed: 7.0, about: [0, 0, 0.01]}
  - {tools: [hand], release: 0.02}
"""


@pytest.fixture(scope="module")
def bar() -> Bundle:
    return bundle_scene(with_settings(squeezed_bar(), [f"duration={0.01 * STEPS}"]))


@pytest.fixture(scope="module")
def reference(bar: Bundle) -> tuple[list[StepReport], Frame]:
    """The run in one process."""
    simulation = Simulation(bar, EmbeddedTransport())
    reports = [simulation.step(fields=n == STEPS - 1) for n in range(STEPS)]
    frame = simulation.frame()
    simulation.close()
    return reports, frame


class Watcher:
    """Collects a session's reports in a thread, and calls `act` once when a step is reached."""

    def __init__(self, bus: Bus, session: str, at_step: int = -1, act: Callable[[], None] = lambda: None) -> None:
        self.reports: list[StepReport] = []
        self.acted_at = 0.0
        self._at, self._act = at_step, act
        self._changed = threading.Condition()
        self._inbox = bus.subscribe(Keys().session(session, StepReport))
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        while not self._inbox.closed:
            received = self._inbox.get(0.2)
            if received is None:
                continue
            with self._changed:
                self.reports.append(decode(received.payload, StepReport))
                self._changed.notify_all()
            if len(self.reports) == self._at:
                self.acted_at = time.monotonic()
                self._act()

    def wait_for(self, count: int) -> list[StepReport]:
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.reports) >= count, 30.0), f"{len(self.reports)} reports"
        return self.reports

    def close(self) -> None:
        self._inbox.close()
        self._thread.join(5.0)


def run(
    services: Services, bus: Bus, bundle: Bundle, at_step: int = -1, act: Callable[[], None] = lambda: None
) -> tuple[list[StepReport], Observation, float]:
    """Step a session through the orchestrator in one request; `act` happens meanwhile."""
    backend = ConnectedBackend(bundle, services.endpoint, record=False, timeout=READY)
    watcher = Watcher(bus, backend.session, at_step, act)
    try:
        backend.reset(0)
        began = time.monotonic()
        observation = backend.step(STEPS, None, True)
        ended = time.monotonic()
        assert at_step < 0 or 0.0 < watcher.acted_at < ended, "the run was over before anything happened to it"
        reports = watcher.wait_for(STEPS)
    finally:
        watcher.close()
        backend.close()
    return reports, observation, ended - began


def test_the_bus_changes_no_bit(
    services: Services, bus: Bus, bar: Bundle, reference: tuple[list[StepReport], Frame]
) -> None:
    reports, observation, _ = run(services, bus, bar)
    assert first_difference(reference[0], reports) == ""
    assert observation.frames and same_frame(reference[1], observation.frames["body"])
    assert first_difference([observation.report], reports[-1:]) == ""


def test_a_sheet_is_gripped_the_same_over_the_bus(services: Services, bus: Bus) -> None:
    """Folded by a gripper while PBD's process is killed: reports, stretch and the last frame, bit for bit."""
    bundle = bundle_scene(parse_scene(FOLD))
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step(fields=False) for _ in range(STEPS)]
    frame = simulation.frame()
    simulation.close()
    assert wanted[10].quantities["held"] > 0.0 and wanted[-1].quantities["held"] == 0.0
    reports, observation, _ = run(
        services, bus, bundle, 20, lambda: os.kill(services.children.pid("pbd"), signal.SIGKILL)
    )
    assert first_difference(wanted, reports) == ""
    assert observation.frames and same_frame(frame, observation.frames["body"])
    assert "participant_restored" in [event.kind for event in observation.events]


@pytest.mark.slow
def test_several_bodies_are_the_same_over_the_bus(services: Services, bus: Bus) -> None:
    """FEM's process, which holds parts of two of them, is killed meanwhile: reports and last frames, bit for bit."""
    bundle = bundle_scene(with_settings(several(), [f"duration={0.01 * STEPS}"]))
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step(fields=n == STEPS - 1) for n in range(STEPS)]
    frames = simulation.frames()
    simulation.close()
    reports, observation, _ = run(
        services, bus, bundle, 20, lambda: os.kill(services.children.pid("fem"), signal.SIGKILL)
    )
    assert first_difference(wanted, reports) == ""
    assert all(same_frame(frame, observation.frames[name]) for name, frame in frames.items())
    restored = [event.message for event in observation.events if event.kind == "participant_restored"]
    assert all(any(part in text for text in restored) for part in ("jelly.far", "tofu.near"))


@pytest.mark.parametrize(
    ("victim", "number"),
    [("fem", signal.SIGKILL), ("pbd", signal.SIGKILL), ("fem", signal.SIGSTOP), ("pbd", signal.SIGSTOP)],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_a_participant_is_lost_and_nothing_shows(
    services: Services,
    bus: Bus,
    bar: Bundle,
    reference: tuple[list[StepReport], Frame],
    victim: str,
    number: signal.Signals,
    record_property: Callable[[str, object], None],
) -> None:
    """Killed or frozen in the middle of a step: restarted, restored, caught up; the client never notices."""
    pid = services.children.pid(victim)
    reports, observation, seconds = run(services, bus, bar, 20, lambda: os.kill(pid, number))
    assert services.children.pid(victim) != pid, "the process was not replaced"
    assert first_difference(reference[0], reports) == ""
    assert observation.frames and same_frame(reference[1], observation.frames["body"])
    kinds = [event.kind for event in observation.events]
    assert "participant_lost" in kinds and "participant_restored" in kinds, kinds
    record_property("seconds", round(seconds, 2))


def test_both_participants_are_killed_at_once(
    services: Services, bus: Bus, bar: Bundle, reference: tuple[list[StepReport], Frame]
) -> None:
    pids = [services.children.pid(name) for name in ("fem", "pbd")]

    def kill() -> None:
        for pid in pids:
            os.kill(pid, signal.SIGKILL)

    reports, _, _ = run(services, bus, bar, 30, kill)
    assert first_difference(reference[0], reports) == ""


def test_a_participant_is_killed_again_while_it_catches_up(
    services: Services, bus: Bus, bar: Bundle, reference: tuple[list[StepReport], Frame]
) -> None:
    first = services.children.pid("fem")

    def kill_twice() -> None:
        os.kill(first, signal.SIGKILL)
        services.lines.wait_for("fem", "is ready (pid", after=len(services.lines.lines))
        os.kill(services.children.pid("fem"), signal.SIGKILL)

    reports, _, _ = run(services, bus, bar, 40, kill_twice)
    assert first_difference(reference[0], reports) == ""


def test_the_router_is_restarted(
    services: Services, bus: Bus, bar: Bundle, reference: tuple[list[StepReport], Frame]
) -> None:
    """Orchestrator and participants talk directly, so a run goes on without the router; clients find it again."""
    pid = services.children.pid("router")
    backend = ConnectedBackend(bar, services.endpoint, record=False, timeout=READY)
    try:
        backend.reset(0)
        reports = [backend.step(1, None, False).report for _ in range(20)]
        said = len(services.lines.lines)
        os.kill(pid, signal.SIGKILL)
        services.lines.wait_for("router", "SIGKILL", "restarting", after=said)
        reports += [backend.step(1, None, n == STEPS - 1).report for n in range(20, STEPS)]
    finally:
        backend.close()
    assert first_difference(reference[0], reports) == ""


def test_a_saved_state_survives_everything(services: Services, bus: Bus, bar: Bundle) -> None:
    """Saved over the bus, loaded by another session, continued: the same bits."""
    first = ConnectedBackend(bar, services.endpoint, record=False, timeout=READY)
    first.reset(0)
    first.step(15, None, False)
    state, estimate = first.save(), first.estimate()
    assert estimate is not None and estimate.text
    onward = [first.step(1, None, False).report for _ in range(10)]
    first.close()
    second = ConnectedBackend(bar, services.endpoint, record=False, timeout=READY)
    second.load(state)
    assert second.estimate() == estimate
    again = [second.step(1, None, False).report for _ in range(10)]
    second.close()
    assert first_difference(onward, again) == ""


def test_two_sessions_at_once_do_not_disturb_each_other(
    services: Services, bus: Bus, bar: Bundle, reference: tuple[list[StepReport], Frame]
) -> None:
    results: dict[int, list[StepReport]] = {}

    def one(n: int) -> None:
        results[n] = run(services, bus, bar)[0]

    threads = [threading.Thread(target=one, args=(n,)) for n in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(READY)
    assert set(results) == {0, 1}
    for reports in results.values():
        assert first_difference(reference[0], reports) == ""


def test_the_bus_costs_little(services: Services, bus: Bus, bar: Bundle) -> None:
    """An event at the session's end compares an exchange with an echo of the same size."""
    backend = ConnectedBackend(bar, services.endpoint, record=False, timeout=READY)
    inbox = bus.subscribe(Keys().session(backend.session, Event))
    backend.reset(0)
    backend.step(STEPS, None, False)
    backend.close()
    while (received := inbox.get(5.0)) is not None:
        event = decode(received.payload, Event)
        if event.kind == "bus":
            break
    inbox.close()
    assert received is not None, "no event about the bus"
    assert "an echo of the same" in event.message
