"""Bodies that touch by the scene's `contacts`, over the bus: the same bits, reports of pairs and all, though their
participant is killed."""

from __future__ import annotations

import os
import signal

import pytest
from cubes import tray
from real_services import READY, Services
from trajectory import first_difference, same_frame
from trays import awake, gripped

from softseam.connected import ConnectedBackend
from softseam_protocol.bus.client import Bus
from softseam_protocol.scene.file import bundle_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

pytestmark = pytest.mark.slow

STEPS = 60
"""in which fingers close"""


def test_a_tray_is_the_same_over_the_bus(services: Services, bus: Bus) -> None:
    bundle = bundle_scene(tray(2, "motion.0.hold=0.1"))
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step(fields=n == STEPS - 1) for n in range(STEPS)]
    frames = simulation.frames()
    simulation.close()
    backend = ConnectedBackend(bundle, services.endpoint, record=False, timeout=READY)
    try:
        backend.reset(0)
        seen = []
        for step in range(STEPS):
            if step == 40:
                os.kill(services.children.pid("pbd"), signal.SIGKILL)
            seen.append(backend.step(1, None, step == STEPS - 1))
    finally:
        backend.close()
    reports = [each.report for each in seen]
    assert first_difference(wanted, reports) == ""
    assert [each.interfaces for each in wanted] == [each.interfaces for each in reports]
    assert any(reports[-1].interfaces) and reports[-1].wrench[:, 0].any()
    assert all(same_frame(frame, seen[-1].frames[name]) for name, frame in frames.items())
    assert any(event.kind == "participant_restored" for each in seen for event in each.events)


@pytest.mark.parametrize("victim", ["fem", "pbd"])
def test_a_tray_with_a_guest_sleeps_the_same_over_the_bus(services: Services, bus: Bus, victim: str) -> None:
    """A cube of FEM is gripped out of nine that sleep; its participant, or the others', is killed as they wake."""
    of = gripped((3, 3, 1), rest=0.2, own={"cube110": {"regions": {"default": "fem"}}}, sleep="calm")
    bundle, steps = bundle_scene(of), 70
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step(fields=n == steps - 1) for n in range(steps)]
    frames = simulation.frames()
    simulation.close()
    counts = [len(awake(report)) for report in wanted]
    assert counts[38] == 0
    killed = next(n for n in range(38, steps - 10) if counts[n])
    backend = ConnectedBackend(bundle, services.endpoint, record=False, timeout=READY)
    try:
        backend.reset(0)
        seen = []
        for step in range(steps):
            if step == killed:
                os.kill(services.children.pid(victim), signal.SIGKILL)
            seen.append(backend.step(1, None, step == steps - 1))
    finally:
        backend.close()
    assert first_difference(wanted, [each.report for each in seen]) == ""
    assert all(same_frame(frame, seen[-1].frames[name]) for name, frame in frames.items())
    assert any(event.kind == "participant_restored" for each in seen for event in each.events)
