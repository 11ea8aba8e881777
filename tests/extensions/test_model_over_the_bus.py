"""A model from outside, under its own name and by its own service, takes the far half of a cantilever.

The example that comes along is the service; its row is an extension that all services and the client import.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import softseam
from softseam.choice import choices
from softseam_protocol.extensions import VARIABLE, load_extensions
from softseam_protocol.models import MODELS
from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor

pytestmark = pytest.mark.slow

ROW = """
from softseam_protocol.models import MODELS, ModelFacts

MODELS.add("block", ModelFacts(label="Block", colour=(120, 200, 120), service="block"))
"""
READY = 300.0
"""until all services are ready, the compilation of every kernel included [s]"""
STEPS = 40


@pytest.fixture
def endpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Services that know the model `block`, and the process that answers for it."""
    (tmp_path / "block_row.py").write_text(ROW)
    monkeypatch.setenv(VARIABLE, "block_row")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *os.environ.get("PYTHONPATH", "").split(":")]))
    monkeypatch.syspath_prepend(str(tmp_path))
    load_extensions()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    lines: list[str] = []
    try:
        with supervisor(UpOptions(BusOptions(connect=where), tmp_path / "recordings"), lines.append) as services:
            assert services.wait_ready(READY), lines
            command = [sys.executable, "-m", "softseam.examples.participant", "--connect", where]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as block:
                try:
                    assert block.stdout is not None and "answers" in block.stdout.readline()
                    yield where
                finally:
                    block.terminate()
    finally:
        MODELS.remove("block")


def tip(connect: str, *settings: str) -> tuple[float, dict[str, str], str]:
    """Deflection of the tip [m] after some steps, the model of each part, and what the run's first line says."""
    with softseam.open("cantilever", connect=connect, settings=settings) as sim:
        seen = sim.reset(seed=0)
        for _ in range(STEPS):
            seen = sim.step()
        said = choices(sim.scene, seen.parts, seen.events)["body"]
        return seen.quantities["tip_deflection"], {name: part.model for name, part in seen.parts.items()}, said


def test_its_part_is_moved_by_its_service_and_called_by_its_name(endpoint: str) -> None:
    usual, _, _ = tip(endpoint)
    own, models, said = tip(endpoint, "regions.default=block")
    assert models == {"body.near": "fem", "body.far": "block"}
    assert said == "FEM on 16, Block on 16 of 32 cells, as the scene's regions say"
    assert own == pytest.approx(usual, rel=0.02) and own != usual
