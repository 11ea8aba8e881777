"""A pile over the bus: the same bits as in one process, though its participant is killed or frozen meanwhile."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable

import pytest
from cubes import cubes, piled, unlike
from real_services import READY, Services
from trajectory import first_difference, same_frame
from trays import awake, pressed

from softseam.connected import ConnectedBackend
from softseam_protocol.bus.client import Bus
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

pytestmark = pytest.mark.slow

STEPS = 45
"""within the motion of the tools"""


def eight() -> Scene:
    """Cubes that fall on one another, and slide."""
    return piled(2, 2, 1, gravity=[2.0, 1.0, -9.0])


@pytest.mark.parametrize(
    ("scene", "number"),
    [(unlike, 0), (unlike, signal.SIGKILL), (unlike, signal.SIGSTOP), (eight, 0), (eight, signal.SIGKILL)],
)
def test_a_pile_is_the_same_over_the_bus(services: Services, bus: Bus, scene: Callable[[], Scene], number: int) -> None:
    """Four bodies between tools, one of which is gripped, or eight that touch: reports and last frames, bit for bit."""
    bundle = bundle_scene(scene())
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step(fields=n == STEPS - 1) for n in range(STEPS)]
    frames = simulation.frames()
    simulation.close()
    backend, reports = ConnectedBackend(bundle, services.endpoint, record=False, timeout=READY), []
    events = []
    try:
        backend.reset(0)
        for step in range(STEPS):
            if number and step == 30:
                os.kill(services.children.pid("pbd"), number)
            observation = backend.step(1, None, step == STEPS - 1)
            reports.append(observation.report)
            events += observation.events
    finally:
        backend.close()
    assert first_difference(wanted, reports) == ""
    assert all(same_frame(frame, observation.frames[name]) for name, frame in frames.items())
    assert bool(number) == any(event.kind == "participant_restored" for event in events)


@pytest.mark.parametrize("number", [0, signal.SIGKILL])
def test_a_tray_sleeps_the_same_over_the_bus(services: Services, bus: Bus, number: int) -> None:
    """Nine cubes that fall asleep, of which one is pressed and wakes its neighbours: its process is killed while some
    sleep, and reports and last frames are those of one process, bit for bit."""
    bundle = bundle_scene(pressed(sleep="calm"))
    simulation = Simulation(bundle, EmbeddedTransport())
    steps = simulation.expected_steps
    assert steps is not None
    wanted = [simulation.step(fields=n == steps - 1) for n in range(steps)]
    frames = simulation.frames()
    simulation.close()
    some = [n for n, one in enumerate(wanted) if 0 < len(awake(one)) < 9]
    dies = [some[0] + 1, some[len(some) // 2], some[-2]] if number else []
    backend, reports = ConnectedBackend(bundle, services.endpoint, record=False, timeout=READY), []
    events = []
    try:
        backend.reset(0)
        for step in range(steps):
            if step in dies:
                services.wait_well()
                os.kill(services.children.pid("pbd"), number)
            observation = backend.step(1, None, step == steps - 1)
            reports.append(observation.report)
            events += observation.events
    finally:
        backend.close()
    assert first_difference(wanted, reports) == ""
    assert all(same_frame(frame, observation.frames[name]) for name, frame in frames.items())
    assert sum(event.kind == "participant_restored" for event in events) == len(dies)


def test_more_bodies_than_a_service_keeps_parts(services: Services, bus: Bus) -> None:
    """80 bodies are one part: none is given up for another."""
    backend = ConnectedBackend(bundle_scene(cubes(80)), services.endpoint, record=False, timeout=READY)
    try:
        backend.reset(0)
        seen = backend.step(5, None, True)
    finally:
        backend.close()
    assert len(seen.frames) == len(seen.report.parts) == 80 and not seen.events
