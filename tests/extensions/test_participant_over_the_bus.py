"""A participant from outside, in a process of its own, takes the far part of a cantilever: the beam bends as it should.

The example that comes along, started as its page says; it has no solver of softseam in it.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import softseam
from softseam_protocol.bus.client import Bus
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
    """Services whose orchestrator has the part `far` taken by the service `block`, and that service."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    options = UpOptions(BusOptions(connect=where), tmp_path_factory.mktemp("recordings"), routes={"body.far": "block"})
    lines: list[str] = []
    with supervisor(options, lines.append) as services:
        assert services.wait_ready(READY), lines
        command = [sys.executable, "-m", "softseam.examples.participant", "--connect", where]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path("/"), env=os.environ) as block:
            try:
                assert block.stdout is not None and "answers" in block.stdout.readline()
                yield where
            finally:
                block.terminate()


def tip(connect: str | None) -> tuple[list[float], float]:
    """Deflection of the tip after each step [m], and the largest gap at the seam [m]."""
    deflections, gaps = [], [0.0]
    with softseam.open("cantilever", connect=connect) as sim:
        sim.reset(seed=0)
        for _ in range(STEPS):
            seen = sim.step()
            deflections.append(seen.quantities["tip_deflection"])
            assert seen.seam is not None
            gaps.append(seen.seam.gap)
    return deflections, max(gaps)


def test_a_beam_whose_far_half_is_the_example_bends_as_one(endpoint: str) -> None:
    """Within 2 % of the default, whose far half is XPBD: both divide cells into octants, and theirs bends as a whole.

    The reference of the scene, -150.4 mm at its lowest, is as near to both.
    """
    with Bus(endpoint) as bus:
        assert len(bus.live(Keys().every_live("participant", "block"))) == 1
    ours, gap = tip(endpoint)
    theirs, _ = tip(None)
    assert gap < 3e-4 * 0.025  # as the scene's seam tolerates
    assert min(ours) == pytest.approx(min(theirs), rel=0.02)
    assert min(ours) == pytest.approx(-0.1504, rel=0.04)
    np.testing.assert_allclose(ours, theirs, atol=0.02 * 0.15)
    assert np.abs(np.subtract(ours, theirs)).max() > 1e-6, "the far half is the default's own"
