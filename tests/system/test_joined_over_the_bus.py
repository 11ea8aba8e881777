"""Joined bodies over the bus: the same bits as in one process, whichever participant is killed meanwhile."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import joining
import pytest
from joining import tower
from real_services import LIMITS, READY, Lines, Services, free_port
from trajectory import first_difference, same_frame

from softseam.connected import ConnectedBackend
from softseam_protocol.scene.file import bundle_scene
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

pytestmark = pytest.mark.slow

STEPS = 120


@pytest.fixture(scope="module")
def extended(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    """Services that know the kinds of interface of `joining`, as this process does."""
    options, lines, set_to = BusOptions(connect=f"tcp/127.0.0.1:{free_port()}"), Lines(), pytest.MonkeyPatch()
    recordings, tests = tmp_path_factory.mktemp("recordings"), str(Path(joining.__file__).parent)
    paths = [tests, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    set_to.setenv("PYTHONPATH", os.pathsep.join(paths))
    set_to.setenv("SOFTSEAM_EXTENSIONS", "joining_rows")
    try:
        with joining.added(), supervisor(UpOptions(options, recordings, limits=LIMITS), lines) as children:
            running = Services(options, children, lines, recordings)
            running.wait_well()
            yield running
    finally:
        set_to.undo()


MIXED, FEM, XPBD = ("fem", "pbd", "fem"), ("fem",) * 3, ("pbd",) * 3
TOWERS = [("rest", MIXED, ""), ("rest", MIXED, "fem"), ("rest", MIXED, "pbd")]
TOWERS += [("contact", FEM, "fem"), ("contact", XPBD, "pbd"), ("contact", MIXED, "fem"), ("contact", MIXED, "pbd")]
TOWERS += [("contact", ("pbd", "fem", "fem"), "pbd")]


@pytest.mark.parametrize(("kind", "models", "victim"), TOWERS)
def test_a_tower_stands_the_same_over_the_bus(
    extended: Services, kind: str, models: tuple[str, ...], victim: str
) -> None:
    """Three cubes, of FEM and of XPBD, or in contact of one of them, that fall on one another: reports and last frames,
    bit for bit."""
    bundle = bundle_scene(tower(models, 0.003, {"kind": kind}), {})
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step(fields=n == STEPS - 1) for n in range(STEPS)]
    frames = simulation.frames()
    simulation.close()
    extended.wait_well()
    backend, reports = ConnectedBackend(bundle, extended.endpoint, record=False, timeout=READY), []
    try:
        backend.reset(0)
        for step in range(STEPS):
            if victim and step == 30:
                os.kill(extended.children.pid(victim), signal.SIGKILL)
            observation = backend.step(1, None, step == STEPS - 1)
            reports.append(observation.report)
            restored = [event.kind for event in observation.events]
            if victim and step == 30:
                assert "participant_restored" in restored
    finally:
        backend.close()
    assert first_difference(wanted, reports) == ""
    assert all(same_frame(frame, observation.frames[name]) for name, frame in frames.items())


def test_a_tower_sleeps_the_same_over_the_bus(extended: Services) -> None:
    """It comes to rest and sleeps: from then on no message asks for a step, and reports are those of one process."""
    bundle = bundle_scene(tower(("fem", "pbd"), 0.001, sleep="calm"), {})
    simulation = Simulation(bundle, EmbeddedTransport())
    wanted = [simulation.step() for _ in range(STEPS)]
    simulation.close()
    assert wanted[0].parts["cube0.far"].iterations and not wanted[-1].parts["cube0.far"].iterations
    extended.wait_well()
    backend = ConnectedBackend(bundle, extended.endpoint, record=False, timeout=READY)
    try:
        backend.reset(0)
        reports = [backend.step(1, None, False).report for _ in range(STEPS)]
    finally:
        backend.close()
    assert first_difference(wanted, reports) == ""
