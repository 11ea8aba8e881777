"""Bodies that touch by the scene's `contacts`, over the bus: the same bits, reports of pairs and all, though their
participant is killed."""

from __future__ import annotations

import os
import signal

import pytest
from cubes import tray
from real_services import READY, Services
from trajectory import first_difference, same_frame

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
