"""A participant from outside, in a process of its own, takes the far part of a cantilever: the beam bends as it should.

The example that comes along, started as its page says; it has no solver of softseam in it.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

import softseam
from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.topics import Keys
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor

pytestmark = pytest.mark.slow

READY = 300.0
"""until all services are ready, the compilation of every kernel included [s]"""
STEPS = 150
"""0.3 s: the tip swings to its lowest point and starts back"""


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Services whose orchestrator has the part `far` taken by the service `block`, which is not among them."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    options = UpOptions(BusOptions(connect=where), tmp_path_factory.mktemp("recordings"), routes={"body.far": "block"})
    lines: list[str] = []
    with supervisor(options, lines.append) as services:
        assert services.wait_ready(READY), lines
        yield where


@contextmanager
def block(endpoint: str) -> Iterator[subprocess.Popen[str]]:
    """The example in a process of its own, which answers."""
    command = [sys.executable, "-m", "softseam.examples.participant", "--connect", endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path("/"), env=os.environ) as process:
        try:
            assert process.stdout is not None and "answers" in process.stdout.readline()
            yield process
        finally:
            process.terminate()


def tip(
    connect: str | None, steps: int = STEPS, before: Callable[[int], None] = lambda step: None
) -> tuple[list[float], float]:
    """Deflection of the tip after each step [m], and the largest gap at the seam [m]; `before` is called before each
    step."""
    deflections, gaps = [], [0.0]
    with softseam.open("cantilever", connect=connect) as sim:
        sim.reset(seed=0)
        for step in range(steps):
            before(step)
            seen = sim.step()
            deflections.append(seen.quantities["tip_deflection"])
            assert seen.seam is not None
            gaps.append(seen.seam.gap)
    return deflections, max(gaps)


def test_a_beam_whose_far_half_is_the_example_bends_as_one(endpoint: str) -> None:
    """Within 2 % of the default, whose far half is XPBD: both divide cells into octants, and theirs bends as a whole.

    The reference of the scene, -150.4 mm at its lowest, is as near to both.
    """
    with block(endpoint), Bus(endpoint, role=SERVICE) as bus:
        assert len(bus.live(Keys().every_live("participant", "block"))) == 1
        ours, gap = tip(endpoint)
    theirs, _ = tip(None)
    assert gap < 3e-4 * 0.025  # as the scene's seam tolerates
    assert min(ours) == pytest.approx(min(theirs), rel=0.02)
    assert min(ours) == pytest.approx(-0.1504, rel=0.04)
    np.testing.assert_allclose(ours, theirs, atol=0.02 * 0.15)
    assert np.abs(np.subtract(ours, theirs)).max() > 1e-6, "the far half is the default's own"


def test_another_takes_over_from_one_that_is_killed_and_the_beam_bends_to_the_same_bits(endpoint: str) -> None:
    """It dies at work, and is started again while the orchestrator waits for it."""
    with block(endpoint):
        whole, _ = tip(endpoint, 40)
    with ExitStack() as stack:
        first = stack.enter_context(block(endpoint))

        def takes_over() -> None:
            first.kill()
            stack.enter_context(block(endpoint))

        other = threading.Thread(target=takes_over)

        def before(step: int) -> None:
            if step == 20:
                other.start()

        disturbed, _ = tip(endpoint, 40, before)
        other.join(30.0)
        assert first.wait(10.0) != 0
    assert disturbed == whole
